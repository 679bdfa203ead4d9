"""The tables of all movable things of a fleet, a record for each.

Compiled code passes one table of records more cheaply than a dozen arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

DOOR = np.dtype(
    [
        ("row", np.int64),  # in which place pymunk reads out the body
        ("body", np.int64),  # its address
        ("hinge_x", np.float64),  # where it hangs (m)
        ("hinge_y", np.float64),
        ("heading", np.float64),  # of the shut leaf (rad)
        ("width", np.float64),  # of the leaf (m)
        ("opening", np.float64),  # from shut to open (rad)
        ("turn_rate", np.float64),  # when it swings (rad/s)
        ("least_shut", np.float64),  # how long it stays shut (s)
        ("most_shut", np.float64),
        ("least_open", np.float64),  # how long it stays open (s)
        ("most_open", np.float64),
        ("angle", np.float64),  # where the leaf is (rad)
        ("rate", np.float64),  # how fast it turns now (rad/s)
        ("wanted", np.int64),  # 1 where it is to be open, 0 where shut
        ("wait", np.float64),  # how much longer it stays, once there (s)
        ("key", np.uint64),  # to its random numbers
        ("draws", np.int64),  # how many of them it has used
    ]
)
BOX = np.dtype(
    [
        ("row", np.int64),  # in which place pymunk reads out the body
        ("half_length", np.float64),  # (m)
        ("half_width", np.float64),
        ("x", np.float64),  # where it is (m)
        ("y", np.float64),
        ("heading", np.float64),  # of its length (rad)
    ]
)
WALKER = np.dtype(
    [
        ("row", np.int64),  # in which place pymunk reads out the body
        ("radius", np.float64),  # (m)
        ("slowest", np.float64),  # speeds when nothing is in the way (m/s)
        ("fastest", np.float64),
        ("first", np.int64),  # which of its robot's waypoints is its first
        ("count", np.int64),  # how many it has
        ("closed", np.int64),  # 1 where the last is joined to the first, else 0
        ("speed", np.float64),  # in this episode when nothing is in the way (m/s)
        ("last", np.int64),  # the waypoint left last, and the next
        ("next", np.int64),
        ("sense", np.int64),  # 1 or -1: the way round
        ("idle", np.float64),  # for how long it has got nowhere (s)
        ("x", np.float64),  # where it is (m)
        ("y", np.float64),
        ("vx", np.float64),  # its velocity (m/s)
        ("vy", np.float64),
        ("wanted_x", np.float64),  # the velocity that it tries to reach (m/s)
        ("wanted_y", np.float64),
    ]
)
BLOCKS = ("doors", "boxes", "walkers", "waypoints", "walls", "segments")
"""The tables in which each robot has rows of its own."""
ROBOT = np.dtype(
    [(name, np.int64) for block in BLOCKS for name in (block, f"{block}_end")]  # its rows
    + [
        ("space", np.int64),  # addresses of its space, and of that with the walkers' legs
        ("shelf", np.int64),
    ]
)


class Stage(NamedTuple):
    """All that moves, and what it moves among."""

    robots: np.ndarray
    """(robots,) of ROBOT: which rows of the others are whose."""
    doors: np.ndarray
    """(n,) of DOOR."""
    boxes: np.ndarray
    """(n,) of BOX."""
    walkers: np.ndarray
    """(n,) of WALKER."""
    waypoints: np.ndarray
    """(n, 2) float64: the routes' (m)."""
    walls: np.ndarray
    """(n, 4) float64: the walls around those whom walkers meet."""
    segments: np.ndarray
    """(n, 4) float64: the outlines of all things, which is what rays meet."""
