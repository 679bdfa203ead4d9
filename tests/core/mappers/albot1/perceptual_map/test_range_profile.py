"""Range profiles in closed form, and the likeliest turn against a slow comparison of all turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.range_profile import (
    BIN,
    BINS,
    MIN_OVERLAP,
    OFFSET,
    PENALTY,
    SAME_RANGE,
    TURN_COST,
    UNSEEN_HERE,
    UNSEEN_THERE,
    fill_profile,
    likeliest_turns,
)
from albot_core.matching.lines import describe

WIDEST = Albot1Config().turn_search


def profile_of(surfaces: np.ndarray, unseen: int) -> np.ndarray:
    """The profile (3 BINS,) of surfaces (n, 4)."""
    rows, profile = np.empty((len(surfaces), 8)), np.empty(3 * BINS, np.int32)
    for surface, row in zip(surfaces, rows, strict=True):
        describe(surface, row)
    fill_profile(rows, unseen, profile)
    return profile


def a_room(turn: float, rng: np.random.Generator) -> np.ndarray:
    """A closed room of uneven shape (14, 4) around the robot, counterclockwise, turned."""
    angles = np.linspace(0, 2 * np.pi, 14, endpoint=False) + turn
    corners = rng.uniform(2, 6, (14, 1)) * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    return np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)


def test_a_wall_ahead_is_seen_at_its_range_in_the_directions_it_covers() -> None:
    profile = profile_of(np.array([[3.0, -3.0, 3.0, 3.0]]), UNSEEN_HERE)[:BINS]
    angles = (np.arange(BINS) + OFFSET) * BIN
    ahead = np.abs(np.arctan2(np.sin(angles), np.cos(angles))) <= np.pi / 4
    np.testing.assert_allclose(profile[ahead], 300 / np.cos(angles[ahead]), atol=1.0)
    assert (profile[~ahead] == UNSEEN_HERE).all()


def test_the_nearer_wall_counts_and_a_wall_from_behind_does_not() -> None:
    near, far = np.array([1.0, -1.0, 1.0, 1.0]), np.array([2.0, -1.0, 2.0, 1.0])
    both = profile_of(np.stack((far, near)), UNSEEN_HERE)
    np.testing.assert_array_equal(both, profile_of(near[None], UNSEEN_HERE))
    assert (profile_of(near[None, [2, 3, 0, 1]], UNSEEN_HERE) == UNSEEN_HERE).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.02, 1.0))
def test_they_are_the_turns_that_a_slow_comparison_finds(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    seen, expected = rng.integers(100, 300, (2, BINS), dtype=np.int32)
    seen[rng.random(BINS) < 0.3], expected[rng.random(BINS) < 0.3] = UNSEEN_HERE, UNSEEN_THERE
    bins, free = int(WIDEST / BIN), []
    for turn in range(-bins, bins + 1):
        there = np.roll(expected, -turn)
        both = (seen != UNSEEN_HERE) & (there != UNSEEN_THERE)
        off = np.minimum(np.abs(seen[both] - there[both]) / SAME_RANGE, 1)
        free.append((1 - (1 + PENALTY) * off).sum() / max(both.sum(), MIN_OVERLAP))
    turns = np.arange(-bins, bins + 1) * BIN
    costly = np.array(free) - TURN_COST * np.minimum((turns / scale) ** 2, 1)
    turn, other, score = likeliest_turns(np.tile(seen, 3), np.tile(expected, 3), WIDEST, scale)
    assert score == pytest.approx(costly.max(), abs=1e-9)
    assert costly[np.abs(turns - turn).argmin()] == pytest.approx(score, abs=1e-9)
    assert free[np.abs(turns - other).argmin()] == pytest.approx(max(free), abs=1e-9)


@pytest.mark.parametrize("degrees", [-45.0, -24.0, 0.0, 12.0, 24.0, 45.0])
def test_a_turn_that_is_far_off_is_found(degrees: float) -> None:
    seen = profile_of(a_room(0.0, np.random.default_rng(3)), UNSEEN_HERE)
    there = profile_of(a_room(np.radians(degrees), np.random.default_rng(3)), UNSEEN_THERE)
    turn, other, _ = likeliest_turns(seen, there, WIDEST, np.radians(10.0))
    assert np.degrees(turn) == pytest.approx(degrees, abs=3.01)
    assert other == turn


def test_with_nothing_to_go_by_the_odometer_is_right() -> None:
    nothing = np.full(3 * BINS, UNSEEN_HERE, np.int32)
    there = np.full(3 * BINS, UNSEEN_THERE, np.int32)
    turn, _, score = likeliest_turns(nothing, there, WIDEST, 0.1)
    assert turn == score == 0.0
