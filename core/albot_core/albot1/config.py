"""Every threshold of Albot1, with the thesis's values as defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.perception.view import ViewConfig

TURN_STEP = math.radians(1.0)
"""Turns are tried this far apart (rad)."""


class Limits(NamedTuple):
    """The thresholds as the compiled steps take them (m, rad)."""

    view_spacing: float
    view_turn: float
    landmark_length: float
    landmark_angle: float
    landmark_gap: float
    fewest_landmarks: int
    margin: float
    eye_in_boundary: bool
    remembered: bool
    reach: float
    motion_error: float
    turn_error: float
    turns: np.ndarray
    """(turns, 3) float64: the turns tried, as cosine, sine, and votes that each must make up."""


@dataclass(frozen=True, kw_only=True)
class Albot1Config:
    """Thresholds of Albot1. The defaults are the thesis's, to the letter.

    `Albot1Config.improved()` are those of the default mapper, `albot1`.
    """

    view: ViewConfig = field(default_factory=ViewConfig)
    """Thresholds of view construction (section 3.1.3)."""
    view_spacing: float = 0.0
    """A reading is a view only from this far from the last view's place on (m)…"""
    view_turn: float = 0.0
    """…or from this large a turn since on (rad); one nearer than both only moves the robot.

    At 0 every reading is a view: a log's were taken as far apart as its robot stopped, or,
    guided in continuous motion, every 10 cm or 1°, or 1 m or 10° (section 3.1.2).
    """
    landmark_length: float = 0.40
    """Shorter surfaces are no landmarks (m; section 3.1.4)."""
    landmark_angle: float = np.radians(5.0)
    """Two surfaces are taken for one only below this angle (rad; algorithm 1, line 6)."""
    landmark_gap: float = 0.40
    """Two surfaces are taken for one only where their occluding or corner points are nearer
    than this (m; algorithm 1, line 7)."""
    fewest_landmarks: int = 3
    """With fewer recognised landmarks the limiting point is reached (algorithm 4, line 12)."""
    margin: float = 0.40
    """What lies this near to the view's boundary counts as inside (m; algorithm 3, line 9)."""
    eye_in_boundary: bool = False
    """The robot's own place is a corner of the view's boundary. Off: as algorithm 3, line 7,
    the surfaces' ends alone, so that where nothing stands at ±90° the ground between the
    robot and its first and last surface counts as outside."""
    remembered: bool = False
    """Recognise what is remembered nearby, under the likeliest turn, and localise by all of it.

    Off: as the thesis, landmarks are followed from view to view under the odometer's turn,
    and one of them localises the robot. The fields below matter only where this is on.
    """
    turn_search: float = np.radians(20.0)
    """How wrong the odometer's turn may be (rad)."""
    turn_cost: float = np.radians(12.0)
    """A turn this far from the odometer's must be worth one landmark more, and one twice as
    far four (rad)."""
    reach: float = 16.0
    """Only surfaces nearer than this are recognised and localise the robot (m)."""
    motion_error: float = 0.05
    """Standard deviation of the odometer's translation between views (m)."""
    turn_error: float = np.radians(5.0)
    """Standard deviation of the turn that the search has found (rad)."""

    def __post_init__(self) -> None:
        for name in (
            "landmark_length",
            "landmark_angle",
            "landmark_gap",
            "turn_cost",
            "reach",
            "motion_error",
            "turn_error",
        ):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"Albot1Config.{name}", "above 0", str(getattr(self, name)))
        for name in ("view_spacing", "view_turn", "margin", "turn_search"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InputError(f"Albot1Config.{name}", "0 or above", str(getattr(self, name)))
        if self.fewest_landmarks < 1:
            raise InputError(
                "Albot1Config.fewest_landmarks", "at least 1", str(self.fewest_landmarks)
            )

    @classmethod
    def improved(cls) -> Albot1Config:
        """The default mapper's thresholds.

        Against the letter of the thesis, surfaces lie on the line of all their points; the
        odometer's turn is doubted, because in real logs it is often off by more than the 5°
        that recognition allows; and all recognised surfaces together localise the robot.
        """
        return cls(view=ViewConfig(fit_lines=True), eye_in_boundary=True, remembered=True)

    @property
    def limits(self) -> Limits:
        """The thresholds as the compiled steps take them."""
        return Limits(*(getattr(self, name) for name in Limits._fields))

    @property
    def turns(self) -> Float64[np.ndarray, "turns 3"]:
        """The turns tried, as `Limits` holds them."""
        steps = int(self.turn_search / TURN_STEP + 0.5)
        turns = [TURN_STEP * step for step in range(-steps, steps + 1)]
        shares = [turn / self.turn_cost for turn in turns]
        return np.array(
            [
                (math.cos(turn), math.sin(turn), share * share)
                for turn, share in zip(turns, shares, strict=True)
            ]
        )
