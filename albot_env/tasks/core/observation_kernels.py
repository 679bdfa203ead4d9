"""All parts of observations in their order, and the compiled loop that fills them in.

A part is added by its object (`parts`), and here: in `PARTS`, and by a line that fills it in. The
loop also tracks coverage and rooms entered.
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import POINT, TRAVEL
from albot_env.tasks.core.coverage_kernels import (
    CoverageGrid,
    CoverageSensor,
    accumulate_motion,
    cover,
)
from albot_env.tasks.core.obstacle_kernels import remember_obstacles
from albot_env.tasks.core.onward_kernels import find_onward
from albot_env.tasks.core.parts.beliefs import (
    CONFIDENCE,
    EXIT_HOME,
    HEADING,
    HOME,
    PLACE,
    TIME_LEFT,
    WAY,
    fill_confidence,
    fill_exit,
    fill_heading,
    fill_home,
    fill_place,
    fill_time_left,
    fill_way,
    locate_home,
)
from albot_env.tasks.core.parts.ground import (
    COVERAGE,
    FRONTIER,
    ONWARD,
    PATH,
    SHORTCUT,
    fill_coverage,
    fill_frontier,
    fill_onward,
    fill_path,
    fill_shortcut,
)
from albot_env.tasks.core.parts.map_patch import MAP_PATCH, fill_map_patch
from albot_env.tasks.core.parts.matches import MATCHES, fill_matches
from albot_env.tasks.core.parts.part import GraphScratch, ObservationPart, Sources
from albot_env.tasks.core.parts.place_graph import PLACE_GRAPH, fill_place_graph
from albot_env.tasks.core.parts.sensors import (
    COMPASS,
    LASER,
    MOTION,
    SONAR,
    fill_compass,
    fill_laser,
    fill_motion,
    fill_sonar,
)
from albot_env.tasks.core.parts.truth import TRUE_HOME, TRUE_PATCH
from albot_env.tasks.core.rooms import Rooms, find_room
from albot_env.tasks.core.state import BatchState, ExplorationProgress, true_state
from albot_env.tasks.core.wayfinding_kernels import (
    OccupancyParams,
    find_path,
    find_shortcut,
    update_occupancy,
)

PARTS: tuple[ObservationPart[Any], ...] = (
    LASER, SONAR, MOTION, COMPASS, HEADING, HOME, CONFIDENCE, PLACE, EXIT_HOME, WAY, SHORTCUT,
    PATH, COVERAGE, FRONTIER, ONWARD, TIME_LEFT, MAP_PATCH, PLACE_GRAPH,
    MATCHES, TRUE_HOME, TRUE_PATCH,
)  # fmt: skip
"""All parts, in their order in the flat observation."""
Layout: Any = namedtuple("Layout", [part.name for part in PARTS])  # type: ignore[misc]
"""Index at which each part begins in an observation; -1 for parts that are not observed."""


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def observe_robots(rows: np.ndarray, arguments: KernelArguments, observations: np.ndarray) -> None:
    """Track the progress of robots `rows`, and fill in their rows of `observations`.

    `arguments` holds `CoverageSensor`, the `CoverageGrid` truly covered, the one believed covered,
    `Rooms`, `Scales`, `Layout`, `BatchState`, `ExplorationProgress`, `OccupancyParams`,
    `SearchParams`, `OccupancyGrids`, `MapArrays`, those of the truth, and `ObstacleMemory`.
    """
    sensor, covered, believed, _, scales, _, state, _, _, search, occupancy, maps, truth, seen = (
        unpack(arguments)
    )
    # Allocated here because the loop itself is faster if it makes no arrays (see `kernel`).
    nearest = np.empty(scales.sectors)
    frontier = np.empty(scales.sectors if scales.sectors else state.ranges.shape[1])
    graph = GraphScratch(
        shown=np.empty(scales.graph.places, np.int64),
        away=np.empty(scales.graph.places),
        rows=np.empty(maps.places.rows.shape[1], np.int64),
    )
    sources = Sources(
        scales, state, sensor, believed, search, occupancy, nearest, frontier, maps, graph, seen
    )
    true = true_state(state)
    truths = Sources(
        scales, true, sensor, covered, search, occupancy, nearest, frontier, truth, graph, seen
    )
    _observe_robots(rows, arguments, sources, truths, observations)


@kernel()
def _observe_robots(
    rows: np.ndarray,
    arguments: KernelArguments,
    sources: Sources,
    truths: Sources,
    observations: np.ndarray,
) -> None:
    """Run `observe_robots` with what the parts are computed from, as believed and in truth."""
    sensor, covered, believed, rooms, scales, layout, state, progress, params, _, _, _, _, seen = (
        unpack(arguments)
    )
    for i in rows:
        belief = state.beliefs[i]
        turn = math.cos(belief[2]), math.sin(belief[2])
        progress.new_ground[i] = 0
        if accumulate_motion(state.motions[i], scales.spacing, scales.turn, progress.moved[i]):
            cover(believed, i, belief, turn, sensor, state.ranges[i])
            _cover_truly(i, covered, sensor, state, progress)
        _enter_room(i, rooms, state, progress)
        if seen.side:
            remember_obstacles(seen, i, sensor, state.motions[i], state.ranges[i])
        locate_home(belief, turn, state.homes_in_map[i], state.homes_in_robot[i])
        _fill_sensed(i, layout, sources, observations[i])
        _fill_believed(i, layout, sources, observations[i])
        _fill_ground(i, layout, params, sources, observations[i])
        _fill_remembered(i, layout, sources, observations[i])
        _reveal(i, layout, truths, observations[i])


@kernel()
def _fill_sensed(i: int, layout: Any, sources: Sources, row: np.ndarray) -> None:
    """Fill in the observed parts that come from robot i's latest reading."""
    if layout.laser >= 0:
        fill_laser(i, sources, row[layout.laser :])
    if layout.sonar >= 0:
        fill_sonar(i, sources, row[layout.sonar :])
    if layout.motion >= 0:
        fill_motion(i, sources, row[layout.motion :])
    if layout.compass >= 0:
        fill_compass(i, sources, row[layout.compass :])


