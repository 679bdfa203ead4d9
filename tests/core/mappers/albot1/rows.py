"""Rows of surfaces, as they are compared, with ends of which some are landmarks' points."""

from __future__ import annotations

import numpy as np

from albot_core.matching.lines import describe
from albot_core.sensing.view import CORNER, NO_EDGE

Rows = tuple[np.ndarray, np.ndarray]


def some_surfaces(count: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Surfaces (count, 4) with middles no farther than `reach` from the origin along x and y."""
    middles, headings = rng.uniform(-reach, reach, (count, 2)), rng.uniform(-np.pi, np.pi, count)
    half = rng.uniform(0.3, 1.5, (count, 1)) * np.stack((np.cos(headings), np.sin(headings)), 1)
    return np.concatenate((middles - half, middles + half), axis=1)


def rows_of(surfaces: np.ndarray, rng: np.random.Generator) -> Rows:
    """Their rows, and what their ends are."""
    rows = np.empty((len(surfaces), 10))
    for surface, row in zip(surfaces, rows, strict=True):
        describe(surface, row)
    return rows, np.where(rng.random((len(surfaces), 2)) < 0.7, CORNER, NO_EDGE).astype(np.int8)
