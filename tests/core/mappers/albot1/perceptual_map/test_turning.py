"""The likeliest turn against a slow vote of every surface for every turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import wrap_angle
from albot_core.mappers.albot1.config import TURN_STEP, Albot1Config, Albot1Limits
from albot_core.mappers.albot1.perceptual_map.turn_search import (
    LARGEST_COST,
    LINE_GAP,
    LINE_VOTE,
    likeliest_turn,
)
from albot_core.matching.lines import beside, moved_ends
from albot_core.sensing.view import NO_EDGE
from tests.core.mappers.albot1.rows import Rows, rows_of, some_surfaces


def slow_votes(seen: Rows, expected: Rows, limits: Albot1Limits) -> np.ndarray:
    """The votes for each turn."""
    bins = len(limits.turns)
    turns = (np.arange(bins) - bins // 2) * TURN_STEP
    votes = -np.minimum((turns / limits.turn_cost) ** 2, LARGEST_COST)
    for row, ends in zip(*seen, strict=True):
        own = np.zeros(bins)
        for wall, wall_ends in zip(*expected, strict=True):
            apart = wrap_angle(wall[5] - row[5])
            middle = min(max(int(apart / TURN_STEP + bins // 2 + 0.5), 0), bins - 1)
            aligned = moved_ends(row, np.zeros(3), *limits.turns[middle])
            aside = beside(wall, aligned, row[4])
            for b, turn in enumerate(turns):
                if abs(apart - turn) > limits.landmark_angle:
                    continue
                there = moved_ends(row, np.zeros(3), *limits.turns[b])
                for end in range(2):
                    away = np.subtract(there, wall[:4])[2 * end : 2 * end + 2]
                    if ends[end] != NO_EDGE and wall_ends[end] != NO_EDGE:
                        own[b] = max(own[b], 1 - (away @ away) / limits.landmark_gap**2)
                if aside < LINE_GAP:
                    share = 1 - ((apart - turn) / limits.landmark_angle) ** 2
                    own[b] = max(own[b], LINE_VOTE * (1 - (aside / LINE_GAP) ** 2) * share)
        votes = votes + own
    return votes


def turned(
    seen: Rows, expected: Rows, limits: Albot1Limits, scale: float | None = None, wide: float = 1.0
) -> float:
    """The turn found, by default on the scale of `limits.turn_cost`."""
    buffer = np.empty((2, len(limits.turns)))
    return likeliest_turn(*seen, *expected, limits, scale or limits.turn_cost, wide, buffer)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.floats(-0.3, 0.3), st.sampled_from([5.0, 20.0, 175.0]))
def test_it_is_the_turn_with_most_votes(seed: int, turn: float, angle: float) -> None:
    rng = np.random.default_rng(seed)
    limits = replace(
        Albot1Config.thesis(), submap_matching=True, landmark_angle=np.radians(angle)
    ).limits
    surfaces = some_surfaces(6, 4.0, rng)
    turned_lines = np.array(
        [moved_ends(row, np.zeros(3), np.cos(turn), np.sin(turn)) for row in surfaces]
    )
    seen = rows_of(surfaces + rng.normal(0, 0.03, surfaces.shape), rng)
    expected = rows_of(turned_lines, rng)
    votes = slow_votes(seen, expected, limits)
    found = turned(seen, expected, limits)
    place = round(found / TURN_STEP) + len(votes) // 2
    assert votes[place] == pytest.approx(votes.max(), abs=1e-9)


def test_with_nothing_to_go_by_the_odometer_is_right() -> None:
    limits = Albot1Config().limits
    nothing = rows_of(np.empty((0, 4)), np.random.default_rng(0))
    assert turned(nothing, nothing, limits) == 0.0


@pytest.mark.parametrize("degrees", [-45.0, -24.0, 0.0, 12.0, 24.0, 45.0])
def test_a_turn_that_is_far_off_is_found(degrees: float) -> None:
    limits, rng = Albot1Config().limits, np.random.default_rng(3)
    surfaces = some_surfaces(12, 6.0, rng)
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turned_lines = np.array([moved_ends(row, np.zeros(3), cos, sin) for row in surfaces])
    seen, expected = rows_of(surfaces, rng), rows_of(turned_lines, rng)
    found = turned(seen, expected, limits)
    assert np.degrees(found) == pytest.approx(degrees, abs=1.01)


@pytest.mark.parametrize(("scale", "expected"), [(6.0, 0.0), (40.0, 20.0)])
def test_one_wall_outvotes_a_wild_odometer_but_not_a_clean_one(
    scale: float, expected: float
) -> None:
    limits, rng = Albot1Config().limits, np.random.default_rng(0)
    wall = np.array([[3.0, -2.0, 3.0, 2.0]])
    angle = np.radians(20.0)
    there = np.array([moved_ends(wall[0], np.zeros(3), np.cos(angle), np.sin(angle))])
    seen, remembered = rows_of(wall, rng), rows_of(there, rng)
    for rows in (seen, remembered):
        rows[1][:] = NO_EDGE
    found = turned(seen, remembered, limits, np.radians(scale))
    assert np.degrees(found) == pytest.approx(expected, abs=1.5)


@pytest.mark.parametrize(("wide", "expected"), [(1.0, 0.0), (2.0, 20.0)])
def test_a_wall_half_a_metre_off_is_found_only_by_a_wider_search(
    wide: float, expected: float
) -> None:
    limits, rng = Albot1Config().limits, np.random.default_rng(0)
    angle = np.radians(20.0)
    wall = np.array([[3.0, -2.0, 3.0, 2.0]])
    there = np.array([moved_ends(wall[0], np.zeros(3), np.cos(angle), np.sin(angle))])
    there += 0.4 * np.array((np.cos(angle), np.sin(angle), np.cos(angle), np.sin(angle)))
    seen, remembered = rows_of(wall, rng), rows_of(there, rng)
    for rows in (seen, remembered):
        rows[1][:] = NO_EDGE
    found = turned(seen, remembered, limits, np.radians(90.0), wide)
    assert np.degrees(found) == pytest.approx(expected, abs=2.5)