@kernel()
def _fill_believed(i: int, layout: Any, sources: Sources, row: np.ndarray) -> None:
    """Fill in the observed parts that come from robot i's mapper, and its time left."""
    if layout.heading >= 0:
        fill_heading(i, sources, row[layout.heading :])
    if layout.home >= 0:
        fill_home(i, sources, row[layout.home :])
    if layout.confidence >= 0:
        fill_confidence(i, sources, row[layout.confidence :])
    if layout.place >= 0:
        fill_place(i, sources, row[layout.place :])
    if layout.exit >= 0:
        fill_exit(i, sources, row[layout.exit :])
    if layout.way >= 0:
        fill_way(i, sources, row[layout.way :])
    if layout.time_left >= 0:
        fill_time_left(i, sources, row[layout.time_left :])


@kernel()
def _fill_ground(
    i: int, layout: Any, params: OccupancyParams, sources: Sources, row: np.ndarray
) -> None:
    """Fill in the observed parts that show the ground around robot i, and ways over it."""
    if layout.coverage >= 0:
        fill_coverage(i, sources, row[layout.coverage :])
    if layout.frontier >= 0:
        fill_frontier(i, sources, row[layout.frontier :])
    if layout.shortcut >= 0 or layout.path >= 0 or layout.onward >= 0:
        _find_ways(i, layout, params, sources)
    if layout.shortcut >= 0:
        fill_shortcut(i, sources, row[layout.shortcut :])
    if layout.path >= 0:
        fill_path(i, sources, row[layout.path :])
    if layout.onward >= 0:
        fill_onward(i, sources, row[layout.onward :])


@kernel()
def _fill_remembered(i: int, layout: Any, sources: Sources, row: np.ndarray) -> None:
    """Fill in the observed parts that show what robot i's mapper remembers."""
    if layout.map_patch >= 0:
        fill_map_patch(i, sources, row[layout.map_patch :])
    if layout.place_graph >= 0:
        fill_place_graph(i, sources, row[layout.place_graph :])
    if layout.matches >= 0:
        fill_matches(i, sources, row[layout.matches :])


@kernel()
def _reveal(i: int, layout: Any, truths: Sources, row: np.ndarray) -> None:
    """Fill in the observed parts that reveal the truth about robot i."""
    if layout.true_home < 0 and layout.true_patch < 0:
        return
    state = truths.state
    pose = state.beliefs[i]
    turn = math.cos(pose[2]), math.sin(pose[2])
    locate_home(pose, turn, state.homes_in_map[i], state.homes_in_robot[i])
    if layout.true_home >= 0:
        fill_home(i, truths, row[layout.true_home :])
    if layout.true_patch >= 0:
        fill_map_patch(i, truths, row[layout.true_patch :])


@kernel()
def _find_ways(i: int, layout: Any, params: OccupancyParams, sources: Sources) -> None:
    """Draw robot i's readings on its occupancy grid, and search it for the observed ways."""
    state, sensor, occupancy = sources.state, sources.sensor, sources.occupancy
    motion, belief, ranges = state.motions[i], state.beliefs[i], state.ranges[i]
    if update_occupancy(occupancy, i, params, sensor, motion, belief, ranges):
        if layout.shortcut >= 0 or layout.path >= 0:
            find_shortcut(occupancy, i, sources.search, state.homes_in_map[i])
        if layout.path >= 0:
            way = state.ways_home[i]
            find_path(occupancy, i, sources.search, way[POINT], way[TRAVEL])
        if layout.onward >= 0:
            find_onward(occupancy, i, sources.search, sources.believed)


@kernel()
def _cover_truly(
    i: int,
    covered: CoverageGrid,
    sensor: CoverageSensor,
    state: BatchState,
    progress: ExplorationProgress,
) -> None:
    """Mark the ground that robot i truly sees within the coverage radius.

    Measured ranges would not do: past a wall that a beam missed (a drop-out) nothing is seen.
    """
    pose = state.poses[i]
    turn = math.cos(pose[2]), math.sin(pose[2])
    new = cover(covered, i, pose, turn, sensor, state.true_ranges[i])
    progress.new_ground[i] = new
    progress.ground[i] += new


@kernel()
def _enter_room(i: int, rooms: Rooms, state: BatchState, progress: ExplorationProgress) -> None:
    """Find the room that robot i is truly in, and mark it as entered."""
    first, last = rooms.worlds[i]
    room = find_room(state.poses[i, 0], state.poses[i, 1], rooms.outlines, first, last)
    room = room - first if room >= 0 else -1
    progress.room[i] = room
    progress.new_room[i] = room >= 0 and not rooms.entered[i, room]
    if progress.new_room[i]:
        rooms.entered[i, room] = True
        progress.rooms_entered[i] += 1
