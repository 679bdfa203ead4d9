"""Surfaces are matched as a slow search by headings and distances matches them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import wrap_angle
from albot_core.mappers.albot1.config import Albot1Config, Albot1Limits
from albot_core.mappers.albot1.perceptual_map.submap_matching import match_surfaces
from albot_core.mappers.albot1.perceptual_map.turn_search import LINE_GAP
from albot_core.matching.lines import beside, describe, moved_ends
from albot_core.sensing.view import CORNER, NO_EDGE
from tests.core.mappers.albot1.rows import Rows, rows_of, some_surfaces


def slow_match(
    seen: Rows, expected: Rows, correction: np.ndarray, limits: Albot1Limits
) -> np.ndarray:
    """Of each surface seen the nearest point's row and end, and the nearest line's row."""
    about = np.cos(correction[2]), np.sin(correction[2])
    matches = np.full((len(seen[0]), 3), -1)
    for k, (row, row_ends) in enumerate(zip(*seen, strict=True)):
        ends = moved_ends(row, correction, *about)
        points, lines = [(limits.landmark_gap, -1, 0)], [(LINE_GAP, -1)]
        for q, (wall, wall_ends) in enumerate(zip(*expected, strict=True)):
            if abs(wrap_angle(wall[5] - row[5] - correction[2])) >= limits.landmark_angle:
                continue
            for end in range(2):
                if row_ends[end] != NO_EDGE and wall_ends[end] != NO_EDGE:
                    apart = np.subtract(ends, wall[:4])[2 * end : 2 * end + 2]
                    points.append((float(np.hypot(*apart)), q, end))
            lines.append((beside(wall, ends, row[4]), q))
        matches[k] = *min(points)[1:], min(lines)[1]
    return matches


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([5.0, 30.0, 180.0, 400.0]))
def test_the_nearest_point_and_the_nearest_line_are_matched(seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    limits = replace(
        Albot1Config.thesis(), submap_matching=True, landmark_angle=np.radians(angle)
    ).limits
    surfaces = some_surfaces(8, 2.0, rng)
    seen = rows_of(surfaces + rng.normal(0, 0.08, surfaces.shape), rng)
    expected = rows_of(surfaces, rng)
    correction = rng.normal(0, (0.05, 0.05, 0.03))
    matches = np.empty((8, 3), np.int64)
    points = match_surfaces(*seen, *expected, correction, limits, 1.0, matches)
    slow = slow_match(seen, expected, correction, limits)
    assert points == (slow[:, 0] >= 0).sum()
    matches[matches[:, 0] < 0, 1] = slow[slow[:, 0] < 0, 1] = 0
    np.testing.assert_array_equal(matches, slow)


@pytest.mark.parametrize(("turn", "matched"), [(4.99, True), (5.01, False)])
def test_surfaces_turned_5_degrees_are_not_one(turn: float, matched: bool) -> None:
    limits = Albot1Config().limits
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    seen, expected = np.empty((1, 10)), np.empty((1, 8))
    describe(np.array((0.0, 0.0, cos, sin)), seen[0])
    describe(np.array((0.0, 0.0, 1.0, 0.0)), expected[0])
    ends, matches = np.full((1, 2), CORNER, np.int8), np.empty((1, 3), np.int64)
    assert match_surfaces(seen, ends, expected, ends, np.zeros(3), limits, 1.0, matches) == matched
