"""The walls that are listed as near: a slow search, wall by wall and point by point, finds them."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.kernels.simd import padded_length
from albot_core.mappers.albot1.perceptual_map.near_walls import (
    list_ends_near,
    list_walls_along,
    tabulate,
)
from tests.core.mappers.albot1.rows import rows_of, some_surfaces

MANY = 21
"""Walls; no multiple of those that are looked at together."""


def some_rows(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Rows of walls (MANY, 8) in a few square metres, and their table."""
    rows = rows_of(some_surfaces(MANY, 1.5, rng), rng)[0][:, :8]
    # What else the table holds is of walls that are gone.
    table = np.full((8, padded_length(MANY)), 0.1)
    tabulate(rows, table)
    return rows, table


def run_alike(row: np.ndarray, walls: np.ndarray, cosine: float) -> np.ndarray:
    """Whether walls (n, 8) are turned from one by less than the angle of this cosine (n,)."""
    return np.asarray(walls[:, 6:] @ row[6:] > cosine)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([5.0, 60.0, 170.0]), st.sampled_from([0.1, 0.4, 1.0]))
def test_walls_with_an_end_near_are_listed(seed: int, degrees: float, gap: float) -> None:
    rng = np.random.default_rng(seed)
    walls, table = some_rows(rng)
    row, near = some_rows(rng)[0][0], np.empty(MANY, np.int64)
    cosine, length = np.cos(np.radians(degrees)), 0.8
    args = (tuple(row[:4]), tuple(row[6:]), cosine, length, gap)
    listed = near[: list_ends_near(table, MANY, *args, near)]
    gaps = np.hypot(*np.moveaxis((walls[:, :4] - row[:4]).reshape(-1, 2, 2), 2, 0)).min(axis=1)
    wanted = run_alike(row, walls, cosine) & (gaps < gap) & (walls[:, 4] >= length)
    np.testing.assert_array_equal(listed, np.flatnonzero(wanted))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([30.0, 80.0]), st.sampled_from([0.05, 0.5, 1.0]))
def test_every_wall_on_which_a_point_lies_is_listed(seed: int, degrees: float, gap: float) -> None:
    rng = np.random.default_rng(seed)
    walls, table = some_rows(rng)
    row, near = some_rows(rng)[0][0], np.empty(MANY, np.int64)
    cosine, beyond = np.cos(np.radians(degrees)), 0.05
    places = np.linspace(0.1, row[4] - 0.1, 30)
    args = (tuple(row[:2]), tuple(row[6:]), places[0], places[-1], cosine, gap, beyond)
    listed = near[: list_walls_along(table, MANY, *args, near)]
    away = row[:2] + places[:, None] * row[6:] - walls[:, None, :2]
    along = (away * walls[:, None, 6:]).sum(axis=2)
    aside = np.abs(walls[:, None, 6] * away[:, :, 1] - walls[:, None, 7] * away[:, :, 0])
    lies_on = (aside <= gap) & (along >= -beyond) & (along <= walls[:, 4:5] + beyond)
    wanted = np.flatnonzero(lies_on.any(axis=1) & run_alike(row, walls, cosine))
    assert np.isin(wanted, listed).all()
    # A wall listed in vain is met by no point, but its line or its length by some.
    assert run_alike(row, walls, cosine)[listed].all()
    assert (along[listed] >= -beyond).any(axis=1).all()
    assert (aside[listed] <= gap + row[4] / 29).any(axis=1).all()
