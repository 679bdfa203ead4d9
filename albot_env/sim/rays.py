"""Exact ranges along laser beams to the walls that the physics collides with."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose, Ranges, Segments
from albot_core.perception.reading import LaserGeometry
from albot_env.sim.ray_kernels import scan_all


class RayCaster:
    """Casts a laser's beams against static walls."""

    def __init__(self, walls: Segments, geometry: LaserGeometry) -> None:
        self.geometry = geometry
        self._walls = np.ascontiguousarray(walls)
        self._mount = np.array(geometry.mount, dtype=float)
        self._cos = np.cos(geometry.bearings)
        self._sin = np.sin(geometry.bearings)

    def scan(self, pose: Pose) -> Ranges:
        """The true ranges (m) of a robot at `pose`; infinite where no wall is in reach."""
        ranges: Ranges = self.scan_batch(pose[np.newaxis])[0]
        return ranges

    def scan_batch(self, poses: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n beams"]:
        """The true ranges (m) of robots at `poses`; infinite where no wall is in reach."""
        ranges = np.empty((len(poses), self.geometry.beams))
        reach = self.geometry.max_range
        scan_all(self._walls, self._cos, self._sin, reach, self._mount, poses, ranges)
        return ranges
