"""Directions as numbers that grow with them, for compiled code that wants no angles."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from numba import njit


@njit(cache=True, error_model="numpy")
def turned(u: float, v: float) -> float:
    """Grows with the direction of (u, v), from -2 to 2 through the x axis at 0."""
    part = v / max(abs(u) + abs(v), 1e-300)
    behind = 2.0 - part if v >= 0.0 else -2.0 - part
    return part if u >= 0.0 else behind


def angles_of(numbers: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """The angles (rad) of the directions that `turned` makes these numbers of."""
    sideways = np.where(np.abs(numbers) <= 1, numbers, np.sign(numbers) * 2 - numbers)
    ahead = np.where(np.abs(numbers) <= 1, 1, -1) * (1 - np.abs(sideways))
    return np.asarray(np.arctan2(sideways, ahead))
