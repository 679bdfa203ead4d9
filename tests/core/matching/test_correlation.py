"""Scan matching against brute force, and on rooms whose walls are known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import compose, relative
from albot_core.matching.correlation import Window, correlate, correlate_above, covariance_around
from albot_core.matching.likelihood_field import CERTAIN, FieldConfig, LikelihoodField
from albot_core.matching.refinement import _score_at, refine
from albot_core.matching.scan_points import matched_points, surface_points
from albot_core.sensing.reading import LaserScan
from tests.core.mappers.slam.rooms import CORRIDOR, LASER, ROOM, scan_from

NO_PRIOR = np.zeros(3)


def field_of(pose: np.ndarray, walls: np.ndarray, config: FieldConfig) -> LikelihoodField:
    field = LikelihoodField(config)
    field.clear(pose[:2])
    field.add(pose, surface_points(scan_from(pose, walls), 20.0, config.cell))
    return field


def score_at(field: LikelihoodField, points: np.ndarray, pose: np.ndarray) -> float:
    """The sum of the points' likelihoods: the definition, point by point."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x = pose[0] + cos * points[:, 0] - sin * points[:, 1]
    y = pose[1] + sin * points[:, 0] + cos * points[:, 1]
    column, row = np.floor((np.stack((x, y)) - field.corner[:, None]) / field.config.cell)
    return field.finest[row.astype(int), column.astype(int)].sum() / CERTAIN


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    reach=st.integers(0, 7),
    turns=st.integers(0, 5),
    weights=st.tuples(st.floats(0, 50), st.floats(0, 50), st.floats(0, 50)),
    levels=st.integers(1, 5),
)
def test_the_best_pose_is_that_of_brute_force(seed, reach, turns, weights, levels):
    rng = np.random.default_rng(seed)
    config = FieldConfig(cell=0.1, sigma=0.1, half=4.0, levels=levels)
    field = LikelihoodField(config)
    field.clear(np.zeros(2))
    field.add(np.zeros(3), rng.uniform(-1.5, 1.5, (30, 2)))
    points, guess = rng.uniform(-1.2, 1.2, (20, 2)), rng.uniform(-0.4, 0.4, 3)
    window, prior = Window(0.1 * reach, 0.07 * turns, 0.07), np.array(weights)
    found = correlate(field, points, guess, window, prior)
    steps = np.arange(-reach, reach + 1) * 0.1
    angles = np.arange(-turns, turns + 1) * 0.07
    offsets = np.array(list(itertools.product(steps, steps, angles)))
    scores = [score_at(field, points, guess + off) - prior @ off**2 for off in offsets]
    assert found.score == pytest.approx(max(scores), abs=1e-9)
    window_of = (field, points, guess, window, prior)
    below = correlate_above(found.score - 1e-6, *window_of)
    assert below is not None
    assert below.score == found.score
    assert correlate_above(found.score, *window_of) is None
    off = found.pose - guess
    assert score_at(field, points, found.pose) - prior @ off**2 == pytest.approx(max(scores))
    assert found.response == pytest.approx(score_at(field, points, found.pose) / len(points))


def test_a_scan_is_matched_where_it_was_taken():
    rng = np.random.default_rng(3)
    config = FieldConfig()
    field = field_of(np.array((0.3, 0.2, 0.4)), ROOM, config)
    for _ in range(20):
        true = np.array((0.3, 0.2, 0.4)) + rng.uniform(-0.3, 0.3, 3)
        points, normals = matched_points(scan_from(true), 20.0, 0.05)
        guess = true + rng.uniform(-1, 1, 3) * (0.5, 0.5, 0.35)
        best = correlate(field, points, guess, Window(0.6, 0.4, np.radians(1)), NO_PRIOR)
        # The grid of poses is that of the guess: within half a cell and half a step.
        np.testing.assert_allclose(best.pose, true, atol=0.06)
        found = refine(field, points, normals, best.pose, guess, NO_PRIOR)
        np.testing.assert_allclose(found.pose[:2], true[:2], atol=0.015)
        assert found.pose[2] == pytest.approx(true[2], abs=0.003)
        assert found.response > 0.8


