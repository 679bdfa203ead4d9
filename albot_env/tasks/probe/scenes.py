"""The scenes of the probes: where a robot is led, what is changed, and what the right answer is.

Each is after an experiment with animals or people. The robot is led along a tour of a world of the
catalogue, so that it can build its map. Then, in some, the world is changed, or the robot is
carried elsewhere. Like the subjects, it is to come home. What it chose, and what would have been
right, follows from the scene alone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose

NO_CHOICE = "none"
"""The choice of a robot that has been at none of the points of choice."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One of the trials of a scene."""

    tour: str
    """Name of the tour, in the scene's world, on which the robot is led. It begins at home."""
    world: str = ""
    """Name of the world in which the robot is to come home; empty for the scene's own."""
    at: tuple[float, float] | None = None
    """Where the robot is carried after the tour (m); None where the tour ends."""
    heading: float | None = None
    """Heading of the robot that was carried (rad); None for one that is drawn."""
    right: tuple[str, ...] = ()
    """The right choices; empty where all that counts is to come home."""


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A probe's scene."""

    world: str
    """Name of the scene's world, in the catalogue."""
    title: str
    """What is tested, in one line."""
    source: str
    """The experiment."""
    trials: Mapping[str, Trial]
    """The trials by name, equally frequent."""
    choices: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Points of choice by name (m)."""
    reach: float = 1.0
    """A robot within this distance of a point has chosen it (m)."""
    keeps_first: bool = True
    """Whether the first choice counts; otherwise the place where the robot ends."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "trials", MappingProxyType(dict(self.trials)))
        object.__setattr__(self, "choices", MappingProxyType(dict(self.choices)))

    @cached_property
    def points(self) -> Float64[np.ndarray, "choices 2"]:
        """The points of choice, in order (m)."""
        return np.array(list(self.choices.values())).reshape(-1, 2)

    def chosen(self, position: Float64[np.ndarray, "2"]) -> str:
        """Return the choice of a robot at a position (m), or `NO_CHOICE`."""
        if not len(self.points):
            return NO_CHOICE
        away = np.hypot(*(self.points - position).T)
        nearest = int(away.argmin())
        return list(self.choices)[nearest] if away[nearest] <= self.reach else NO_CHOICE

    def release(self, trial: Trial, rng: np.random.Generator) -> Pose | None:
        """Return the pose to which the robot is carried; None if it stays where it was led."""
        if trial.at is None:
            return None
        heading = rng.uniform(-math.pi, math.pi) if trial.heading is None else trial.heading
        return np.array((*trial.at, heading))


def _triangles() -> Mapping[str, Trial]:
    """Return a trial for each tour of two legs (m) and the turn between them, to either side."""
    legs = itertools.product((2, 4, 6), (60, 90, 120), (2, 4, 6))
    sides = itertools.cycle(("left", "right"))
    names = (
        f"{a} m, {turn}° {side}, {b} m" for (a, turn, b), side in zip(legs, sides, strict=False)
    )
    return {name: Trial(tour=name) for name in names}


TRIANGLE_COMPLETION = Scene(
    world="probe-triangle",
    title="Path integration alone: after two legs over an open floor, the third leads home",
    source="Loomis and others, Nonvisual navigation by blind and sighted, Journal of Experimental "
    "Psychology: General 122, 1993",
    trials=_triangles(),
)

_ALLEYS = tuple(degrees for degrees in range(-80, 81, 10) if degrees)
"""Directions of the new alleys, clockwise from the old one (degrees)."""
_INSIDE = 9.0
"""An alley is chosen this far from the middle of the table, 2 m inside (m)."""
TOWARDS_FOOD = "40° right"
"""The alley that leads straight to the food."""


def _alley(degrees: int) -> str:
    """Return the name of the alley in a direction, clockwise from the old one."""
    return f"{abs(degrees)}° {'right' if degrees > 0 else 'left'}"


SUNBURST = Scene(
    world="probe-sunburst",
    title="A shortcut never driven: the known way is shut, one of 16 new alleys leads to the food",
    source="Tolman, Ritchie and Kalish, Studies in spatial learning I, Journal of Experimental "
    "Psychology 36, 1946",
    trials={
        "old way shut": Trial(tour="out", world="probe-sunburst-open", right=(TOWARDS_FOOD,)),
    },
    choices={
        _alley(degrees): (
            _INSIDE * math.sin(math.radians(degrees)),
            _INSIDE * math.cos(math.radians(degrees)),
        )
        for degrees in _ALLEYS
    },
    reach=0.75,
)

DETOUR = Scene(
    world="probe-detour",
    title="A detour: the doorway in a barrier is shut, and one way round is shorter",
    source="Köhler, The Mentality of Apes, 1925",
    trials={"doorway shut": Trial(tour="out", world="probe-detour-shut", right=("short way",))},
    choices={"short way": (8.0, 1.0), "long way": (8.0, 15.0)},
)

_CENTRE = (5.0, 2.5)
_HOME, _OPPOSITE = "corner of home", "opposite corner"
RECTANGLE = Scene(
    world="probe-rectangle",
    title="Geometry against a feature: the robot is turned round in a rectangular room",
    source="Cheng, A purely geometric module in the rat's spatial representation, Cognition 23, "
    "1986",
    trials={
        "column as it was": Trial(tour="out", at=_CENTRE, right=(_HOME,)),
        "no column": Trial(
            tour="out", world="probe-rectangle-bare", at=_CENTRE, right=(_HOME, _OPPOSITE)
        ),
        "column moved": Trial(
            tour="out", world="probe-rectangle-moved", at=_CENTRE, right=(_HOME, _OPPOSITE)
        ),
    },
    choices={
        _HOME: (1.7, 1.4),
        _OPPOSITE: (8.3, 3.6),
        "next along the long wall": (8.3, 1.4),
        "next along the short wall": (1.7, 3.6),
    },
    reach=1.1,
    keeps_first=False,
)

_EDGE = 5.5
HIDDEN_GOAL = Scene(
    world="probe-pool",
    title="A hidden goal: from four sides to an unmarked point, by what is far away",
    source="Morris, Spatial localization does not require the presence of local cues, Learning and "
    "Motivation 12, 1981",
    trials={
        # As in the paper, the subject is put in at the edge, facing outwards.
        "from the north": Trial(tour="out", at=(0.0, _EDGE), heading=math.pi / 2),
        "from the east": Trial(tour="out", at=(_EDGE, 0.0), heading=0.0),
        "from the south": Trial(tour="out", at=(0.0, -_EDGE), heading=-math.pi / 2),
        "from the west": Trial(tour="out", at=(-_EDGE, 0.0), heading=math.pi),
    },
)
