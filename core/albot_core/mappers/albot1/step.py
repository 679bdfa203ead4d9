"""The step of many robots: each reading is processed as a view or as motion only. Compiled.

The compiled loop comprises algorithms 1 to 4, the exits in view, and the breadcrumbs. Rare events
are only noted here; `handle_events` handles them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import ZERO, kernel, scratch
from albot_core.mappers.albot1.addresses import (
    MAP_ROOM,
    VIEW_ROOM,
    crumbs_at,
    exits_at,
    graph_at,
    map_at,
    view_at,
)
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import compose_pose, relative_pose
from albot_core.mappers.albot1.perceptual_map.mapping import (
    map_step,
)
from albot_core.mappers.albot1.perceptual_map.memory import (
    ALIVE,
    NEXT_ID,
    VISIT,
    LocatedView,
    PerceptualMap,
    copy_view,
    room_left,
)
from albot_core.mappers.albot1.perceptual_map.submap import MatchBuffers, make_match_buffers
from albot_core.mappers.albot1.perceptual_map.viewing import (
    is_view_due,
    note_sectors,
    take_view,
)
from albot_core.mappers.albot1.places.exits import cross_exit, remember_exits
from albot_core.mappers.albot1.places.visits import keep_or_drop_candidate
from albot_core.mappers.albot1.trail.breadcrumbs import CRUMB_SPACING, CRUMB_TURN
from albot_core.mappers.albot1.trail.crumb_kernels import drop_crumb, has_room
from albot_core.matching.lines import wrap
from albot_core.sensing.view import ViewBuffers, ViewSettings, make_view_buffers

CROSSED, REVISITING, KIDNAPPED, BREADCRUMB = 1, 2, 4, 8
"""Bits of `BatchArrays.events`: the robot has crossed an exit; an earlier visit is a loop-closure
candidate and places must be compared; the robot was carried away; a breadcrumb is due, but the
other events must be handled first."""


class BatchArrays(NamedTuple):
    """The arrays of all robots; one row for each robot."""

    table: np.ndarray
    """(n, COLUMNS) int64: the addresses of the robot's arrays (see `addresses`)."""
    progress: np.ndarray
    """(n, 5) int64: the robot's counters (see `mapping`)."""
    odometers: np.ndarray
    """(n, 5) float64: the learnt errors of the robot's odometer (see `odometer_error`)."""
    sectors: np.ndarray
    """(n, SECTORS) float64: the nearest ranges of the robot's last view (m; see `viewing`)."""
    since: np.ndarray
    """(n, 3) float64: the robot's motion since its last view (m, rad; the view's frame)."""
    poses: np.ndarray
    """(n, 3) float64: the robot's estimated pose (m, rad; the map's frame)."""
    surfaces: np.ndarray
    """(n,) int64: number of surfaces in the robot's map."""
    events: np.ndarray
    """(n,) int64: the events of the last reading, a sum of CROSSED, REVISITING, KIDNAPPED and
    BREADCRUMB."""
    readings: np.ndarray
    """(n,) int64: number of readings processed, within a step without the present one."""
    crumb_poses: np.ndarray
    """(n, 3) float64: the pose of the robot's last breadcrumb (m, rad; the map's frame)."""
    next_ids: np.ndarray
    """(n,) int64: the id that the next surface would have had before the last view."""
    current: np.ndarray
    """(n,) int64: the id of the place in which the robot believes to be."""
    map_to_graph: np.ndarray
    """(n, 3) float64: the pose of the places' graph frame (m, rad; the map's frame)."""
    is_lost: np.ndarray
    """(n,) bool: whether the robot was carried away and has not been relocalised."""
    compared_from: np.ndarray
    """(n, 3) float64: the robot's pose when it last compared places in its present visit (m, rad;
    the map's frame); NaN before the first comparison."""


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def step_robots(
    rows: np.ndarray,
    arguments: KernelArguments,
    first: int,
    ranges: np.ndarray,
    motions: np.ndarray,
) -> int:
    """Process the readings of the robots in rows[first:]; return the number of rows done.

    The loop stops before a robot whose arrays have too little room for its reading; nothing of that
    reading has been processed then. `ranges` (n, beams) and `motions` (n, 3) are the readings of
    all robots; `arguments` holds `BatchArrays`, `ViewSettings` and `Albot1Limits`.
    """
    robots, _, _ = unpack(arguments)
    beams, views, capacity = ranges.shape[1], ranges.shape[1], ZERO
    for k in range(first, rows.shape[0]):
        views = max(views, robots.table[rows[k], VIEW_ROOM])
        capacity = max(capacity, robots.table[rows[k], MAP_ROOM])
    buffers = make_match_buffers(views, capacity)
    view_buffers = make_view_buffers(beams)
    return _step_all(
        rows, first, arguments, ranges, motions, _empty_current(beams), view_buffers, buffers
    )


@kernel(arrays=True)
def _empty_current(room: int) -> LocatedView:
    """Return an empty view as a scratch buffer, which all robots of a call use in turn."""
    return LocatedView(
        np.empty((room, 4)),
        np.empty((room, 2), np.int8),
        np.empty(room, np.bool_),
        np.empty(room, np.int64),
        np.zeros(1, np.int64),
        np.zeros(3),
    )