def test_the_refinement_ends_at_a_maximum():
    field = field_of(np.zeros(3), ROOM, FieldConfig())
    points, normals = matched_points(scan_from(np.array((0.1, 0.0, 0.1))), 20.0, 0.05)
    found = refine(field, points, normals, np.array((0.13, 0.02, 0.08)), np.zeros(3), NO_PRIOR)
    for axis, off in itertools.product(range(3), (-0.004, 0.004)):
        away = found.pose.copy()
        away[axis] += off
        # Without iterations left it says what the score is there.
        there = refine(field, points[:, :], normals * 0.0, away, np.zeros(3), np.full(3, 1e12))
        assert there.response <= found.response + 1e-3


def test_slopes_and_information_are_those_of_the_definition():
    """By differences; and Σ w J Jᵀ, J how a point's distance from its wall follows the pose."""
    true, pose = np.array((0.4, -0.3, 0.2)), np.array((0.41, -0.31, 0.22))
    config = FieldConfig()
    field = field_of(true, ROOM, config)
    arrays = (field.finest, field.corner, config.cell, config.sigma)
    points, normals = matched_points(scan_from(true, ROOM), 12.0, 0.1)
    normals[::7] = 0.0  # Unknown: half the information in every direction.

    def score(at: np.ndarray, chosen: slice = slice(None)) -> tuple[float, np.ndarray, np.ndarray]:
        gradient, matrix = np.zeros(3), np.zeros(6)
        scan = points[chosen].copy(), normals[chosen].copy()
        found = _score_at(arrays, scan, at, pose, NO_PRIOR, gradient, matrix)
        return found, gradient, matrix

    total, gradient, matrix = score(pose)
    steps = 1e-6 * np.eye(3)
    slopes = [(score(pose + step)[0] - score(pose - step)[0]) / 2e-6 for step in steps]
    np.testing.assert_allclose(gradient, slopes, rtol=1e-3, atol=1e-3 * abs(np.array(slopes)).max())
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turned = np.array(((cos, -sin), (sin, cos)))
    expected, likelihoods = np.zeros((3, 3)), []
    for k in range(len(points)):
        likelihoods.append(score(pose, slice(k, k + 1))[0])
        dx, dy = turned @ points[k]
        normal = turned @ normals[k]
        across = np.outer(normal, normal) if normal.any() else np.eye(2) / 2
        moved = np.array(((1.0, 0.0, -dy), (0.0, 1.0, dx)))
        expected += likelihoods[-1] / config.sigma**2 * moved.T @ across @ moved
    assert total == pytest.approx(sum(likelihoods))
    np.testing.assert_allclose(matrix, expected[np.triu_indices(3)], rtol=1e-9)


def test_the_prior_pulls_where_the_scan_says_nothing():
    field = field_of(np.zeros(3), CORRIDOR, FieldConfig())
    points, normals = matched_points(scan_from(np.zeros(3), CORRIDOR), 8.0, 0.05)
    guess = np.array((0.35, 0.1, 0.05))
    prior = np.array((20.0, 20.0, 20.0))
    best = correlate(field, points, guess, Window(0.5, 0.2, np.radians(1)), prior)
    found = refine(field, points, normals, best.pose, guess, prior)
    assert found.pose[0] == pytest.approx(0.35, abs=0.1)
    assert found.pose[1] == pytest.approx(0.0, abs=0.015)
    assert found.pose[2] == pytest.approx(0.0, abs=0.005)
    along, across = found.information[0, 0], found.information[1, 1]
    assert along < 0.03 * across


def test_the_covariance_is_long_where_the_corridor_is():
    window = Window(0.3, 0.03, 0.01)
    pose = np.array((0.0, 0.0, np.pi / 2))
    field = field_of(pose, CORRIDOR, FieldConfig())
    points, _ = matched_points(scan_from(pose, CORRIDOR), 8.0, 0.05)
    corridor = covariance_around(field, points, pose, window)
    assert corridor[0, 0] > 10 * corridor[1, 1]
    field = field_of(pose, ROOM, FieldConfig())
    points, _ = matched_points(scan_from(pose, ROOM), 8.0, 0.05)
    room = covariance_around(field, points, pose, window)
    assert room[0, 0] < 0.2 * corridor[0, 0]
    for matrix in (corridor, room):
        np.testing.assert_allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0


