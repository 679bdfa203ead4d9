"""The arrays of all movable things of a fleet; each robot meets those of its own rows.

Rows of one robot stand together: those of robot i are at[i]:at[i + 1].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Doors(NamedTuple):
    """A row for each door."""

    at: np.ndarray
    """(robots + 1,) int64: where each robot's rows begin."""
    rows: np.ndarray
    """(n,) int64: in which place pymunk reads out the body."""
    hinges: np.ndarray
    """(n, 2) float64: x, y (m)."""
    leaves: np.ndarray
    """(n, 4) float64: heading when shut (rad), width (m), opening (rad), turn rate (rad/s)."""
    stays: np.ndarray
    """(n, 2, 2) float64: least and most time (s) that it stays shut, and open."""
    angles: np.ndarray
    """(n,) float64: where the leaf is (rad)."""
    rates: np.ndarray
    """(n,) float64: how fast it turns (rad/s)."""
    wanted: np.ndarray
    """(n,) int64: 1 where it is to be open, 0 where shut."""
    waits: np.ndarray
    """(n,) float64: how much longer it stays, once there (s)."""
    keys: np.ndarray
    """(n,) uint64: keys to their random numbers."""
    draws: np.ndarray
    """(n,) int64: how many of them have been drawn."""


class Boxes(NamedTuple):
    """A row for each box."""

    at: np.ndarray
    """(robots + 1,) int64: where each robot's rows begin."""
    rows: np.ndarray
    """(n,) int64: in which place pymunk reads out the body."""
    halves: np.ndarray
    """(n, 2) float64: half the length and half the width (m)."""
    beginnings: np.ndarray
    """(n, 3) float64: x, y, heading when an episode begins."""
    poses: np.ndarray
    """(n, 3) float64: x, y, heading now."""


class Walkers(NamedTuple):
    """A row for each walker."""

    at: np.ndarray
    """(robots + 1,) int64: where each robot's rows begin."""
    rows: np.ndarray
    """(n,) int64: in which place pymunk reads out the body."""
    radii: np.ndarray
    """(n,) float64 (m)."""
    paces: np.ndarray
    """(n, 2) float64: least and greatest speed when nothing is in the way (m/s)."""
    route_at: np.ndarray
    """(n + 1,) int64: where each one's waypoints begin."""
    waypoints: np.ndarray
    """(waypoints, 2) float64 (m)."""
    closed: np.ndarray
    """(n,) bool: whether the last waypoint is joined to the first."""
    speeds: np.ndarray
    """(n,) float64: speed in this episode when nothing is in the way (m/s)."""
    courses: np.ndarray
    """(n, 3) int64: the waypoint left last, the next, and 1 or -1 for the way round."""
    idle: np.ndarray
    """(n,) float64: for how long they have got nowhere (s)."""
    states: np.ndarray
    """(n, 4) float64: x, y, velocity x, y (m, m/s)."""
    wanted: np.ndarray
    """(n, 2) float64: the velocity that they try to reach (m/s)."""


class Stage(NamedTuple):
    """All that moves, and what it moves among."""

    doors: Doors
    boxes: Boxes
    walkers: Walkers
    walls: np.ndarray
    """(n, 4) float64: the walls of all worlds."""
    walls_at: np.ndarray
    """(robots, 2) int64: which of them are each robot's."""
    spaces: np.ndarray
    """(robots, 2) int64: addresses of the space, and of the one with the walkers' legs."""
    segments: np.ndarray
    """(n, 4) float64: the outlines of all things, which is what rays meet."""
    segments_at: np.ndarray
    """(robots + 1,) int64: where each robot's begin."""
