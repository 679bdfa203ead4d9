"""Speed of the laser: the compiled kernel beside a Python loop over pymunk's ray query."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pymunk

from albot_core.geometry.types import Poses, Segments
from albot_core.robot import PIONEER_3DX
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.laser import RayCaster
from albot_env.sim.physics import PhysicsSpace

_SEGMENTS = (60, 200, 1000)
_POSES = 4096
_BLOCK = 5.0
_DOOR = 1.0


def measure_laser(seconds_per_case: float = 1.0) -> list[dict[str, int | float]]:
    """Time 181-beam scans in floor plans of about 60, 200 and 1000 segments.

    Args:
        seconds_per_case: Time per ray-casting method and plan (s).

    Returns:
        One row per plan: `segments`; `us_per_scan` in a batch, `us_per_scan_single` with one
        scan per call, and `us_per_scan_pymunk` with pymunk's query in a Python loop (µs, the
        best of many runs); `ratio_to_pymunk`, `ratio_single_to_pymunk`; and `index_seconds`,
        the time to list which walls are visible from where (s).
    """
    return [_measure(segments, seconds_per_case) for segments in _SEGMENTS]


def floor_plan(segments: int, rng: np.random.Generator) -> Segments:
    """Return a plan of about `segments` walls: rows of rooms along corridors, one door each.

    Rooms are blocks of 5 m on a square floor, and every third row is a corridor. The remaining
    walls are furniture: short segments at random positions.
    """
    rooms = max(2, round(math.sqrt(segments / 4)))
    walls = []
    for row in range(rooms + 1):
        for column in range(rooms):
            x, y = column * _BLOCK, row * _BLOCK
            door = rng.uniform(0.5, _BLOCK - _DOOR - 0.5)
            if row in (0, rooms) or row % 3 == 0:
                walls.append((x, y, x + _BLOCK, y))
            else:
                walls.append((x, y, x + door, y))
                walls.append((x + door + _DOOR, y, x + _BLOCK, y))
    for row in range(rooms):
        for column in range(rooms + 1):
            if column in (0, rooms) or row % 3 != 1:
                x, y = column * _BLOCK, row * _BLOCK
                walls.append((x, y, x, y + _BLOCK))
    side = rooms * _BLOCK
    while len(walls) < segments:
        x, y = rng.uniform(0.5, side - 0.5, 2)
        angle, length = rng.uniform(0, 2 * math.pi), rng.uniform(0.3, 1.0)
        walls.append((x, y, x + length * math.cos(angle), y + length * math.sin(angle)))
    return np.array(walls)


def _measure(segments: int, seconds: float) -> dict[str, int | float]:
    rng = np.random.default_rng(segments)
    walls = floor_plan(segments, rng)
    geometry = LaserGeometry()
    side = walls.max()
    poses = np.column_stack((rng.uniform(0, side, (_POSES, 2)), rng.uniform(-4, 4, _POSES)))
    RayCaster(walls[:4], geometry).scan_batch(poses[:1])  # compiled, or read from the cache
    started = time.perf_counter()
    rays = RayCaster(walls, geometry)
    rays.scan_batch(poses)  # Now the visible walls are listed for all poses.
    index = time.perf_counter() - started
    floor = PhysicsSpace(walls, PIONEER_3DX)

    batch = _best(lambda: rays.scan_batch(poses), seconds) / _POSES
    single = _best(lambda: [rays.scan(pose) for pose in poses[:200]], seconds) / 200
    loop = _best(lambda: _pymunk_scans(floor, geometry, poses[:4]), seconds) / 4
    return {
        "segments": len(walls),
        "us_per_scan": 1e6 * batch,
        "us_per_scan_single": 1e6 * single,
        "us_per_scan_pymunk": 1e6 * loop,
        "ratio_to_pymunk": loop / batch,
        "ratio_single_to_pymunk": loop / single,
        "index_seconds": index,
    }


def _pymunk_scans(floor: PhysicsSpace, geometry: LaserGeometry, poses: Poses) -> None:
    """Take scans with one query per beam, in Python."""
    everything = pymunk.ShapeFilter()
    bearings = geometry.bearings.tolist()
    for x, y, heading in poses.tolist():
        for bearing in bearings:
            angle = heading + bearing
            end = x + 30.0 * math.cos(angle), y + 30.0 * math.sin(angle)
            floor.space.segment_query_first((x, y), end, 0.0, everything)


def _best(run: Callable[[], object], seconds: float) -> float:
    """Return the shortest time (s) of `run`, repeated for `seconds` seconds."""
    end = time.perf_counter() + seconds
    best = math.inf
    while time.perf_counter() < end or best == math.inf:
        started = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - started)
    return best
