"""Every threshold of DP-SLAM.

The values are those of the program that its authors published (version 0.1.1, 2005), in metres: it
counts in squares, of which 35 are a metre. Its name for each is in brackets. Where a value is
another, the program's is told beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.mappers.slam.opacity import LaserModel
from albot_core.mappers.slam.way_home import WayHomeConfig
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

_PARTICLES = Range("a whole number from 2 to 1000", 2.0, 1000.0, whole=True)
_FROM_ONE = Range("a whole number from 1 to 1000", 1.0, 1000.0, whole=True)
_SHARE = Range("a number within (0, 1)", 0.0, math.nextafter(1.0, 0.0), beyond=True)
UNIFORMS = 6
"""The program's normal numbers are sums of so many uniform ones, and so never beyond…"""
MOST_DEVIATIONS = 0.5 * UNIFORMS / math.sqrt(UNIFORMS / 12)
"""…so many standard deviations: what a sample can be off is known before it is drawn."""


@dataclass(frozen=True, kw_only=True)
class MotionModel:
    """How a robot moves by what its odometer says (A. Eliazar and R. Parr, ICML 2004).

    The odometer says that the robot went so far (m) and turned so much (rad). It went along, and
    to the left of, the direction midway between its headings before and after, and turned, each
    normally distributed: the standard deviation is the sum of what the distance and the turn add,
    and at least some number.
    """

    along_per_distance: float = 0.156
    """Deviation of the distance along (varD_D)."""
    along_per_turn: float = 1.9924 / 35
    """The same (m/rad; varD_T)."""
    across_per_distance: float = 0.063
    """Deviation of the distance to the left (varC_D)."""
    across_per_turn: float = 2.2992 / 35
    """The same (m/rad; varC_T)."""
    turn_per_distance: float = 0.0008 * 35
    """Deviation of the turn (rad/m; varT_D)."""
    turn_per_turn: float = 0.1405
    """The same (varT_T)."""
    least: float = 0.8 / 35
    """Least deviation of both distances (m)."""
    least_turn: float = 0.1
    """Least deviation of the turn (rad)."""

    # The means are the odometer's own. The program's (0.9577 of the distance, 0.9437 of the turn,
    # and so on) are those of one robot in one state of repair, and are to be taken as nothing
    # that other robots do, it says.

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, *(name for name in vars(self)))

    def deviations(self, distance: float, turn: float) -> Float64[np.ndarray, "3"]:
        """Standard deviations along, across (m) and of the turn (rad)."""
        went, turned = abs(distance), abs(turn)
        return np.array(
            (
                max(self.along_per_distance * went + self.along_per_turn * turned, self.least),
                max(self.across_per_distance * went + self.across_per_turn * turned, self.least),
                max(self.turn_per_distance * went + self.turn_per_turn * turned, self.least_turn),
            )
        )

    def draw(
        self, moved: Pose, samples: int, rng: np.random.Generator
    ) -> Float64[np.ndarray, "samples 3"]:
        """Draw where the robot may have gone: along, to the left (m), and the turn (rad).

        Args:
            moved: What the odometer says.
            samples: How many are drawn.
            rng: Where random numbers come from.
        """
        x, y, turn = moved.tolist()
        cos, sin = math.cos(0.5 * turn), math.sin(0.5 * turn)
        means = np.array((cos * x + sin * y, cos * y - sin * x, turn))
        uniforms = rng.random((samples, 3, UNIFORMS))
        normals = (uniforms.sum(axis=-1) - 0.5 * UNIFORMS) / math.sqrt(UNIFORMS / 12)
        drawn: Float64[np.ndarray, "samples 3"]
        drawn = means + normals * self.deviations(math.hypot(x, y), turn)
        return drawn


@dataclass(frozen=True, kw_only=True)
class DpSlamConfig:
    """All thresholds of DP-SLAM."""

    particles: int = 50
    """Particles that are kept at most (PARTICLE_NUMBER)."""
    samples: int = 10
    """Samples that are drawn and weighed for each of them (SAMPLE_NUMBER)."""
    motion: MotionModel = field(default_factory=MotionModel)
    """How the robot moves."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """How the way home is found; ours."""
    longest_step: float = 10.0
    """No robot goes farther between two readings (m): a longer motion is not believed; ours."""
    step: float = 0.05
    """A scan is used once the robot has gone this far since the last (m)…"""
    turn: float = 0.03
    """…or has turned this far (rad)."""
    beams: int = 181
    """Beams of a scan that are used at most; of more, every second or third is."""
    cell: float = 0.05
    """Side of a grid square (m). The program's is 1 / 35 (MAP_SCALE); it says 1 / 20 to 1 / 35."""
    reach: float = 7.95
    """Ranges count no farther than this (m; MAX_SENSE_RANGE)."""
    variance: float = 0.002
    """Variance of a range, with all that makes it seem wrong (m²). The program's is 0.017
    (LOW_VARIANCE): with it the trajectory of Intel, on which this was chosen, is several times as
    wrong, since each step then adds more error than the map takes away."""
    prior: float = 8.0
    """Opacity of squares never seen: beams go so far in them (m; L_PRIOR)."""
    prior_squares: float = 4.0
    """The prior counts as much as beams through so many sides of a square (L_PRIOR_DIST)."""
    beyond: float = 20 / 35
    """A beam is followed so far beyond the measured range (m)."""
    before_end: float = 3.5 / 35
    """Where beams are judged by their ends alone, from so far before them (m)…"""
    after_end: float = 3.0 / 35
    """…to so far after (m)."""
    floor: float = 0.05
    """No beam is less likely than this (MAX_TRACE_ERROR; by the program's formula 0.32 with its
    variance, and next to nothing with ours)."""
    cull: float = 13.0
    """A sample is given up that is less likely than the best by e to the power of this (THRESH)."""
    passes: int = 9
    """Beams are looked at in so many passes, after each of which samples are given up (PASSES)."""

    def __post_init__(self) -> None:
        check_fields(self, _PARTICLES, "particles")
        check_fields(self, _FROM_ONE, "samples", "beams", "passes")
        check_fields(self, NOT_NEGATIVE, "step", "turn", "beyond", "before_end", "after_end")
        check_fields(self, POSITIVE, "cell", "reach", "variance", "prior", "prior_squares", "cull")
        check_fields(self, POSITIVE, "longest_step")
        check_fields(self, _SHARE, "floor")
        if not max(self.reach, self.beyond, self.before_end, self.after_end) / self.cell <= 4096:
            expected = f"at most 4096 squares of {self.cell:g} m"
            named = "DpSlamConfig.reach, beyond, before_end, after_end"
            raise InputError(named, expected, f"reach {self.reach:g}")

    @property
    def sample_count(self) -> int:
        """Samples that are drawn and weighed at each update."""
        return self.particles * self.samples

    @property
    def laser_model(self) -> LaserModel:
        """The numbers of the laser's model."""
        return LaserModel(
            cell=self.cell,
            variance=self.variance,
            prior=self.prior,
            prior_distance=self.prior_squares * self.cell,
            beyond=self.beyond,
            reach=self.reach,
            before_end=self.before_end,
            after_end=self.after_end,
            floor=self.floor,
            cull=self.cull,
            passes=self.passes,
        )
