"""Range profiles in closed form, and the turns' scores against a slow comparison."""

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
    MIN_SHARE,
    OFFSET,
    PENALTY,
    SAME_RANGE,
    TURN_COST,
    TURNS,
    UNSEEN_HERE,
    UNSEEN_THERE,
    agreement,
    fill_profile,
    score_turns,
    take_likeliest,
    turn_at,
)
from albot_core.matching.lines import describe

WIDEST = Albot1Config().turn_search


def profile_of(surfaces: np.ndarray, unseen: int) -> np.ndarray:
    """The profile (3 BINS,) of surfaces (n, 4)."""
    rows, profile = np.empty((len(surfaces), 8)), np.empty(3 * BINS, np.int32)
    for surface, row in zip(surfaces, rows, strict=True):
        describe(surface, row)
    directions = fill_profile(rows, unseen, profile)
    assert directions == (profile[:BINS] != unseen).sum()
    return profile


def scores_of(
    seen: np.ndarray, expected: np.ndarray, widest: float, scale: float, nearly: float = np.inf
) -> np.ndarray:
    """The scores (TURNS,) of all turns between two profiles (3 BINS,)."""
    scores, directions = np.empty(TURNS), int((seen[:BINS] != UNSEEN_HERE).sum())
    score_turns(seen, directions, expected, widest, scale, scores, nearly)
    return scores


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
@given(st.integers(0, 10**6), st.floats(0.02, 1.0), st.floats(0.1, 4.0))
def test_the_scores_are_those_of_a_slow_comparison(seed: int, scale: float, widest: float) -> None:
    rng = np.random.default_rng(seed)
    seen, expected = rng.integers(100, 300, (2, BINS), dtype=np.int32)
    seen[rng.random(BINS) < rng.random()] = UNSEEN_HERE
    expected[rng.random(BINS) < rng.random()] = UNSEEN_THERE
    directions, slow = int((seen != UNSEEN_HERE).sum()), np.full(TURNS, -np.inf)
    for place, turn in enumerate(range(-BINS // 2, BINS // 2 + 1)):
        there = np.roll(expected, -turn)
        both = (seen != UNSEEN_HERE) & (there != UNSEEN_THERE)
        off = np.minimum(np.abs(seen[both] - there[both]) / SAME_RANGE, 1)
        enough = max(both.sum(), MIN_OVERLAP, MIN_SHARE * directions)
        cost = TURN_COST * np.log(1 + (turn * BIN / scale) ** 2)
        if abs(turn) * BIN <= widest:
            slow[place] = (1 - (1 + PENALTY) * off).sum() / enough - cost
    scores = scores_of(np.tile(seen, 3), np.tile(expected, 3), widest, scale)
    np.testing.assert_allclose(scores, slow, atol=1e-9)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.02, 1.0), st.sampled_from([0.0, 0.15, 0.5]))
def test_turns_that_are_left_out_are_far_below_the_best(
    seed: int, scale: float, nearly: float
) -> None:
    rng = np.random.default_rng(seed)
    seen = profile_of(a_room(0.0, rng), UNSEEN_HERE)
    there = profile_of(a_room(rng.uniform(-0.5, 0.5), np.random.default_rng(seed)), UNSEEN_THERE)
    every = scores_of(seen, there, WIDEST, scale)
    scores = scores_of(seen, there, WIDEST, scale, nearly)
    is_left_out = scores == -np.inf
    assert (every[is_left_out] < every.max() - nearly).all()
    np.testing.assert_array_equal(scores[~is_left_out], every[~is_left_out])


def test_turns_that_cost_too_much_are_left_out() -> None:
    profile = profile_of(a_room(0.0, np.random.default_rng(0)), UNSEEN_HERE)
    every = scores_of(profile, profile, WIDEST, 0.02)
    scores = scores_of(profile, profile, WIDEST, 0.02, 0.0)
    assert np.isneginf(scores).sum() > np.isneginf(every).sum()


@pytest.mark.parametrize("degrees", [-45.0, -24.0, 0.0, 12.0, 24.0, 45.0])
def test_a_turn_that_is_far_off_is_found(degrees: float) -> None:
    seen = profile_of(a_room(0.0, np.random.default_rng(3)), UNSEEN_HERE)
    there = profile_of(a_room(np.radians(degrees), np.random.default_rng(3)), UNSEEN_THERE)
    place, score = take_likeliest(scores_of(seen, there, WIDEST, np.radians(10.0)))
    assert np.degrees(turn_at(place)) == pytest.approx(degrees, abs=3.01)
    assert score > 0.0


def test_with_nothing_to_go_by_the_odometer_is_right() -> None:
    nothing = np.full(3 * BINS, UNSEEN_HERE, np.int32)
    there = np.full(3 * BINS, UNSEEN_THERE, np.int32)
    place, score = take_likeliest(scores_of(nothing, there, WIDEST, 0.1))
    assert turn_at(place) == score == 0.0


def test_a_few_directions_that_agree_are_no_evidence() -> None:
    # Two walls side by side in view, one of them expected: a quarter of the view agrees.
    seen, there = np.full(BINS, UNSEEN_HERE, np.int32), np.full(BINS, UNSEEN_THERE, np.int32)
    seen[:60], there[45:60] = 300, 300
    one, other = np.tile(seen, 3), np.tile(there, 3)
    assert agreement(one, 60, other, 0) == pytest.approx(15 / (MIN_SHARE * 60))
    there[:60] = 300
    assert agreement(one, 60, np.tile(there, 3), 0) == 1.0


def test_each_turn_taken_is_another() -> None:
    scores = np.full(TURNS, -np.inf)
    scores[50:60] = [1, 2, 9, 8, 7, 6, 3, 3, 2, 5]
    taken = [take_likeliest(scores) for _ in range(4)]
    assert taken[:3] == [(52, 9.0), (55, 6.0), (59, 5.0)]
    assert taken[3][1] == -np.inf
