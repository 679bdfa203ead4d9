"""Readings as they come, for many robots: each is a view, or only moves its robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, unpack
from albot_core.kernels.compiled import ZERO, kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.crossing import cross_exit
from albot_core.mappers.albot1.exits import NO_GATE, Exits, remember_exits
from albot_core.mappers.albot1.mapping import STEP, STRANGE, map_step
from albot_core.mappers.albot1.memory import ALIVE, NEXT_ID, SUSPECT, VISIT, Memory, room_left
from albot_core.mappers.albot1.outlook import Outlook, make_outlook
from albot_core.mappers.albot1.recognition import moved, pose_in
from albot_core.mappers.albot1.sight import Sight, copy_sight
from albot_core.mappers.albot1.storage import (
    CAPACITY,
    ROOM,
    crumbs_at,
    exits_at,
    graph_at,
    memory_at,
    sight_at,
)
from albot_core.mappers.albot1.trail.breadcrumbs import CRUMB_SPACING, CRUMB_TURN
from albot_core.mappers.albot1.trail.crumb_kernels import drop_crumb, has_room
from albot_core.mappers.albot1.visits import allay, is_time_to_look
from albot_core.matching.lines import length_of, wrap
from albot_core.sensing.surfaces import NO_EDGE, Bench, extract_surfaces, make_bench


class Lens(NamedTuple):
    """What views are constructed with."""

    directions: np.ndarray
    """(beams, 2) float64: unit vectors of the beams in the robot's frame."""
    mount: tuple[float, float]
    """Where the laser is in the robot's frame (m)."""
    max_range: float
    """Points at or beyond this distance are dropped (m)."""
    thresholds: np.ndarray
    """(4,) float64: see `ViewConfig.thresholds`."""
    fit_lines: bool
    """See `ViewConfig`."""


CROSSED, SUSPECTED, ASTRAY, TROD = 1, 2, 4, 8
"""In `Robots.events`: the robot got through an exit; it met enough surfaces of an earlier visit,
and it is time to compare places; it was moved; it has gone a stride or looks elsewhere, and must
not tread on its trail before the rest has been seen to."""


class Robots(NamedTuple):
    """The arrays of all robots; a row each."""

    table: np.ndarray
    """(n, COLUMNS) int64: where the robot's arrays are (see `storage`)."""
    progress: np.ndarray
    """(n, 5) int64: how far it has come (see `mapping`)."""
    since: np.ndarray
    """(n, 3) float64: how it has moved since its last view (m, rad; the view's frame)."""
    poses: np.ndarray
    """(n, 3) float64: where it believes to be (m, rad; the map's frame)."""
    surfaces: np.ndarray
    """(n,) int64: how many surfaces it remembers."""
    events: np.ndarray
    """(n,) int64: what happened at the last reading: a sum of CROSSED, SUSPECTED, ASTRAY, TROD."""
    trod: np.ndarray
    """(n, 3) float64: where it trod on its trail last (m, rad; the map's frame)."""
    next_ids: np.ndarray
    """(n,) int64: the id that the next surface would have had before the last view."""
    current: np.ndarray
    """(n,) int64: the id of the place that it believes to be in."""
    displacements: np.ndarray
    """(n, 3) float64: where the enduring frame of its places lies (m, rad; the map's frame)."""
    is_lost: np.ndarray
    """(n,) bool: whether it has lost its way."""
    looked_from: np.ndarray
    """(n, 3) float64: where it last compared places in its present visit (m, rad; the map's
    frame); NaN where it has not yet."""


_since, _here = scratch(3), scratch(3)


@kernel(arrays=True)
def _desk(room: int) -> Sight:
    """A view to work on, which every robot of a call uses in turn."""
    return Sight(
        np.empty((room, 4)),
        np.empty((room, 2), np.int8),
        np.empty(room, np.bool_),
        np.empty(room, np.int64),
        np.zeros(1, np.int64),
        np.zeros(3),
    )


@kernel()
def find_landmarks(current: Sight, limits: Limits) -> None:
    """Section 3.1.4: long surfaces with an occluding or corner point are landmarks."""
    for k in range(current.size[0]):
        current.landmark[k] = length_of(current.surfaces[k]) >= limits.landmark_length and (
            current.edges[k, 0] != NO_EDGE or current.edges[k, 1] != NO_EDGE
        )


@kernel()
def _look(ranges: np.ndarray, lens: Lens, limits: Limits, current: Sight, bench: Bench) -> None:
    """Construct the view from a scan (algorithm 4, lines 3 and 4)."""
    current.size[0] = extract_surfaces(
        ranges,
        lens.directions,
        lens.mount[0],
        lens.mount[1],
        lens.max_range,
        lens.thresholds,
        lens.fit_lines,
        bench,
        current.surfaces,
        current.edges,
    )
    find_landmarks(current, limits)


@kernel()
def _is_near(motion: np.ndarray, limits: Limits) -> bool:
    """Whether the last view was taken so near that the robot does not look again."""
    square = motion[0] * motion[0] + motion[1] * motion[1]
    return bool(square < limits.view_spacing**2 and abs(motion[2]) < limits.view_turn)


@kernel()
def _has_gone_on(pose: np.ndarray, trod: np.ndarray) -> bool:
    """Whether it is time to tread on the trail; then it does so here."""
    square = (pose[0] - trod[0]) ** 2 + (pose[1] - trod[1]) ** 2
    if square < CRUMB_SPACING**2 and abs(wrap(pose[2] - trod[2])) < CRUMB_TURN:
        return False
    for i in range(3):
        trod[i] = pose[i]
    return True


