"""Matching lines: known rigid motions are found, and pairs counted as the slow way does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import compose, inverse, transform_segments, wrap_angle
from albot_core.matching import line_matching
from albot_core.matching.line_matching import (
    MAX_LINES,
    AlikeHeadings,
    MatchConfig,
    _by_turn,
    _find_turn,
    _most_pairs,
    _turn_middles,
    lay_on,
    line_rows,
    match_everywhere,
    match_first,
    match_lines,
)
from albot_core.matching.line_merging import merge_lines
from albot_core.matching.line_pairs import ROUNDING, by_heading, pair_lines

ANYWHERE = MatchConfig(max_shift=np.inf, max_turn=np.pi)
NOWHERE = np.zeros(3)


def walls(rng: np.random.Generator, count: int, length: tuple[float, float] = (0.6, 3.0)):
    """Walls (count, 4) that lie and turn at random in 10 x 10 m."""
    middles, turns = rng.uniform(-5, 5, (count, 2)), rng.uniform(-np.pi, np.pi, count)
    half = 0.5 * rng.uniform(*length, count)[:, None] * np.stack((np.cos(turns), np.sin(turns)), 1)
    return np.concatenate((middles - half, middles + half), 1)


def motion_of(rng: np.random.Generator) -> np.ndarray:
    return np.array([*rng.uniform(-20, 20, 2), rng.uniform(-np.pi, np.pi)])


@pytest.mark.parametrize("seed", range(6))
def test_a_known_motion_is_found(seed):
    rng = np.random.default_rng(seed)
    mine, motion = walls(rng, 12), motion_of(rng)
    theirs = transform_segments(inverse(motion), mine)[rng.permutation(12)]
    likeness = match_lines(mine, theirs, NOWHERE, NOWHERE, ANYWHERE)
    np.testing.assert_allclose(likeness.pose[:2], motion[:2], atol=1e-3)
    assert abs(wrap_angle(likeness.pose[2] - motion[2])) < 1e-3
    assert likeness.matches == 12
    assert likeness.share == pytest.approx(1.0)
    middles = 0.5 * (mine[:, :2] + mine[:, 2:])
    assert likeness.left == (middles[:, 1] > 0).sum()
    assert likeness.left + likeness.right == 12


@pytest.mark.parametrize("seed", range(6))
def test_it_is_found_with_noise_and_with_parts_missing(seed):
    rng = np.random.default_rng(100 + seed)
    common, motion = walls(rng, 9), motion_of(rng)
    seen = common + rng.normal(0, 0.02, common.shape)
    mine = np.concatenate((seen, walls(rng, 5)))
    theirs = transform_segments(inverse(motion), np.concatenate((common, walls(rng, 5))))
    likeness = match_lines(mine, theirs, NOWHERE, NOWHERE, ANYWHERE)
    assert 8 <= likeness.matches <= 10
    assert np.hypot(*(likeness.pose - motion)[:2]) < 0.1
    assert abs(wrap_angle(likeness.pose[2] - motion[2])) < np.radians(2)


@pytest.mark.parametrize("seed", range(6))
def test_strange_walls_are_mostly_strange(seed):
    rng = np.random.default_rng(200 + seed)
    mine, theirs = walls(rng, 12), walls(rng, 12)
    assert match_lines(mine, theirs, NOWHERE, NOWHERE, ANYWHERE).matches <= 4


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_moving_either_place_moves_the_answer(seed):
    rng = np.random.default_rng(seed)
    mine = walls(rng, 8)
    theirs, motion, robot = mine + rng.normal(0, 0.02, mine.shape), motion_of(rng), motion_of(rng)
    here = match_lines(mine, theirs, NOWHERE, robot, ANYWHERE)
    moved = transform_segments(motion, mine)
    there = match_lines(moved, theirs, NOWHERE, compose(motion, robot), ANYWHERE)
    assert (there.matches, there.left, there.right) == (here.matches, here.left, here.right)
    assert there.share == pytest.approx(here.share)
    expected = compose(motion, here.pose)
    np.testing.assert_allclose(there.pose[:2], expected[:2], atol=1e-4)
    assert abs(wrap_angle(there.pose[2] - expected[2])) < 1e-5


def test_a_place_is_not_found_farther_or_more_turned_than_it_is_looked_for():
    rng = np.random.default_rng(7)
    mine = walls(rng, 10)
    near = replace(ANYWHERE, max_shift=1.0, max_turn=np.radians(10))
    for motion, found in [
        ((0.5, 0.5, 0.1), True),
        ((1.5, 0.0, 0.0), False),
        ((0.0, 0.0, 0.3), False),
    ]:
        theirs = transform_segments(inverse(np.array(motion)), mine)
        likeness = match_lines(mine, theirs, NOWHERE, NOWHERE, near)
        assert (likeness.matches == 10) is found
        # Looked for where it is, it is found.
        assert match_lines(mine, theirs, np.array(motion), NOWHERE, near).matches == 10


def test_the_turn_allowed_is_about_the_robot_not_about_a_far_frame():
    mine = walls(np.random.default_rng(8), 10)
    robot, far = np.array([0.0, 1.0, 0.0]), np.array([500.0, 0.0, 0.0])
    turn = np.array([0.0, 0.0, 0.08])  # about the robot: 40 m at the frame's origin
    about = compose(compose(robot, turn), inverse(robot))
    theirs = transform_segments(inverse(compose(about, far)), mine)
    near = replace(ANYWHERE, max_shift=0.5, max_turn=np.radians(10))
    assert match_lines(mine, theirs, far, robot, near).matches == 10


def test_nothing_is_like_nothing():
    empty, some = np.empty((0, 4)), walls(np.random.default_rng(0), 5)
    for mine, theirs in [(empty, empty), (empty, some), (some, empty), (some, 0.1 * some)]:
        likeness = match_lines(mine, theirs, NOWHERE, NOWHERE, ANYWHERE)
        assert tuple(likeness)[1:] == (0, 0, 0, 0.0)


def test_of_many_surfaces_the_longest_are_compared():
    rng = np.random.default_rng(1)
    many = walls(rng, 3 * MAX_LINES)
    rows = line_rows(many, ANYWHERE)
    lengths = np.hypot(*(many[:, 2:] - many[:, :2]).T)
    assert len(rows) == MAX_LINES
    np.testing.assert_allclose(np.sort(rows[:, 4]), np.sort(lengths)[-MAX_LINES:])


def slow_pairs(
    mine: np.ndarray, theirs: np.ndarray, pose: np.ndarray, config: MatchConfig
) -> list[int]:
    """Each of theirs is the nearest of mine that is beside it, parallel, and not yet taken."""
    pairs: list[int] = []
    for x1, y1, x2, y2 in transform_segments(pose, theirs):
        seen = np.array([x2 - x1, y2 - y1])
        best, which = config.max_gap, -1
        for k, (a1, b1, a2, b2) in enumerate(mine):
            wall = np.array([a2 - a1, b2 - b1])
            length = np.linalg.norm(wall)
            cos = seen @ wall / (np.linalg.norm(seen) * length)
            if k in pairs or cos <= np.cos(config.max_angle):
                continue
            along, across = wall / length, np.array([-wall[1], wall[0]]) / length
            ends = np.array([[x1 - a1, y1 - b1], [x2 - a1, y2 - b1]])
            first, last = ends @ along
            overlap = min(last, length) - max(first, 0)
            if overlap < 0.3 * min(np.linalg.norm(seen), length):
                continue
            aside = abs((ends @ across).mean())
            if aside < best:
                best, which = aside, k
        pairs.append(which)
    return pairs


@settings(deadline=None)
@given(seed=st.integers(0, 10**6), spread=st.floats(0.0, 0.2))
def test_surfaces_are_paired_as_the_slow_way_pairs_them(seed, spread):
    rng = np.random.default_rng(seed)
    mine, pose = walls(rng, 10), motion_of(rng)
    crowd = np.concatenate((mine, mine[:4]))
    theirs = transform_segments(inverse(pose), crowd + rng.normal(0, spread, crowd.shape))
    config = replace(ANYWHERE, max_angle=np.radians(15), max_gap=0.4)
    pairs = np.empty(len(theirs), np.int64)
    rows_mine = line_rows(mine, config)
    rows_theirs = line_rows(theirs, replace(config, min_length=1e-9))
    turned, taken = by_heading(rows_mine), np.empty(len(rows_mine), np.bool_)
    rest = rows_theirs, pose, config.limits
    found = pair_lines(rows_mine, turned, *rest, -1, pairs, taken)
    expected = slow_pairs(mine, theirs, pose, config)
    assert pairs.tolist() == expected
    assert found == sum(pair >= 0 for pair in expected)
    # It may stop only where there cannot be more.
    assert pair_lines(rows_mine, turned, *rest, found - 1, pairs, taken) == found
    assert pair_lines(rows_mine, turned, *rest, found, pairs, taken) <= found
    # Nor is a pose passed over under which there are so many.
    turns, middles = _by_turn(rows_mine, rows_theirs), np.empty((len(rows_theirs), 2))
    first, count = _find_turn(turns, float(pose[2]), config.limits.max_angle + ROUNDING)
    _turn_middles(rows_theirs, float(pose[2]), middles)
    alike = AlikeHeadings(turns, first, count, np.zeros(len(rows_theirs), np.int64), 1)
    assert found <= _most_pairs(rows_mine, rows_theirs, alike, middles, pose, config.max_gap)


def slow_first(
    mine: np.ndarray, theirs: np.ndarray, robot: np.ndarray, config: MatchConfig, enough: int
) -> tuple[np.ndarray, int, int] | None:
    """Algorithm 6 as it is written: the pose at which it stops, and the matches on either side."""
    middles = transform_segments(inverse(robot), mine).reshape(-1, 2, 2).mean(1)
    pose = np.empty(3)
    for one in line_rows(mine, config):
        for other in line_rows(theirs, config):
            for anchor in range(3):
                lay_on(one, other, anchor, pose)
                matched = [k for k in slow_pairs(mine, theirs, pose, config) if k >= 0]
                left = sum(middles[k, 1] > 0 for k in matched)
                if len(matched) > enough and 0 < left < len(matched):
                    return pose, left, len(matched) - left
    return None


@pytest.mark.parametrize("seed", range(3))
def test_the_first_match_is_that_at_which_algorithm_6_stops(seed):
    rng = np.random.default_rng(300 + seed)
    place, motion = walls(rng, 7), motion_of(rng)
    mine = np.concatenate((walls(rng, 2), place + rng.normal(0, 0.05, place.shape)))
    theirs = transform_segments(inverse(motion), np.concatenate((place, walls(rng, 2))))
    config = replace(ANYWHERE, max_gap=0.4)
    for robot in (NOWHERE, np.array([-9.0, 0.0, np.pi / 2]), np.array([1.0, 1.0, 2.0])):
        for enough in (1, 3, 4, 8):
            found = match_first(mine, theirs, NOWHERE, robot, config, enough)
            expected = slow_first(mine, theirs, robot, config, enough)
            if expected is None:
                assert found.matches <= enough or min(found.left, found.right) == 0
            else:
                assert (found.left, found.right) == expected[1:]
                rows = line_rows(mine, config), line_rows(theirs, config)
                rest = expected[0].copy(), found.matches, robot, config.limits
                refined = line_matching._refined(*rows, *rest)
                np.testing.assert_allclose(found.pose, refined.pose, atol=1e-9)
                gap = np.hypot(*(found.pose - expected[0])[:2])
                assert 0.0 < gap < 3.0
                assert found.matches == found.left + found.right


def test_the_first_match_on_both_sides_is_taken_although_more_match_on_one():
    place = walls(np.random.default_rng(5), 10)
    aside = transform_segments(np.array([0.0, 30.0, 0.0]), place)
    mine = np.concatenate((aside, place[:6]))
    best = match_lines(mine, place, NOWHERE, NOWHERE, ANYWHERE)
    assert (best.matches, best.right) == (10, 0)
    first = match_first(mine, place, NOWHERE, NOWHERE, ANYWHERE, 4)
    assert (first.matches, min(first.left, first.right) > 0) == (6, True)
    np.testing.assert_allclose(first.pose, NOWHERE, atol=1e-9)
    # If there is none it is the match of most lines.
    none = match_first(mine, place, NOWHERE, NOWHERE, ANYWHERE, 6)
    assert (none.matches, none.right) == (10, 0)


def test_joined_keeps_one_of_each_and_the_newer_unless_it_shows_much_less():
    old = np.array([[0.0, 0, 2, 0], [0, 5, 4, 5], [9, 9, 9, 12]])
    new = np.array([[0.0, 0.05, 1.9, 0.05], [1, 5.05, 2, 5.05], [20, 0, 21, 0]])
    both = merge_lines(old, new, ANYWHERE)
    np.testing.assert_array_equal(both, np.array([old[1], old[2], new[0], new[2]]))
    np.testing.assert_array_equal(merge_lines(old, np.empty((0, 4)), ANYWHERE), old)
    np.testing.assert_array_equal(merge_lines(np.empty((0, 4)), new, ANYWHERE), new)


@settings(deadline=None)
@given(seed=st.integers(0, 10**6))
def test_joining_what_is_known_adds_nothing(seed):
    some = walls(np.random.default_rng(seed), 6, (1.0, 2.0))
    apart = some + np.tile(np.repeat(np.arange(6) * 10.0, 2).reshape(6, 2), (1, 2))
    assert len(merge_lines(apart, apart, ANYWHERE)) == 6


def test_all_spots_at_which_a_place_may_be_are_found_the_best_first():
    rng = np.random.default_rng(3)
    starts = rng.uniform(-3, 3, (8, 2))
    place = np.concatenate((starts, starts + rng.uniform(-2, 2, (8, 2))), axis=1)
    spots = [np.array([0.0, 0.0, 0.0]), np.array([30.0, 5.0, 1.0]), np.array([-20.0, 9.0, -2.0])]
    mine = np.concatenate(
        [transform_segments(spot, place[k:]) for k, spot in enumerate(spots)], axis=0
    )
    found = match_everywhere(mine, place, np.zeros(3), ANYWHERE, 4)
    assert [match.matches for match in found[:3]] == [8, 7, 6]
    for match, spot in zip(found[:3], spots, strict=False):
        np.testing.assert_allclose(match.pose, spot, atol=1e-6)
    assert len(found) <= 4
    best = match_lines(mine, place, np.zeros(3), np.zeros(3), ANYWHERE)
    (only,) = match_everywhere(mine, place, np.zeros(3), ANYWHERE, 1)
    assert only.matches == best.matches
    np.testing.assert_array_equal(only.pose, best.pose)
    assert match_everywhere(mine, place[:0], np.zeros(3), ANYWHERE, 3) == []


def test_a_better_pose_stands_for_all_that_are_alike():
    best = np.array([[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [9.0, 9.0, 0.0]])
    most, robot = np.array([3, 4, 1]), np.zeros(3)
    assert not line_matching._keep(
        np.array([0.7, 0.0, 0.0]), 4, robot, line_matching.ALIKE, best, most
    )
    assert line_matching._keep(np.array([0.7, 0.0, 0.0]), 5, robot, line_matching.ALIKE, best, most)
    assert sorted(most.tolist()) == [0, 1, 5]
    assert line_matching._keep(
        np.array([-9.0, 0.0, 0.0]), 2, robot, line_matching.ALIKE, best, most
    )
    assert sorted(most.tolist()) == [1, 2, 5]
