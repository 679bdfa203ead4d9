"""Parameters of localisation in a saved map."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from albot_core.mappers.slam.local_map import MatchingConfig
from albot_core.matching.likelihood_field import FieldConfig
from albot_core.ranges import FROM_ONE, FROM_TWO, NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

_OPEN_SHARE = Range("a number within (0, 1)", 0.0, 1.0, beyond=True)


def _following() -> MatchingConfig:
    """Return the matching of scans with the latest ones; wide windows are seldom needed."""
    return MatchingConfig(sure=0.4)


def _tracking() -> MatchingConfig:
    """Return the matching of scans with the map, which may have changed: a lower bar."""
    return MatchingConfig(
        sure=0.25,
        poor=0.15,
        wide_reach=0.5,
        wide_turn=math.radians(15.0),
        heading_step=math.radians(0.5),
        least_turn_error=math.radians(0.5),
    )


@dataclass(frozen=True, kw_only=True)
class EvidenceConfig:
    """How much a scan speaks for a pose: a mixture of beams explained by the map, and of others."""

    sigma: float = 0.12
    """Standard deviation of the distance of a beam's end from a wall of the map (m)."""
    explained: float = 0.85
    """Share of the beams that end at walls of the map, at the true pose."""
    gain: float = 15.0
    """How much more likely a beam ends at a wall that the map has than at the same distance in an
    unknown building."""
    through: float = -3.0
    """Logarithm of the likelihood ratio of a beam that passes through a wall of the map."""
    bias: float = 0.9
    """What is taken off each beam, because unknown buildings have walls like this one's."""
    beams: float = 12.0
    """Number of beams of a scan that count as independent; neighbouring beams err together."""
    spacing: float = 0.15
    """Smallest distance between the ends of two successive beams that are used (m)."""
    reach: float = 12.0
    """Largest length of a beam that is used (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "sigma", "beams", "reach")
        check_fields(self, NOT_NEGATIVE, "bias", "spacing")
        check_fields(self, _OPEN_SHARE, "explained")
        check_fields(self, Range("a number above 1", 1.0, beyond=True), "gain")
        check_fields(self, Range("a number below 0", -1e3, 0.0), "through")


@dataclass(frozen=True, kw_only=True)
class LocaliserConfig:
    """Parameters of localisation in a saved map. Values without a named source are ours."""

    following: MatchingConfig = dataclasses.field(default_factory=_following)
    """Matching of scans with the latest ones, before the robot is localised."""
    tracking: MatchingConfig = dataclasses.field(default_factory=_tracking)
    """Matching of scans with the map, once the robot is localised."""
    field: FieldConfig = dataclasses.field(
        default_factory=lambda: FieldConfig(cell=0.05, sigma=0.08, half=1.0, levels=3)
    )
    """The likelihood field of the map's walls; its size follows from the map."""
    coarse: FieldConfig = dataclasses.field(
        default_factory=lambda: FieldConfig(cell=0.2, sigma=0.2, half=1.0, levels=3)
    )
    """The likelihood field that is searched for the robot."""
    evidence: EvidenceConfig = dataclasses.field(default_factory=EvidenceConfig)
    """How much a scan speaks for a pose."""
    heading_step: float = math.radians(3.0)
    """Spacing of the headings that are searched (rad)."""
    search_reach: float = 8.0
    """Largest distance of the points that are searched for (m)."""
    search_share: float = 0.4
    """Least mean likelihood of the points at a pose that the search returns."""
    candidates: int = 250
    """Number of poses that a search returns at most."""
    hypotheses: int = 100
    """Number of hypotheses that are kept at most."""
    step: float = 0.5
    """Distance between two looks, the scans that are weighed (m)."""
    turn: float = math.radians(45.0)
    """Turn between two looks (rad)."""
    looks: int = 30
    """Number of latest looks whose evidence counts."""
    search_every: float = 1.5
    """Distance after which an undecided robot searches the map again (m)."""
    elsewhere: float = 2.5
    """Least distance between the first and the latest look, in a straight line, at a decision
    (m)."""
    new_walls: int = 10
    """Least number of `patch`-sized pieces of wall that the looks after the first explain and the
    first look does not, at a decision."""
    patch: float = 0.5
    """Size of a piece of wall (m)."""
    indifference: float = 1.5
    """Difference of a look's evidence up to which two hypotheses fit it equally well."""
    unlike: float = 0.5
    """Prior probability that the robot is nowhere in the map."""
    certain: float = 0.999
    """Least probability of a hypothesis that is believed."""
    share: float = 0.84
    """Least share of the beams of all looks that the map explains at a pose that is believed."""
    worst_share: float = 0.76
    """Least share of the beams of the worst third of the looks. In a wrong place some looks fit."""
    apart: float = 0.5
    """Hypotheses within this distance are one (m)."""
    apart_turn: float = math.radians(20.0)
    """Hypotheses within this turn are one (rad)."""
    lost_share: float = 0.6
    """A localised robot is lost if its latest looks explain a smaller share of the beams."""
    lost_looks: int = 6
    """Number of latest looks by which a robot is found to be lost."""
    nowhere: float = 8.0
    """An undecided robot calls itself lost after this distance if no pose in the map fits (m)."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "heading_step", "search_reach", "step", "turn", "search_every",
            "elsewhere", "patch", "apart", "apart_turn", "nowhere",
        )  # fmt: skip
        check_fields(self, NOT_NEGATIVE, "indifference")
        check_fields(self, SHARE, "search_share", "share", "worst_share", "lost_share")
        check_fields(self, _OPEN_SHARE, "unlike", "certain")
        check_fields(self, FROM_ONE, "candidates", "hypotheses", "new_walls", "lost_looks")
        check_fields(self, FROM_TWO, "looks")
