"""How well an agent explored: the ground covered against the way driven."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

HORIZON = 200
"""The way (m) over which coverage is measured."""


def sample_curve(
    path: Float64[np.ndarray, "steps 2"], coverages: Sequence[float]
) -> Float64[np.ndarray, "samples"]:
    """The share of the ground covered after 0, 1, 2, … `HORIZON` metres.

    Between two steps it is interpolated; after the last one it stays as it is.

    Args:
        path: Where the robot was at each step (m).
        coverages: The share covered by then.
    """
    driven = np.append(0.0, np.hypot(*np.diff(path, axis=0).T).cumsum())
    # Who stands and looks covers at no cost: of the steps at one place the last counts.
    last = np.append(np.diff(driven) > 0, True)
    shares = np.asarray(coverages)[last]
    return np.asarray(np.interp(np.arange(HORIZON + 1.0), driven[last], shares))


def area_under(curve: Float64[np.ndarray, "samples"]) -> float:
    """The mean height of a curve of even samples, by trapezia: 1 where all was covered at once."""
    return float((curve[1:] + curve[:-1]).mean() / 2)
