"""The compiled survey: what robots newly cover and enter, and what they observe."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL
from albot_env.tasks.core.coverage_kernels import (
    Ground,
    Sight,
    cover,
    cut_patch,
    find_frontier,
    is_time_to_look,
)
from albot_env.tasks.core.observation_parts import (
    LogScale,
    find_home,
    find_nearest,
    observe_confidence,
    observe_exit,
    observe_home,
    observe_motion,
    observe_way,
    scale_ranges,
)
from albot_env.tasks.core.rooms import find_room
from albot_env.tasks.core.state import Senses
from albot_env.tasks.core.wayfinding_kernels import (
    Pencil,
    Search,
    Sketches,
    find_homewards,
    find_onwards,
    follow_sketch,
    pick_onward,
    pick_shortcut,
)


class Scales(NamedTuple):
    """The sizes that observations and coverage go by (see their configurations)."""

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
    """Where in an observation each part begins; -1 for those that are not shown."""

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
def survey(rows: np.ndarray, arguments: KernelArguments, observations: np.ndarray) -> None:
    """Survey the robots `rows`; each's observation goes into its row of `observations`.

    `arguments` holds `Sight`, the `Ground` truly covered, that believed to be, `Rooms`, `Scales`,
    `Layout`, `Senses`, `Findings`, `Pencil`, `Search` and `Sketches`.
    """
    contents = unpack(arguments)
    s, senses = contents[4], contents[6]
    nearest = np.empty(s.sectors)
    frontier = np.empty(s.sectors if s.sectors else senses.ranges.shape[1])
    _survey_all(rows, arguments, observations, nearest, frontier)


@kernel()
def _survey_all(
    rows: np.ndarray,
    arguments: KernelArguments,
    observations: np.ndarray,
    nearest: np.ndarray,
    frontier: np.ndarray,
) -> None:
    """`survey`, with room for the nearest ranges and the frontiers by sector (m)."""
    contents = unpack(arguments)
    sight, covered, believed, rooms, s, layout, senses, findings = contents[:8]
    pencil, search, sketches = contents[8:]
    for i in rows:
        pose, belief, ranges = senses.poses[i], senses.beliefs[i], senses.ranges[i]
        turn = math.cos(belief[2]), math.sin(belief[2])
        new = 0
        if is_time_to_look(senses.motions[i], s.spacing, s.turn, findings.moved[i]):
            cover(believed, i, belief, turn, sight, ranges)
            true_turn = math.cos(pose[2]), math.sin(pose[2])
            new = cover(covered, i, pose, true_turn, sight, ranges)
        findings.new_ground[i] = new
        findings.ground[i] += new
        first = rooms.worlds[i, 0]
        room = find_room(pose[0], pose[1], rooms.outlines, first, rooms.worlds[i, 1])
        room = room - first if room >= 0 else -1
        findings.room[i] = room
        findings.new_room[i] = room >= 0 and not rooms.entered[i, room]
        if findings.new_room[i]:
            rooms.entered[i, room] = True
            findings.rooms_entered[i] += 1
        find_home(belief, turn, senses.home_places[i], senses.homes[i])
        row = observations[i]
        if layout.laser >= 0:
            seen = ranges
            if s.sectors:
                find_nearest(ranges, nearest)
                seen = nearest
            scale_ranges(seen, s.laser, row[layout.laser :])
        if layout.sonar >= 0:
            scale_ranges(senses.echoes[i], s.sonar, row[layout.sonar :])
        _tell_motion(i, s, layout, senses, row)
        _tell_beliefs(i, s, layout, senses, row)
        if layout.coverage >= 0:
            patch = row[layout.coverage :]
            cut_patch(believed, i, belief, turn, s.patch_cell, s.patch_cells, patch)
        if layout.frontier >= 0:
            find_frontier(believed, i, belief, sight, ranges, frontier)
            scale_ranges(frontier, s.laser, row[layout.frontier :])
        if layout.shortcut >= 0 or layout.onward >= 0:
            _find_ways(i, sight, believed, layout, senses, pencil, search, sketches)
            _tell_ways(i, s, layout, senses, search, sketches, row)


@kernel()
def _find_ways(
    i: int,
    sight: Sight,
    believed: Ground,
    layout: Layout,
    senses: Senses,
    pencil: Pencil,
    search: Search,
    sketches: Sketches,
) -> None:
    """Let robot i sketch the ground and find those ways over it that are shown."""
    motion, belief, ranges = senses.motions[i], senses.beliefs[i], senses.ranges[i]
    if follow_sketch(sketches, i, pencil, sight, motion, belief, ranges):
        if layout.shortcut >= 0:
            find_homewards(sketches, i, search, senses.home_places[i])
        if layout.onward >= 0:
            find_onwards(sketches, i, search, believed)


@kernel()
def _tell_motion(i: int, s: Scales, layout: Layout, senses: Senses, row: np.ndarray) -> None:
    """Fill in the parts motion, heading and home of robot i, as far as they are shown."""
    home = senses.homes[i]
    if layout.motion >= 0:
        observe_motion(senses.motions[i], s.step_length, s.step_turn, row[layout.motion :])
    if layout.heading >= 0:
        row[layout.heading], row[layout.heading + 1] = math.cos(home[2]), -math.sin(home[2])
    if layout.home >= 0:
        observe_home(home, s.home, row[layout.home :])


@kernel()
def _tell_beliefs(i: int, s: Scales, layout: Layout, senses: Senses, row: np.ndarray) -> None:
    """Fill in what robot i makes of its map, as far as it is shown."""
    belief, way = senses.beliefs[i], senses.ways_home[i]
    if layout.confidence >= 0:
        row[layout.confidence] = observe_confidence(way[TRAVEL], s.home_drift, s.home_near)
    if layout.place >= 0:
        for flag in range(2):
            row[layout.place + flag] = 1.0 if senses.places[i, flag] else -1.0
    if layout.exit >= 0:
        observe_exit(belief, way[EXIT], s.home, row[layout.exit :])
    if layout.way >= 0:
        observe_way(belief, way[POINT], s.home, row[layout.way :])


@kernel(arrays=True)
def _tell_ways(
    i: int,
    s: Scales,
    layout: Layout,
    senses: Senses,
    search: Search,
    sketches: Sketches,
    row: np.ndarray,
) -> None:
    """Fill in the ways that robot i has found over its sketch, as far as they are shown."""
    belief = senses.beliefs[i]
    if layout.shortcut >= 0:
        point = pick_shortcut(sketches, i, search, senses.ways_home[i, TRAVEL])
        observe_way(belief, point, s.home, row[layout.shortcut :])
    if layout.onward >= 0:
        point = pick_onward(sketches, i)
        observe_way(belief, point, s.home, row[layout.onward :])
