"""The compiled loop that computes observations and tracks coverage and rooms entered."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL
from albot_env.tasks.core.coverage_kernels import (
    CoverageGrid,
    CoverageSensor,
    accumulate_motion,
    cover,
    cut_patch,
    find_frontier,
)
from albot_env.tasks.core.observation_parts import (
    LogScale,
    find_nearest,
    locate_home,
    observe_confidence,
    observe_exit,
    observe_home,
    observe_motion,
    observe_way,
    scale_ranges,
)
from albot_env.tasks.core.rooms import Rooms, find_room
from albot_env.tasks.core.state import BatchState, Progress
from albot_env.tasks.core.wayfinding_kernels import (
    OccupancyGrids,
    OccupancyParams,
    SearchParams,
    find_onward,
    find_shortcut,
    pick_onward,
    pick_shortcut,
    update_occupancy,
)


class Scales(NamedTuple):
    """Scales of observations and coverage (see their configurations)."""

    spacing: float
    turn: float
    patch_cell: float
    patch_cells: int
    laser: LogScale
    sonar: LogScale
    step_length: float
    step_turn: float
    home: LogScale
    home_drift: float
    home_near: float
    sectors: int


class Layout(NamedTuple):
    """Index at which each part begins in an observation; -1 for parts that are not observed."""

    laser: int
    sonar: int
    motion: int
    heading: int
    home: int
    confidence: int
    place: int
    exit: int
    way: int
    shortcut: int
    coverage: int
    frontier: int
    onward: int
    time_left: int


@KernelDispatcher
@kernel(arrays=True, nogil=True)
def observe_robots(rows: np.ndarray, arguments: KernelArguments, observations: np.ndarray) -> None:
    """Track the progress of robots `rows`, and fill in their rows of `observations`.

    `arguments` holds `CoverageSensor`, the `CoverageGrid` truly covered, the one believed covered,
    `Rooms`, `Scales`, `Layout`, `BatchState`, `Progress`, `OccupancyParams`, `SearchParams` and
    `OccupancyGrids`.
    """
    contents = unpack(arguments)
    scales, state = contents[4], contents[6]
    # Allocated here because the loop itself is faster if it makes no arrays (see `kernel`).
    nearest = np.empty(scales.sectors)
    frontier = np.empty(scales.sectors if scales.sectors else state.ranges.shape[1])
    _observe_robots(rows, arguments, observations, nearest, frontier)


@kernel()
def _observe_robots(
    rows: np.ndarray,
    arguments: KernelArguments,
    observations: np.ndarray,
    nearest: np.ndarray,
    frontier: np.ndarray,
) -> None:
    """Run `observe_robots` with buffers for ranges and frontiers by sector (m)."""
    contents = unpack(arguments)
    sensor, covered, believed, rooms, scales, layout, state, progress = contents[:8]
    params, search, occupancy = contents[8:]
    for i in rows:
        row, belief, ranges = observations[i], state.beliefs[i], state.ranges[i]
        turn = math.cos(belief[2]), math.sin(belief[2])
        moved = progress.moved[i]
        progress.new_ground[i] = 0
        if accumulate_motion(state.motions[i], scales.spacing, scales.turn, moved):
            cover(believed, i, belief, turn, sensor, ranges)
            _cover_truly(i, covered, sensor, state, progress)
        _enter_room(i, rooms, state, progress)
        locate_home(belief, turn, state.home_places[i], state.homes[i])
        _observe_sensors(i, scales, layout, state, nearest, row)
        _observe_beliefs(i, scales, layout, state, row)
        if layout.coverage >= 0:
            patch = row[layout.coverage :]
            cut_patch(believed, i, belief, turn, scales.patch_cell, scales.patch_cells, patch)
        if layout.frontier >= 0:
            find_frontier(believed, i, belief, sensor, ranges, frontier)
            scale_ranges(frontier, scales.laser, row[layout.frontier :])
        if layout.shortcut >= 0 or layout.onward >= 0:
            _find_ways(i, sensor, believed, layout, state, params, search, occupancy)
            _observe_ways(i, scales, layout, state, search, occupancy, row)


@kernel()
def _cover_truly(
    i: int, covered: CoverageGrid, sensor: CoverageSensor, state: BatchState, progress: Progress
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
def _enter_room(i: int, rooms: Rooms, state: BatchState, progress: Progress) -> None:
    """Find the room that robot i is truly in, and mark it as entered."""
    first, last = rooms.worlds[i]
    room = find_room(state.poses[i, 0], state.poses[i, 1], rooms.outlines, first, last)
    room = room - first if room >= 0 else -1
    progress.room[i] = room
    progress.new_room[i] = room >= 0 and not rooms.entered[i, room]
    if progress.new_room[i]:
        rooms.entered[i, room] = True
        progress.rooms_entered[i] += 1


@kernel()
def _observe_sensors(
    i: int,
    scales: Scales,
    layout: Layout,
    state: BatchState,
    nearest: np.ndarray,
    row: np.ndarray,
) -> None:
    """Fill in the observed ones of the parts laser, sonar and motion of robot i."""
    if layout.laser >= 0:
        seen = state.ranges[i]
        if scales.sectors:
            find_nearest(seen, nearest)
            seen = nearest
        scale_ranges(seen, scales.laser, row[layout.laser :])
    if layout.sonar >= 0:
        scale_ranges(state.echoes[i], scales.sonar, row[layout.sonar :])
    if layout.motion >= 0:
        length, turn = scales.step_length, scales.step_turn
        observe_motion(state.motions[i], length, turn, row[layout.motion :])


@kernel()
def _observe_beliefs(
    i: int, scales: Scales, layout: Layout, state: BatchState, row: np.ndarray
) -> None:
    """Fill in the observed parts that come from robot i's mapper."""
    home, belief, way = state.homes[i], state.beliefs[i], state.ways_home[i]
    if layout.heading >= 0:
        row[layout.heading], row[layout.heading + 1] = math.cos(home[2]), -math.sin(home[2])
    if layout.home >= 0:
        observe_home(home, scales.home, row[layout.home :])
    if layout.confidence >= 0:
        drift, near = scales.home_drift, scales.home_near
        row[layout.confidence] = observe_confidence(way[TRAVEL], drift, near)
    if layout.place >= 0:
        for flag in range(2):
            row[layout.place + flag] = 1.0 if state.places[i, flag] else -1.0
    if layout.exit >= 0:
        observe_exit(belief, way[EXIT], scales.home, row[layout.exit :])
    if layout.way >= 0:
        observe_way(belief, way[POINT], scales.home, row[layout.way :])


