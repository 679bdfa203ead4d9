"""Exact ranges along laser beams to the walls that the physics collides with."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.directions import turned
from albot_core.geometry.types import Pose, Ranges, Segments
from albot_core.kernels.simd import LANES32
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.ray_kernels import Fan, scan_poses
from albot_env.sim.wall_index import Locator, WallIndex


def make_fan(geometry: LaserGeometry) -> Fan:
    """A laser's beams as the compiled ray caster takes them."""
    middle = float(geometry.bearings[0] + geometry.bearings[-1]) / 2
    x, y, axis = geometry.mount
    heading = axis + middle
    angles = geometry.bearings - middle
    directions = np.stack((np.cos(angles), np.sin(angles)))
    padded = np.zeros((3, math.ceil(geometry.beams / LANES32) * LANES32), np.float32)
    padded[:2, : geometry.beams] = directions
    turns = [turned(u, v) for u, v in directions.T.tolist()]
    padded[2] = turns + turns[-1:] * (padded.shape[1] - geometry.beams)
    # A fan of at most a half turn sees nothing behind the laser (a micrometre for rounding).
    half_turn = directions[0].min() > -1e-9
    return Fan(
        beams=geometry.beams,
        directions=directions,
        padded=padded,
        reach=float(geometry.max_range),
        mount=(float(x), float(y), math.cos(heading), math.sin(heading)),
        behind=-1e-6 if half_turn else -np.inf,
    )


def index_for(geometry: LaserGeometry, *, indexed: bool = True) -> WallIndex:
    """An index of what such a laser can see from where."""
    return WallIndex(geometry.max_range, geometry.mount[:2], grid=indexed)


class RayCaster:
    """Casts a laser's beams against a building's static walls.

    Ranges agree with pymunk's `segment_query_first` within a millimetre. As there, a
    wall whose line runs exactly through the laser is seen edge-on: not at all.

    Args:
        walls: The walls.
        geometry: The laser's beams, reach and place on the robot.
        indexed: Whether to list which walls can be seen from where, as robots come there.
    """

    def __init__(self, walls: Segments, geometry: LaserGeometry, *, indexed: bool = True) -> None:
        self.geometry = geometry
        self._fan = make_fan(geometry)
        self._index = index_for(geometry, indexed=indexed)
        self._index.add(walls)
        self._locator = Locator(self._index, WallIndex(0.0, (0.0, 0.0)))

    def scan(self, pose: Pose) -> Ranges:
        """The true ranges (m) of a robot at `pose`; infinite where no wall is in reach."""
        ranges: Ranges = self.scan_batch(pose.reshape(1, 3))[0]
        return ranges

    def scan_batch(self, poses: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n beams"]:
        """The true ranges (m) of robots at `poses`; infinite where no wall is in reach."""
        count = len(poses)
        poses = np.ascontiguousarray(poses, np.float64)  # Entries take nothing else.
        cells = np.empty(count, np.int64)
        buildings = np.zeros(count, np.int64)
        self._locator.locate(np.arange(count), buildings, poses, cells, cells)
        ranges = np.empty((count, self.geometry.beams))
        scan_poses(self._fan, self._index.tables, cells, poses, ranges)
        return ranges
