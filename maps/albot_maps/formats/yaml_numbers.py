"""Numbers as our own world file writes them: short, and exact."""

from __future__ import annotations

import numpy as np


def flow(values: np.ndarray) -> str:
    """An array in YAML's flow style: `[[0, 1.5], [2, 3]]`."""
    if values.ndim > 1:
        return f"[{', '.join(map(flow, values))}]"
    return f"[{', '.join(map(number, values.tolist()))}]"


def number(value: float) -> str:
    """A number that reads back as the same."""
    return repr(float(value)).removesuffix(".0")


def angle(name: str, radians: float) -> str:
    """`name` in degrees where they say exactly the same angle, else `name_rad`."""
    degrees = float(np.rad2deg(radians))
    for candidate in (round(degrees, 6), degrees):
        if np.deg2rad(candidate) == radians:
            return f"{name}: {number(candidate)}"
    return f"{name}_rad: {number(radians)}"
