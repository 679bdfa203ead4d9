"""The configuration of Sahabot 2's mappers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from albot_core.errors import InputError
from albot_core.ranges import FROM_ONE, POSITIVE, SHARE, Range, check_fields

_WIDTH = Range("an angle within (0, pi]", 0.0, math.pi, beyond=True)

HEADINGS = ("compass", "wheels")
INTEGRATIONS = ("exact", "approximate")
VISUALS = ("alv", "snapshot")


def _check_choice(config: object, name: str, choices: tuple[str, ...]) -> None:
    """Raise InputError unless a field is one of some words."""
    value = getattr(config, name)
    if value not in choices:
        raise InputError(f"{type(config).__name__}.{name}", " or ".join(choices), repr(value))


@dataclass(frozen=True, kw_only=True)
class SectorConfig:
    """What counts as a landmark in a laser's panorama. The camera's threshold is replaced: ours.

    A landmark is a sector of the panorama without a jump of the range, at both ends of which it
    goes farther, or nothing comes back. So both its edges are its own, and not those of something
    that hides a part of it.
    """

    jump: float = 0.5
    """Difference of neighbouring ranges at which a sector ends (m)."""
    reach: float = 25.0
    """Largest range of a landmark (m)."""
    widest: float = math.pi / 2
    """Largest width of a landmark (rad): a wall all along one side is none."""
    least: int = 2
    """Least number of landmarks, at the nest and now, that tell a direction."""
    alike: float = 0.6
    """Least ratio of the smaller of these two numbers to the larger: otherwise what is seen now is
    not the array of landmarks at the nest."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "jump", "reach")
        check_fields(self, _WIDTH, "widest")
        check_fields(self, FROM_ONE, "least")
        check_fields(self, SHARE, "alike")


@dataclass(frozen=True, kw_only=True)
class SahabotConfig:
    """Parameters of Sahabot 2. The thesis gives no values: all are ours."""

    heading: str = "compass"
    """What tells the heading: `compass`, or `wheels` for the proprioceptive system with which
    figure 2.12c compares it."""
    integration: str = "exact"
    """`exact`, or `approximate`: the ant's own integration after Müller and Wehner (1988)."""
    visual: str = "alv"
    """How landmarks tell the direction of the nest: `alv`, the average landmark vector, or
    `snapshot`, the sectors of the snapshot matched one by one (Cartwright and Collett 1983)."""
    landmarks: SectorConfig = field(default_factory=SectorConfig)
    """What counts as a landmark."""
    near: float = 3.0
    """Length of the home vector (m) below which landmarks tell the way."""
    arrived: float = 0.25
    """Distance from the nest by the landmarks (m) below which the robot is there."""
    learning: float = 0.5
    """Distance from the nest (m) up to which, before it has gone farther, a robot adds to its
    snapshot the directions that it has not looked in yet."""
    step: float = 1.0
    """Distance ahead of the point that landmarks give on the way home (m)."""
    stuck: float = math.radians(20.0)
    """Turn by the wheels (rad) after which a compass that still shows the very same number is taken
    for broken. Until it shows another one, the wheels tell the heading."""

    def __post_init__(self) -> None:
        _check_choice(self, "heading", HEADINGS)
        _check_choice(self, "integration", INTEGRATIONS)
        _check_choice(self, "visual", VISUALS)
        check_fields(self, POSITIVE, "near", "arrived", "learning", "step", "stuck")

    @classmethod
    def wheels(cls) -> SahabotConfig:
        """Return the configuration of a robot without a compass."""
        return cls(heading="wheels")