@kernel()
def _find_ways(
    i: int,
    sensor: CoverageSensor,
    believed: CoverageGrid,
    layout: Layout,
    state: BatchState,
    params: OccupancyParams,
    search: SearchParams,
    occupancy: OccupancyGrids,
) -> None:
    """Draw robot i's readings on its occupancy grid, and search it for the observed ways."""
    motion, belief, ranges = state.motions[i], state.beliefs[i], state.ranges[i]
    if update_occupancy(occupancy, i, params, sensor, motion, belief, ranges):
        if layout.shortcut >= 0:
            find_shortcut(occupancy, i, search, state.home_places[i])
        if layout.onward >= 0:
            find_onward(occupancy, i, search, believed)


@kernel(arrays=True)
def _observe_ways(
    i: int,
    scales: Scales,
    layout: Layout,
    state: BatchState,
    search: SearchParams,
    occupancy: OccupancyGrids,
    row: np.ndarray,
) -> None:
    """Fill in the observed ones of the parts shortcut and onward of robot i."""
    belief = state.beliefs[i]
    if layout.shortcut >= 0:
        point = pick_shortcut(occupancy, i, search, state.ways_home[i, TRAVEL])
        observe_way(belief, point, scales.home, row[layout.shortcut :])
    if layout.onward >= 0:
        point = pick_onward(occupancy, i)
        observe_way(belief, point, scales.home, row[layout.onward :])
