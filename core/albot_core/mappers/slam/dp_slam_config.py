"""The parameters of DP-SLAM.

The defaults are those of the authors' published program (version 0.1.1, 2005), converted to metres:
the program counts in squares, 35 to a metre. The program's name of each is in brackets. Where a
default differs, the program's value is stated.
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
"""Number of uniform numbers whose sum makes a normal one, as in the program."""
MOST_DEVIATIONS = 0.5 * UNIFORMS / math.sqrt(UNIFORMS / 12)
"""Largest deviation of such a normal number from its mean (standard deviations). It bounds every
sample before it is drawn."""


@dataclass(frozen=True, kw_only=True)
class MotionModel:
    """Motion model given the odometry (A. Eliazar and R. Parr, ICML 2004).

    The odometer measures a distance (m) and a turn (rad). The robot's true motion along the mean of
    its headings before and after, its motion to the left of that, and its turn are normally
    distributed. Each standard deviation is the sum of a share of the distance and a share of the
    turn, but not below a minimum.
    """

    along_per_distance: float = 0.156
    """Standard deviation of the forward motion per distance (m/m; varD_D)."""
    along_per_turn: float = 1.9924 / 35
    """Standard deviation of the forward motion per turn (m/rad; varD_T)."""
    across_per_distance: float = 0.063
    """Standard deviation of the motion to the left per distance (m/m; varC_D)."""
    across_per_turn: float = 2.2992 / 35
    """Standard deviation of the motion to the left per turn (m/rad; varC_T)."""
    turn_per_distance: float = 0.0008 * 35
    """Standard deviation of the turn per distance (rad/m; varT_D)."""
    turn_per_turn: float = 0.1405
    """Standard deviation of the turn per turn (rad/rad; varT_T)."""
    least: float = 0.8 / 35
    """Smallest standard deviation of the forward and the left motion (m)."""
    least_turn: float = 0.1
    """Smallest standard deviation of the turn (rad)."""

    # The means are the odometer's own values. The program's means (0.9577 of the distance, 0.9437
    # of the turn, and so on) were fitted to one robot at one time; the program itself says that
    # they do not apply to other robots.

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, *(name for name in vars(self)))

    def deviations(self, distance: float, turn: float) -> Float64[np.ndarray, "3"]:
        """Return the standard deviations of forward and left motion (m) and turn (rad)."""
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
        """Sample motions: forward, to the left (m), and turn (rad).

        Args:
            moved: The odometer's motion.
            samples: Number of samples.
            rng: The random generator.
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
    """All parameters of DP-SLAM."""

    particles: int = 50
    """Largest number of particles (PARTICLE_NUMBER), from 2 to 1000."""
    samples: int = 10
    """Number of samples per particle (SAMPLE_NUMBER), 1000 at most."""
    motion: MotionModel = field(default_factory=MotionModel)
    """The motion model."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """Parameters of the search for the way home; not in the program."""
    step: float = 0.05
    """Distance since the last used scan after which a scan is used (m)."""
    turn: float = 0.03
    """Turn since the last used scan after which a scan is used (rad)."""
    beams: int = 181
    """Largest number of beams used per scan; of a scan with more, every n-th beam is used. 1000 at
    most."""
    cell: float = 0.05
    """Side of a grid square (m). The program: 1 / 35 (MAP_SCALE); it advises 1 / 20 to 1 / 35."""
    reach: float = 7.95
    """Largest range that is used (m; MAX_SENSE_RANGE)."""
    variance: float = 0.002
    """Variance of a range, including all model errors (m²). The program's is 0.017 (LOW_VARIANCE);
    it makes the trajectory on Intel, on which this was tuned, several times less accurate, since
    each step then adds more error than the map removes."""
    prior: float = 8.0
    """Opacity of unobserved squares: mean distance of a beam in them (m; L_PRIOR)."""
    prior_squares: float = 4.0
    """Weight of the prior: beams through this many sides of a square (L_PRIOR_DIST)."""
    beyond: float = 20 / 35
    """Distance by which a beam is followed beyond the measured range (m)."""
    before_end: float = 3.5 / 35
    """Start of the section that is weighed first, before the beam's end (m)."""
    after_end: float = 3.0 / 35
    """End of the section that is weighed first, after the beam's end (m)."""
    floor: float = 0.05
    """Smallest likelihood of a beam (MAX_TRACE_ERROR; the program's formula gives 0.32 with its
    variance, and almost 0 with this one)."""
    cull: float = 13.0
    """A sample is dropped if its log-likelihood is this far below the best one's (THRESH)."""
    passes: int = 9
    """Number of passes over the beams; samples are dropped after each (PASSES). 1000 at most."""

    def __post_init__(self) -> None:
        check_fields(self, _PARTICLES, "particles")
        check_fields(self, _FROM_ONE, "samples", "beams", "passes")
        check_fields(self, NOT_NEGATIVE, "step", "turn", "beyond", "before_end", "after_end")
        check_fields(self, POSITIVE, "cell", "reach", "variance", "prior", "prior_squares", "cull")
        check_fields(self, _SHARE, "floor")
        if not max(self.reach, self.beyond, self.before_end, self.after_end) / self.cell <= 4096:
            expected = f"at most 4096 squares of {self.cell:g} m"
            named = "DpSlamConfig.reach, beyond, before_end, after_end"
            raise InputError(named, expected, f"reach {self.reach:g}")

    @property
    def sample_count(self) -> int:
        """Number of samples drawn and weighed at each update."""
        return self.particles * self.samples

    @property
    def laser_model(self) -> LaserModel:
        """The parameters of the laser model."""
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
