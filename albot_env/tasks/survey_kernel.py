"""The compiled survey: what robots newly cover and enter, and what they observe."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from albot_env.tasks.kernels import cut_patch, find_room, observe_motions, scale_ranges, sweep


class Ground(NamedTuple):
    """The grids of ground of all robots in one world."""

    grids: np.ndarray
    """(robots, side, words) uint64: a bit for each cell, set where covered."""
    centre: tuple[float, float]
    """The middle of the grids x, y (m)."""


class Rooms(NamedTuple):
    """The rooms of one world."""

    corners: np.ndarray
    """(corners, 2) float64: of all outlines one after another (m)."""
    ends: np.ndarray
    """(rooms,) int64: where each room's corners end."""
    entered: np.ndarray
    """(robots, rooms) bool: which rooms each robot has been in."""


class Scales(NamedTuple):
    """The sizes that observations and coverage go by (see their configurations)."""

    cell: float
    radius: float
    patch_cell: float
    patch_cells: int
    laser_knee: float
    laser_range: float
    step_length: float
    step_turn: float
    home_knee: float
    home_range: float
    mount_x: float
    mount_y: float
    spacing: float


class Senses(NamedTuple):
    """What all robots know; a row each."""

    poses: np.ndarray
    """(n, 3) float64: where they truly are (world frame)."""
    beliefs: np.ndarray
    """(n, 3) float64: where they believe to be (map frame)."""
    homes: np.ndarray
    """(n, 3) float64: where they believe home to be (robot frame)."""
    motions: np.ndarray
    """(n, 3) float64: what the odometers measured."""
    ranges: np.ndarray
    """(n, beams) float64: what the lasers saw (m)."""


class Findings(NamedTuple):
    """What is found out about all robots; a row each."""

    ground: np.ndarray
    """(n,) int64: cells of ground truly covered since the start."""
    new_ground: np.ndarray
    """(n,) int64: those newly covered."""
    room: np.ndarray
    """(n,) int64: the room that each is in; -1 between rooms."""
    new_room: np.ndarray
    """(n,) bool: whether it is entered for the first time."""
    observations: np.ndarray
    """(n, length) float32: the observations in one row each."""


@njit(cache=True, error_model="numpy")
def survey(
    rows: np.ndarray,
    slots: np.ndarray,
    directions: np.ndarray,
    covered: Ground,
    believed: Ground,
    rooms: Rooms,
    scales: Scales,
    senses: Senses,
    findings: Findings,
) -> None:
    """Survey the robots `rows`, all in one world, whose ground is in the grids `slots`."""
    s = scales
    beams = senses.ranges.shape[1]
    mount = s.mount_x, s.mount_y
    steps = s.step_length, s.step_turn, s.home_knee, s.home_range
    for k in range(rows.shape[0]):
        i, slot = rows[k], slots[k]
        pose, belief, ranges = senses.poses[i], senses.beliefs[i], senses.ranges[i]
        grid = believed.grids[slot]
        sweep(grid, s.cell, believed.centre, belief, mount, ranges, directions, s.spacing, s.radius)
        new = sweep(
            covered.grids[slot], s.cell, covered.centre, pose, mount, ranges, directions,
            s.spacing, s.radius,
        )  # fmt: skip
        findings.new_ground[i] = new
        findings.ground[i] += new
        room = find_room(pose[0], pose[1], rooms.corners, rooms.ends)
        findings.room[i] = room
        findings.new_room[i] = room >= 0 and not rooms.entered[slot, room]
        if room >= 0:
            rooms.entered[slot, room] = True
        row = findings.observations[i]
        scale_ranges(ranges, s.laser_knee, s.laser_range, row)
        observe_motions(senses.motions[i], belief[2], senses.homes[i], steps, row[beams:])
        cut_patch(
            grid, s.cell, believed.centre, belief, s.patch_cell, s.patch_cells, row[beams + 8 :]
        )