@kernel()
def _step_all(
    rows: np.ndarray,
    first: int,
    arguments: KernelArguments,
    ranges: np.ndarray,
    motions: np.ndarray,
    current: LocatedView,
    view_buffers: ViewBuffers,
    buffers: MatchBuffers,
) -> int:
    """Process readings as `step_robots` does, with scratch buffers."""
    robots, settings, limits = unpack(arguments)
    for k in range(first, rows.shape[0]):
        row = rows[k]
        if not _step(
            robots, row, ranges[row], motions[row], settings, limits, current, view_buffers, buffers
        ):
            return k
        robots.readings[row] += 1
    return int(rows.shape[0])


_since, _here = scratch(3), scratch(3)


@kernel()
def _step(
    robots: BatchArrays,
    row: int,
    ranges: np.ndarray,
    motion: np.ndarray,
    settings: ViewSettings,
    limits: Albot1Limits,
    current: LocatedView,
    view_buffers: ViewBuffers,
    buffers: MatchBuffers,
) -> bool:
    """Process a robot's reading. Returns false, and changes nothing, if its arrays lack room."""
    if not has_room(graph_at(robots.table[row])):
        return False
    is_first, since = robots.progress[row].step == 0, _since()
    since[0] = since[1] = since[2] = 0.0
    previous = view_at(robots.table[row])
    robots.events[row] = 0
    if not is_first:
        compose_pose(robots.since[row], motion, since)
    odometer, sectors = robots.odometers[row], robots.sectors[row]
    # A reading that is no view only moves the robot.
    if is_first or is_view_due(ranges, since, motion, odometer, sectors, limits):
        if not _step_view(
            robots, row, previous, current, ranges, since, settings, limits, view_buffers, buffers
        ):
            return False
        note_sectors(ranges, sectors)
    for i in range(3):
        robots.since[row, i] = since[i]
    pose = robots.poses[row]
    compose_pose(previous.pose, since, pose)
    if _is_crumb_due(pose, robots.crumb_poses[row]):
        for i in range(3):
            robots.crumb_poses[row, i] = pose[i]
        if robots.events[row] > 0 or robots.is_lost[row]:
            robots.events[row] += BREADCRUMB
        else:
            _drop_crumb(robots, row, previous)
    return True


@kernel()
def _step_view(
    robots: BatchArrays,
    row: int,
    previous: LocatedView,
    current: LocatedView,
    ranges: np.ndarray,
    since: np.ndarray,
    settings: ViewSettings,
    limits: Albot1Limits,
    view_buffers: ViewBuffers,
    buffers: MatchBuffers,
) -> bool:
    """Process a robot's reading as a view. Returns false if its arrays lack room, as `_step`."""
    take_view(ranges, settings, limits, current, view_buffers)
    pm, progress = map_at(robots.table[row]), robots.progress[row]
    if not _has_room(pm, previous, current) or current.size[0] > robots.table[row, VIEW_ROOM]:
        return False
    x, y = previous.pose[0], previous.pose[1]
    robots.next_ids[row] = pm.counts[NEXT_ID]
    odometer, updates = robots.odometers[row], progress.updates
    map_step(pm, previous, current, since, limits, progress, odometer, settings.beam_model, buffers)
    copy_view(current, previous)
    exits, pose = exits_at(robots.table[row]), current.pose
    if limits.remembers_places:
        remember_exits(exits, current, limits)
    compared_from, is_lost = robots.compared_from[row], robots.is_lost[row]
    if progress.inconsistent > 1:
        robots.events[row] += KIDNAPPED
    elif progress.inconsistent == 0 and cross_exit(exits, x, y, pose):
        robots.events[row] += CROSSED
    elif keep_or_drop_candidate(
        pm, exits, compared_from, is_lost, pose, progress.updates > updates, limits
    ):
        robots.events[row] += REVISITING
    robots.surfaces[row] = pm.counts[ALIVE]
    for i in range(3):
        since[i] = 0.0
    return True


@kernel()
def _has_room(pm: PerceptualMap, previous: LocatedView, current: LocatedView) -> bool:
    """Return whether the map has room for all surfaces that a view may add.

    The previous view may be laid over the map once, and the current view twice: the second time
    where a new visit begins with it.
    """
    surfaces = previous.size[0] + 2 * current.size[0]
    visits = pm.counts[VISIT] + 2
    return bool(room_left(pm) >= surfaces and visits < pm.reobserved.shape[0])


@kernel()
def _is_crumb_due(pose: np.ndarray, crumb_pose: np.ndarray) -> bool:
    """Return whether the robot moved or turned far enough since its last breadcrumb."""
    square = (pose[0] - crumb_pose[0]) ** 2 + (pose[1] - crumb_pose[1]) ** 2
    return not (square < CRUMB_SPACING**2 and abs(wrap(pose[2] - crumb_pose[2])) < CRUMB_TURN)


@kernel()
def _drop_crumb(robots: BatchArrays, row: int, view: LocatedView) -> None:
    """Drop a breadcrumb at a reading without other events."""
    here = _here()
    relative_pose(robots.map_to_graph[row], robots.poses[row], here)
    crumbs, graph = crumbs_at(robots.table[row]), graph_at(robots.table[row])
    crumbs.last[2] = robots.readings[row]
    drop_crumb(crumbs, graph, robots.current[row], here, view.surfaces[: view.size[0]])
