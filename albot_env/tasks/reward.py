"""Rewards as named terms: what each is worth stands in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_env.tasks.exploration_kernel import TERMS


@dataclass(frozen=True, kw_only=True)
class ExploreWeights:
    """What the terms of the exploration reward are worth. A reward is their sum."""

    coverage: float = 0.02
    """For every square metre of ground truly covered for the first time (1/m²)."""
    room: float = 1.0
    """For every room truly entered for the first time."""
    collision: float = -0.1
    """For every step in contact with something."""
    time: float = -0.01
    """For every second that passes (1/s)."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InputError(f"ExploreWeights.{name}", "a finite number", str(value))

    @property
    def values(self) -> Float64[np.ndarray, "terms"]:
        """The weights in the order of `TERMS`."""
        return np.array([float(getattr(self, name)) for name in TERMS])
