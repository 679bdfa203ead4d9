"""Rewards as named terms: what each is worth stands in one place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Weights:
    """What a reward's terms are worth, each in the field of its name."""

    terms: ClassVar[tuple[str, ...]]
    """The terms, in their order."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise InputError(f"{type(self).__name__}.{name}", "a finite number", str(value))

    @property
    def values(self) -> Float64[np.ndarray, "terms"]:
        """The weights in the order of the terms."""
        return np.array([float(getattr(self, name)) for name in self.terms])


def check_discount(weights: Any) -> None:
    """Raise InputError if the discount factor of these weights is not within (0, 1]."""
    if not 0 < weights.discount <= 1:
        place = f"{type(weights).__name__}.discount"
        raise InputError(place, "within (0, 1]", str(weights.discount))