def test_the_covariance_is_olsons_to_the_letter():
    """Equations 4 to 6, pose by pose, and the variance of one cell and step."""
    field = field_of(np.zeros(3), ROOM, FieldConfig())
    points, _ = matched_points(scan_from(np.zeros(3)), 20.0, 0.3)
    pose, window = np.array((0.03, -0.02, 0.01)), Window(0.1, 0.02, 0.01)
    steps, angles = np.arange(-2, 3) * 0.05, np.arange(-2, 3) * 0.01
    offsets = np.array(list(itertools.product(steps, steps, angles)))
    scores = np.array([score_at(field, points, pose + off) for off in offsets])
    weights = np.exp((scores - scores.max()) / 3.0)
    u = weights @ offsets
    k = np.einsum("n,na,nb->ab", weights, offsets, offsets)
    expected = k / weights.sum() - np.outer(u, u) / weights.sum() ** 2
    expected += np.diag((0.05**2, 0.05**2, 0.01**2)) / 12
    found = covariance_around(field, points, pose, window, correlated=3.0)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_points_are_thinned_and_have_the_walls_normals():
    points, normals = matched_points(scan_from(np.zeros(3)), 20.0, 0.1)
    assert (np.hypot(*np.diff(points, axis=0).T) >= 0.1).all()
    known = (normals != 0).any(axis=1)
    assert known.mean() > 0.9
    np.testing.assert_allclose(np.hypot(*normals[known].T), 1.0)
    on_front = known & np.isclose(points[:, 0], 5.0) & (np.abs(points[:, 1]) < 2)
    np.testing.assert_allclose(
        np.abs(normals[on_front]), np.array(((1.0, 0.0),)).repeat(on_front.sum(), 0), atol=1e-9
    )
    # Nothing at the laser's range and beyond, nor where it says 0.
    scan = scan_from(np.zeros(3))
    scan.ranges[:10], scan.ranges[10:20] = 0.0, np.inf
    assert len(matched_points(scan, 100.0, 0.0)[0]) == len(scan.ranges) - 20
    scan.ranges[:] = np.inf
    assert matched_points(scan, 100.0, 0.0)[0].shape == (0, 2)


def test_surfaces_are_filled_in_and_nothing_else_is():
    filled = surface_points(scan_from(np.zeros(3)), 20.0, 0.05)
    off = np.abs(filled[:, :1] - np.array((-4.0, 5.0, 1.0)))
    off = np.minimum(off.min(axis=1), np.abs(filled[:, 1:] - np.array((-3.0, 4.0))).min(axis=1))
    np.testing.assert_allclose(off, 0.0, atol=1e-9)
    front = filled[np.isclose(filled[:, 0], 5.0) & (np.abs(filled[:, 1]) < 2.5)]
    assert np.diff(front[:, 1]).max() < 0.0501
    # The end of the stub is seen before the wall behind it: no surface leads from one to other.
    assert not (
        (filled[:, 0] > 1.1) & (filled[:, 1] > 2.6) & (filled[:, 1] < 3.9) & (filled[:, 0] < 4.9)
    ).any()
    nothing = LaserScan(ranges=np.full(180, np.inf), geometry=LASER)
    assert surface_points(nothing, 20.0, 0.05).shape == (0, 2)


def test_a_scan_without_points_leaves_the_guess():
    field = field_of(np.zeros(3), ROOM, FieldConfig())
    nothing, guess = np.empty((0, 2)), np.array((0.1, 0.2, 0.3))
    found = correlate(field, nothing, guess, Window(0.2, 0.1, 0.05), np.ones(3))
    np.testing.assert_array_equal(found.pose, guess)
    assert found.score == found.response == 0.0
    refined = refine(field, nothing, nothing, guess, guess, np.ones(3))
    np.testing.assert_array_equal(refined.pose, guess)
    assert not refined.information.any()


def test_the_mount_of_the_laser_counts():
    from dataclasses import replace

    ahead = replace(LASER, mount=(0.25, 0.1, 0.5))
    pose = np.array((0.4, -0.2, 1.0))
    points, _ = matched_points(scan_from(pose, ROOM, ahead), 20.0, 0.0)
    eye = compose(pose, np.array(ahead.mount))
    other, _ = matched_points(scan_from(eye), 20.0, 0.0)
    from albot_core.geometry.poses import transform_points

    np.testing.assert_allclose(transform_points(relative(eye, pose), points), other, atol=1e-9)