@kernel()
def _has_room(memory: Memory, previous: Sight, current: Sight) -> bool:
    """Whether the map has room for all that may come of a view.

    A view is laid over the map when it is new and when the next is, but once; and again
    where a visit begins with it.
    """
    surfaces = previous.size[0] + 2 * current.size[0]
    visits = memory.counts[VISIT] + 2
    return bool(room_left(memory) >= surfaces and visits < memory.met.shape[0])


@kernel()
def _tread(robots: Robots, row: int, view: Sight) -> None:
    """Let a robot to which nothing else has happened tread on its trail."""
    here = _here()
    pose_in(robots.displacements[row], robots.poses[row], here)
    crumbs, graph = crumbs_at(robots.table[row]), graph_at(robots.table[row])
    drop_crumb(crumbs, graph, robots.current[row], here, view.surfaces[: view.size[0]])


@kernel()
def has_cause_to_look(
    robots: Robots, row: int, memory: Memory, exits: Exits, pose: np.ndarray, limits: Limits
) -> bool:
    """Whether the robot has met enough of an earlier visit, and it is time to compare places.

    A suspicion that comes before its time is allayed, but that of one that has lost its way.
    Between two places there is no telling which it is in.
    """
    if memory.counts[SUSPECT] == 0 or exits.counts[1] != NO_GATE:
        return False
    looked_from = robots.looked_from[row]
    if is_time_to_look(looked_from, pose, limits.look_spacing, limits.look_turn):
        return True
    if not robots.is_lost[row]:
        allay(memory.met, memory.counts)
    return False


@kernel()
def _view(
    robots: Robots,
    row: int,
    previous: Sight,
    current: Sight,
    ranges: np.ndarray,
    since: np.ndarray,
    lens: Lens,
    limits: Limits,
    bench: Bench,
    outlook: Outlook,
) -> bool:
    """Let a robot take in its reading as a view; false as `_follow`."""
    _look(ranges, lens, limits, current, bench)
    memory, progress = memory_at(robots.table[row]), robots.progress[row]
    if not _has_room(memory, previous, current) or current.size[0] > robots.table[row, ROOM]:
        return False
    x, y = previous.pose[0], previous.pose[1]
    robots.next_ids[row] = memory.counts[NEXT_ID]
    map_step(memory, previous, current, since, limits, progress, outlook)
    copy_sight(current, previous)
    exits = exits_at(robots.table[row])
    remember_exits(exits, current, limits)
    if progress[STRANGE] > 1:
        robots.events[row] += ASTRAY
    elif progress[STRANGE] == 0 and cross_exit(exits, x, y, current.pose):
        robots.events[row] += CROSSED
    elif has_cause_to_look(robots, row, memory, exits, current.pose, limits):
        robots.events[row] += SUSPECTED
    robots.surfaces[row] = memory.counts[ALIVE]
    for i in range(3):
        since[i] = 0.0
    return True


@kernel()
def _follow(
    robots: Robots,
    row: int,
    ranges: np.ndarray,
    motion: np.ndarray,
    lens: Lens,
    limits: Limits,
    current: Sight,
    bench: Bench,
    outlook: Outlook,
) -> bool:
    """Let a robot take in its reading; false, with nothing done, where its room is too small."""
    if not has_room(graph_at(robots.table[row])):
        return False
    is_first, since = robots.progress[row, STEP] == 0, _since()
    since[0] = since[1] = since[2] = 0.0
    previous = sight_at(robots.table[row])
    robots.events[row] = 0
    if not is_first:
        moved(robots.since[row], motion, since)
    is_view = is_first or not _is_near(since, limits)
    if is_view and not _view(
        robots, row, previous, current, ranges, since, lens, limits, bench, outlook
    ):
        return False
    for i in range(3):
        robots.since[row, i] = since[i]
    moved(previous.pose, since, robots.poses[row])
    if _has_gone_on(robots.poses[row], robots.trod[row]):
        if robots.events[row] > 0 or robots.is_lost[row]:
            robots.events[row] += TROD
        else:
            _tread(robots, row, previous)
    return True


@kernel(arrays=True, nogil=True)
def follow(
    rows: np.ndarray,
    first: int,
    arguments: KernelArguments,
    ranges: np.ndarray,
    motions: np.ndarray,
) -> int:
    """Let the robots in rows[first:] take in their readings; return how many rows are done.

    That is all of them, but where the next has too little room for what it sees: then it has
    taken in nothing yet. `ranges` (n, beams) and `motions` (n, 3) are the readings of all robots;
    `arguments` holds `Robots`, `Lens` and `Limits`.
    """
    robots, _, limits = unpack(arguments)
    beams, views, capacity = ranges.shape[1], ranges.shape[1], ZERO
    for k in range(first, rows.shape[0]):
        views = max(views, robots.table[rows[k], ROOM])
        capacity = max(capacity, robots.table[rows[k], CAPACITY])
    outlook = make_outlook(views, capacity, limits.turns.shape[0])
    bench = make_bench(beams)
    return _follow_all(rows, first, arguments, ranges, motions, _desk(beams), bench, outlook)


@kernel()
def _follow_all(
    rows: np.ndarray,
    first: int,
    arguments: KernelArguments,
    ranges: np.ndarray,
    motions: np.ndarray,
    current: Sight,
    bench: Bench,
    outlook: Outlook,
) -> int:
    """`follow`, with a view to work on and room to work in."""
    robots, lens, limits = unpack(arguments)
    for k in range(first, rows.shape[0]):
        row = rows[k]
        if not _follow(
            robots, row, ranges[row], motions[row], lens, limits, current, bench, outlook
        ):
            return k
    return int(rows.shape[0])
