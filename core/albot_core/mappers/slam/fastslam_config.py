"""Parameters of FastSLAM with landmarks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from albot_core.mappers.slam.line_ends import LineEndConfig
from albot_core.mappers.slam.particle_slam import ParticleSlamConfig
from albot_core.ranges import POSITIVE, Range, check_fields

_LANDMARKS = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)


@dataclass(frozen=True, kw_only=True)
class FastSlamConfig(ParticleSlamConfig):
    """Parameters of FastSLAM with landmarks.

    The papers give the filter's equations; their values are those of another robot and of trees.
    These are ours, tuned on the Intel log (docs/slam.md).
    """

    motion: Literal["matched", "odometer"] = "matched"
    """What moves the particles: `matched`, the match of each scan with the latest ones, as in
    Hähnel et al. (2003), which the thesis describes (section 2.2.1); or `odometer`, as in
    Montemerlo et al., with deviations that must then be those of the odometer."""
    proposal: Literal["landmarks", "motion"] = "landmarks"
    """What poses are drawn by: `landmarks`, the motion and the landmarks that are seen (FastSLAM
    2.0), or `motion` alone (FastSLAM 1.0)."""
    line_ends: LineEndConfig = field(default_factory=LineEndConfig)
    """Which ends of walls are landmarks, and how precisely they are seen."""
    particles: int = 100
    """Number of particles, as in Hähnel et al. (2003); 100,000 at most."""
    landmarks: int = 2000
    """Largest number of landmarks of a particle, 100,000 at most. Once a particle has as many, it
    matches known ones but adds none (`FastSlam.refused`)."""
    step: float = 0.5
    """Distance since the last update after which a scan is used (m)."""
    turn: float = 0.5
    """Turn since the last update after which a scan is used (rad)."""
    drift: float = 0.01
    """Standard deviation of the matched position per distance (m/m)."""
    drift_by_turn: float = 0.01
    """Standard deviation of the matched position per turn (m/rad)."""
    twist: float = 0.005
    """Standard deviation of the matched heading per turn (rad/rad)."""
    twist_by_way: float = 0.002
    """Standard deviation of the matched heading per distance (rad/m)."""
    gate: float = 9.21
    """Largest squared Mahalanobis distance of a landmark that is matched: the chi-square test of
    two numbers at 99 %."""
    new_landmark: float = 0.01
    """Likelihood of a new landmark (1/m²): p₀ of the paper. A known one is matched if likelier."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, _LANDMARKS, "landmarks")
        check_fields(self, POSITIVE, "gate", "new_landmark")
