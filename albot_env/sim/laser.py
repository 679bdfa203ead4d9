"""The laser: a scanner like the SICK LMS-200, with range noise and drop-outs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.pose_kernels import pseudo_angle
from albot_core.geometry.types import Pose, Ranges, Segments
from albot_core.kernels.simd import LANES32
from albot_core.ranges import NOT_NEGATIVE, SHARE, check_fields
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.ray_casting import BeamGeometry, scan_poses
from albot_env.sim.wall_index import Locator, WallIndex


@dataclass(frozen=True, kw_only=True)
class LaserConfig:
    """The laser's beams and errors.

    The 1 cm of noise stands for all range errors of an LMS-200; the drop-out rate is our choice.
    """

    geometry: LaserGeometry = field(default_factory=LaserGeometry)
    """Beam directions, maximum range and position of the laser."""
    range_noise: float = 0.01
    """Standard deviation of the range error (m)."""
    dropout: float = 0.001
    """Probability that a beam that meets a wall returns nothing."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "range_noise")
        check_fields(self, SHARE, "dropout")
        if self.geometry.beam_width != 0:
            found = str(self.geometry.beam_width)
            raise InputError("LaserConfig.geometry", "beam_width 0: its beams are rays", found)

    @property
    def dropout_threshold(self) -> int:
        """Drop-out probability times 2^32, as the compiled laser takes it."""
        return round(self.dropout * 2**32)


LMS_200 = LaserConfig()
"""The laser of the papers."""

_FINE = LaserGeometry(beams=361, spacing=np.pi / 360)
_ALL_ROUND = LaserGeometry(beams=360, first_bearing=-np.pi)

LASERS: Mapping[str, LaserConfig] = MappingProxyType(
    {
        "ideal": LaserConfig(range_noise=0.0, dropout=0.0),
        "lms-200": LMS_200,
        "lms-200-fine": LaserConfig(geometry=_FINE),
        "panoramic": LaserConfig(geometry=_ALL_ROUND),
        "long": LaserConfig(geometry=LaserGeometry(max_range=80.0)),
        "short": LaserConfig(geometry=LaserGeometry(max_range=8.0), range_noise=0.005),
    }
)
"""Lasers by name. All but one have a field of view of 180° ahead.

`ideal`: 181 beams, 30 m, no error.

`lms-200`: 181 beams at 1°, 30 m; `lms-200-fine`: 361 at 0.5°.

`panoramic`: 360 beams at 1° all round, for Sahabot 2's panoramic camera.

`long`: 80 m, the maximum range of a SICK LMS-200 (Hossain's thesis, section 3.2). The 30 m
of the others is the range at which it still sees dark walls.

`short`: 8 m and half the noise, as in its millimetre mode.
"""


def beam_geometry(geometry: LaserGeometry) -> BeamGeometry:
    """Return a laser's beams in the form that the compiled ray caster takes."""
    middle = float(geometry.bearings[0] + geometry.bearings[-1]) / 2
    x, y, axis = geometry.mount
    heading = axis + middle
    angles = geometry.bearings - middle
    directions = np.stack((np.cos(angles), np.sin(angles)))
    padded = np.zeros((3, math.ceil(geometry.beams / LANES32) * LANES32), np.float32)
    padded[:2, : geometry.beams] = directions
    turns = [pseudo_angle(u, v) for u, v in directions.T.tolist()]
    padded[2] = turns + turns[-1:] * (padded.shape[1] - geometry.beams)
    # A laser with a field of view of at most 180° sees nothing behind it (1 µm for rounding).
    half_turn = directions[0].min() > -1e-9
    return BeamGeometry(
        number=geometry.beams,
        directions=directions,
        padded=padded,
        max_range=float(geometry.max_range),
        mount=(float(x), float(y), math.cos(heading), math.sin(heading)),
        behind=-1e-6 if half_turn else -np.inf,
    )


def laser_wall_index(geometry: LaserGeometry, *, indexed: bool = True) -> WallIndex:
    """Return an index of the walls that such a laser can see."""
    return WallIndex(geometry.max_range, geometry.mount[:2], grid=indexed)


class RayCaster:
    """Casts a laser's beams against a building's static walls.

    Ranges agree with pymunk's `segment_query_first` within a millimetre. As in pymunk, a wall whose
    line runs exactly through the laser is edge-on and not seen.

    Args:
        walls: The walls.
        geometry: The laser's beams, maximum range and position on the robot.
        indexed: Whether to index, lazily, which walls can be seen from each cell.
    """

    def __init__(self, walls: Segments, geometry: LaserGeometry, *, indexed: bool = True) -> None:
        self.geometry = geometry
        self._beams = beam_geometry(geometry)
        self._index = laser_wall_index(geometry, indexed=indexed)
        self._index.add(walls)
        self._locator = Locator(self._index, WallIndex(0.0, (0.0, 0.0)))

    def scan(self, pose: Pose) -> Ranges:
        """Return the true ranges (m) of a robot at `pose`; infinite if no wall is in range."""
        ranges: Ranges = self.scan_batch(pose.reshape(1, 3))[0]
        return ranges

    def scan_batch(self, poses: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n beams"]:
        """Return the true ranges (m) of robots at `poses`; infinite if no wall is in range."""
        count = len(poses)
        poses = np.ascontiguousarray(poses, np.float64)  # The kernel takes no other layout.
        cells = np.empty(count, np.int64)
        buildings = np.zeros(count, np.int64)
        self._locator.locate(np.arange(count), buildings, poses, cells, cells)
        ranges = np.empty((count, self.geometry.beams))
        scan_poses(self._beams, self._index.tables, cells, poses, ranges)
        return ranges
