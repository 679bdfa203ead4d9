"""Errors of pointing, the measures that are taken of them, and the effects between conditions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.evaluation.intervals import bootstrap
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose

Angles = Float64[np.ndarray, "errors"]
"""Signed errors (rad, counter-clockwise)."""
Triads = Int64[np.ndarray, "triads 3"]
"""Questions "stand at A, face B, point to C": numbers of A, B and C."""
NO_DIRECTION = math.pi / 2
"""Error of pointing to a target that is believed to be where one stands: the mean of chance."""
_NOWHERE = 1e-9
"""Two places within this distance have no direction from one another (m)."""


def pointing_errors(
    pointed: Float64[np.ndarray, "targets 2"],
    known: Bool[np.ndarray, "targets"],
    pose: Pose,
    targets: Float64[np.ndarray, "targets 2"],
) -> Angles:
    """Return the errors of egocentric pointing to the known targets (rad).

    Args:
        pointed: Where each target is believed to be, in the robot's frame (m).
        known: Whether each was ever seen.
        pose: The robot's true pose (world frame).
        targets: The true places (m, world frame).
    """
    away = targets[known] - pose[:2]
    true = np.arctan2(away[:, 1], away[:, 0]) - pose[2]
    believed = pointed[known]
    errors = wrap_angle(np.arctan2(believed[:, 1], believed[:, 0]) - true)
    return np.where(np.hypot(*believed.T) < _NOWHERE, NO_DIRECTION, errors)


def jrd_errors(
    imagined: Float64[np.ndarray, "targets 2"],
    targets: Float64[np.ndarray, "targets 2"],
    triads: Triads,
) -> Angles:
    """Return the errors of judgements of relative direction (rad).

    Args:
        imagined: Where each target is believed to be, in any one frame (m).
        targets: The true places (m).
        triads: The questions; all their targets are known.
    """
    believed, nowhere = _relative_direction(imagined, triads)
    true, _ = _relative_direction(targets, triads)
    return np.where(nowhere, NO_DIRECTION, wrap_angle(believed - true))


def _relative_direction(
    places: Float64[np.ndarray, "targets 2"], triads: Triads
) -> tuple[Float64[np.ndarray, "triads"], Bool[np.ndarray, "triads"]]:
    """Return the angle from B to C at A in each triad (rad), and whether there is none."""
    stand, face, point = (places[column] for column in triads.T)
    ahead, to = face - stand, point - stand
    angle = np.arctan2(to[:, 1], to[:, 0]) - np.arctan2(ahead[:, 1], ahead[:, 0])
    return angle, np.minimum(np.hypot(*ahead.T), np.hypot(*to.T)) < _NOWHERE


def triads_of(known: Bool[np.ndarray, "targets"]) -> Triads:
    """Return all questions about known targets; none if fewer than three are known."""
    return np.array(
        list(itertools.permutations(np.flatnonzero(known).tolist(), 3)), np.int64
    ).reshape(-1, 3)


def heading_error(errors: Angles) -> float:
    """Return the circular mean of the errors (rad): what a wrong own heading adds to all.

    Wang and Spelke's heading error. Where the errors cancel all round it is any angle.
    """
    return float(np.angle(np.exp(1j * errors).mean()))


def configuration_error(errors: Angles) -> float:
    """Return the standard deviation of the errors around their circular mean (rad).

    Wang and Spelke's configuration error, "the standard deviation of all individual object's
    errors" (thesis, section 2.1.1), and over judgements Waller and Hodgson's variable error.
    """
    return float(np.sqrt((wrap_angle(errors - heading_error(errors)) ** 2).mean()))


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A mean over subjects and its 95 % interval (degrees)."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Effect | None:
        """Return the effect of values of subjects (rad), bootstrapped; None if there are none."""
        if not len(values):
            return None
        degrees = np.degrees(np.asarray(values, np.float64))
        low, high = bootstrap(degrees, np.mean, np.random.default_rng(0))
        return cls(mean=float(degrees.mean()), low=low, high=high)

    def __str__(self) -> str:
        mean, low, high = (round(x, 1) + 0.0 for x in (self.mean, self.low, self.high))  # No -0.
        return f"{mean:.1f} ({low:.1f} to {high:.1f})"


MARGIN = 1.0
"""A change between conditions counts from here on (degrees)."""
KNOWN_BELOW = 45.0
"""A subject knows its targets if its configuration error with open eyes is below this (degrees).
Pointing by chance has 104°, the standard deviation of all directions."""
DISORIENTED_FROM = 20.0
"""A subject is disoriented if its heading error has grown by more than this (degrees)."""


def changes(before: Sequence[float], after: Sequence[float]) -> list[float]:
    """Return what a measure has grown by in each subject (rad)."""
    return [later - earlier for earlier, later in zip(before, after, strict=True)]


def rises(change: Effect | None) -> bool:
    """Return whether a change is a rise: its whole interval lies above `MARGIN`."""
    return change is not None and change.low > MARGIN


def stays(change: Effect | None) -> bool:
    """Return whether nothing changes: the whole interval lies within `MARGIN` of 0."""
    return change is not None and change.low > -MARGIN and change.high < MARGIN


def told(effect: Effect | None) -> str | None:
    """Return an effect as a cell of a table; None, a dash, if no subject can be measured."""
    return None if effect is None else str(effect)
