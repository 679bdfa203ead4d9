"""A model of the odometer's turns, learnt from the landmarks of successive views.

The paper relies on small errors between two views. The model decides where landmarks are searched;
it is ours, and changes nothing in the map.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Pose

_FORGETTING = 0.98
"""Factor by which the weight of earlier motions falls with each motion. Ours."""
_PRIOR_SQUARES = 10.0
"""The drift has half its weight where the motions' squared lengths add up to this (m²). Ours."""
_PRIOR_MOTIONS = 10.0
"""Number of motions whose weight the initial standard deviation has. Ours."""


class OdometerModel:
    """Drift and standard deviation of the odometer's turns.

    Args:
        turn_sigma: Initial and minimum standard deviation of a turn (rad).
    """

    def __init__(self, turn_sigma: float) -> None:
        self._least = turn_sigma
        self.sums: Float64[np.ndarray, "4"] = np.zeros(4)
        """Weighted sums over past motions: error of the turn times length (rad m), length squared
        (m²), error beyond the drift squared (rad²), and number."""

    def expected(self, motion: Pose) -> Pose:
        """Return the odometer's motion (m, m, rad) without its drift, a turn per metre."""
        errors, squares, _, _ = self.sums.tolist()
        turn = errors / (squares + _PRIOR_SQUARES) * np.hypot(*motion[:2])
        x, y, heading = motion.tolist()
        return np.array((x, y, heading - turn))

    @property
    def turn_sigma(self) -> float:
        """The standard deviation of a turn (rad)."""
        _, _, squares, count = self.sums.tolist()
        mean = (_PRIOR_MOTIONS * self._least**2 + squares) / (_PRIOR_MOTIONS + count)
        return max(self._least, float(np.sqrt(mean)))

    def learn(self, motion: Pose, found: Pose) -> None:
        """Update the model by a motion by the odometer, and the same motion by the landmarks."""
        length = float(np.hypot(*motion[:2]))
        error = float(wrap_angle(motion[2] - found[2]))
        beyond = float(wrap_angle(self.expected(motion)[2] - found[2]))
        self.sums = _FORGETTING * self.sums + (length * error, length**2, beyond**2, 1.0)
