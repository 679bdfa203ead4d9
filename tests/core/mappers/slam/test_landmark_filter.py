"""FastSLAM's filter against matrices: proposal, weight, association, and landmarks' filters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import compose
from albot_core.mappers.slam.landmark_filter import NEW, move_and_weigh, update_landmarks

DEVIATIONS = np.array((0.2, 0.1, 0.05))
LIMITS = 9.21, np.log(0.01)


def expected(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """A landmark as seen from a pose."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.array(((cos, sin), (-sin, cos))) @ (point - pose[:2])


def jacobian(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The derivative of `expected` by the pose, by differences."""
    steps = 1e-6 * np.eye(3)
    rows = [(expected(pose + s, point) - expected(pose - s, point)) / 2e-6 for s in steps]
    return np.array(rows).T


def turn(angle: float) -> np.ndarray:
    return np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))


def covariance(row: np.ndarray) -> np.ndarray:
    return np.array(((row[2], row[3]), (row[3], row[4])))


def log_normal(error: np.ndarray, spread: np.ndarray) -> float:
    square = error @ np.linalg.solve(spread, error)
    return float(-0.5 * (square + np.log(np.linalg.det(spread))) - np.log(2 * np.pi))


def moved(landmarks, seen, motion, proposes, count=4000, limits=LIMITS, seed=0):
    """Poses, log-weights and matches of particles at (1, 2, 0.7) with the same landmarks."""
    rows = np.tile(np.array(landmarks, float), (count, 1, 1))
    poses, weights = np.tile((1.0, 2.0, 0.7), (count, 1)), np.zeros(count)
    matched = np.zeros((count, len(seen)), np.int64)
    noise = np.random.default_rng(seed).standard_normal((count, 3))
    move_and_weigh(
        rows, np.full(count, len(landmarks)), np.array(seen, float).reshape(-1, 5),
        np.array(motion), DEVIATIONS, noise, proposes, limits, poses, weights, matched,
    )  # fmt: skip
    return poses, weights, matched


MOTION = np.array((0.5, 0.1, 0.2))
LANDMARKS = ((4.0, 3.0, 0.01, 0.004, 0.02), (0.0, 5.0, 0.02, -0.005, 0.01))
NOISE = (0.003, 0.001, 0.005)


def sights(off=(0.05, -0.1)) -> np.ndarray:
    pose = compose(np.array((1.0, 2.0, 0.7)), MOTION)
    return np.array([(*(expected(pose, np.array(m[:2])) + off), *NOISE) for m in LANDMARKS])


def by_matrices(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and covariance of the proposal, and the log-weight: eq. (8) to (17) as matrices."""
    mean = compose(np.array((1.0, 2.0, 0.7)), MOTION)
    spread = np.zeros((3, 3))
    spread[:2, :2] = turn(mean[2]) @ np.diag(DEVIATIONS[:2] ** 2) @ turn(mean[2]).T
    spread[2, 2] = DEVIATIONS[2] ** 2
    log = 0.0
    for mark, sight in zip(np.array(LANDMARKS), seen, strict=True):
        h, r = jacobian(mean, mark[:2]), turn(mean[2])
        innovation = h @ spread @ h.T + r.T @ covariance(mark) @ r + covariance(sight)
        error = sight[:2] - expected(mean, mark[:2])
        log += log_normal(error, innovation)
        gain = spread @ h.T @ np.linalg.inv(innovation)
        mean, spread = mean + gain @ error, spread - gain @ innovation @ gain.T
    return mean, spread, log


def test_poses_are_drawn_where_motion_and_landmarks_agree():
    poses, weights, matched = moved(LANDMARKS, sights(), MOTION, True)
    mean, spread, log = by_matrices(sights())
    assert (matched == (0, 1)).all()
    np.testing.assert_allclose(weights, log, rtol=1e-6)
    deviations = np.sqrt(np.diag(spread))
    np.testing.assert_allclose(poses.mean(axis=0), mean, atol=4 * deviations.max() / np.sqrt(4000))
    np.testing.assert_allclose(np.cov(poses.T), spread, atol=0.05 * deviations.max() ** 2)
    assert (deviations < 0.8 * DEVIATIONS.max()).all()  # Landmarks tell more than the motion alone.


def test_fastslam_1_draws_by_the_motion_alone_and_weighs_what_is_drawn():
    poses, weights, matched = moved(LANDMARKS, sights(), MOTION, False, limits=(1e6, -1e6))
    centre = compose(np.array((1.0, 2.0, 0.7)), MOTION)
    along = (poses - centre)[:, :2] @ turn(centre[2])
    np.testing.assert_allclose(along.std(axis=0), DEVIATIONS[:2], rtol=0.06)
    np.testing.assert_allclose(poses[:, 2].std(), DEVIATIONS[2], rtol=0.06)
    assert (matched == (0, 1)).all()
    for pose, weight in zip(poses[:20], weights[:20], strict=True):
        r = turn(pose[2])
        log = 0.0
        for mark, sight in zip(np.array(LANDMARKS), sights(), strict=True):
            spread = r.T @ covariance(mark) @ r + covariance(sight)
            log += log_normal(sight[:2] - expected(pose, mark[:2]), spread)
        assert weight == pytest.approx(log, rel=1e-9)


def test_nothing_in_view_leaves_motion_and_weights():
    poses, weights, matched = moved(LANDMARKS, [], MOTION, True)
    centre = compose(np.array((1.0, 2.0, 0.7)), MOTION)
    along = (poses - centre)[:, :2] @ turn(centre[2])
    np.testing.assert_allclose(along.std(axis=0), DEVIATIONS[:2], rtol=0.06)
    np.testing.assert_array_equal(weights, 0.0)
    assert matched.shape == (4000, 0)


def test_what_lies_outside_the_gate_is_new_and_weighs_as_such():
    seen = sights(off=(3.0, 3.0))
    _, weights, matched = moved(LANDMARKS, seen, MOTION, True, count=5)
    assert (matched == NEW).all()
    np.testing.assert_allclose(weights, 2 * LIMITS[1])


def test_a_landmark_is_seen_once_in_a_scan():
    """Of two sights of one landmark the second is new."""
    seen = np.array((sights()[0], sights()[0]))
    _, _, matched = moved(LANDMARKS[:1], seen, MOTION, True, count=3)
    assert (matched == (0, NEW)).all()


def test_the_likelier_landmark_is_matched_not_the_nearer():
    """The nearer one is known so well that the sight is beyond its gate."""
    pose = compose(np.array((1.0, 2.0, 0.7)), MOTION)
    at = pose[:2] + turn(pose[2]) @ (3.0, 0.0)
    sharp = (*(at + turn(pose[2]) @ (0.5, 0.0)), 1e-6, 0.0, 1e-6)
    vague = (*(at + turn(pose[2]) @ (0.7, 0.0)), 0.2, 0.0, 0.2)
    seen = [(3.0, 0.0, *NOISE)]
    limits = 3.0, -20.0
    _, _, matched = moved((sharp, vague), seen, MOTION, True, count=2, limits=limits)
    assert (matched == 1).all()
    _, _, matched = moved((sharp,), seen, MOTION, True, count=2, limits=limits)
    assert (matched == NEW).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_association_is_that_of_a_search_of_all_landmarks(seed):
    """No landmark within the gate is skipped as too far, whatever the covariances."""
    rng = np.random.default_rng(seed)
    marks = np.zeros((12, 5))
    marks[:, :2] = rng.uniform(-6, 6, (12, 2))
    for row in marks:
        half = rng.normal(0, rng.choice((0.05, 0.5)), (2, 2))
        spread = half @ half.T + 1e-4 * np.eye(2)
        row[2:] = spread[0, 0], spread[0, 1], spread[1, 1]
    sight = np.array((*rng.uniform(-6, 6, 2), *NOISE))
    mean = compose(np.array((1.0, 2.0, 0.7)), MOTION)
    # One lies just within the gate, along the axis along which it is least known.
    axis, far = turn(rng.uniform(-np.pi, np.pi)), rng.uniform(1.0, 3.0)
    spread = axis @ np.diag((far**2, 1e-4)) @ axis.T
    marks[0, 2:] = spread[0, 0], spread[0, 1], spread[1, 1]
    marks[0, :2] = mean[:2] + turn(mean[2]) @ sight[:2] + np.sqrt(LIMITS[0]) * far * axis[:, 0]
    _, weights, matched = moved(marks, [sight], MOTION, True, count=1)
    spread = np.zeros((3, 3))
    spread[:2, :2] = turn(mean[2]) @ np.diag(DEVIATIONS[:2] ** 2) @ turn(mean[2]).T
    spread[2, 2] = DEVIATIONS[2] ** 2
    best, likeliest = NEW, LIMITS[1]
    for n, mark in enumerate(marks):
        h, r = jacobian(mean, mark[:2]), turn(mean[2])
        innovation = h @ spread @ h.T + r.T @ covariance(mark) @ r + covariance(sight)
        error = sight[:2] - expected(mean, mark[:2])
        log = log_normal(error, innovation)
        if error @ np.linalg.solve(innovation, error) <= LIMITS[0] and log > likeliest:
            best, likeliest = n, log
    assert matched[0, 0] == best
    assert weights[0] == pytest.approx(likeliest, rel=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_a_landmark_is_the_weighted_mean_of_what_was_seen_of_it(seed):
    """Given the path, the filter is the information filter: sums of inverse covariances."""
    rng = np.random.default_rng(seed)
    landmarks, counts = np.zeros((1, 4, 5)), np.zeros(1, np.int64)
    total, weighted = np.zeros((2, 2)), np.zeros(2)
    for k in range(5):
        pose = np.array((*rng.uniform(-3, 3, 2), rng.uniform(-np.pi, np.pi)))
        half = rng.normal(0, 0.3, (2, 2))
        spread = half @ half.T + 1e-3 * np.eye(2)
        point = rng.uniform(-5, 5, 2)
        row = np.array((*point, spread[0, 0], spread[0, 1], spread[1, 1]))
        matched = np.full((1, 1), NEW if k == 0 else 0)
        assert update_landmarks(landmarks, counts, row[None], matched, pose[None]) == 0
        r = turn(pose[2])
        information = np.linalg.inv(r @ spread @ r.T)
        total += information
        weighted += information @ (pose[:2] + r @ point)
    assert counts.tolist() == [1]
    np.testing.assert_allclose(covariance(landmarks[0, 0]), np.linalg.inv(total), rtol=1e-6)
    np.testing.assert_allclose(landmarks[0, 0, :2], np.linalg.solve(total, weighted), rtol=1e-6)


def test_no_landmark_is_added_without_room():
    landmarks, counts = np.zeros((2, 1, 5)), np.array((0, 1))
    landmarks[1, 0] = (7.0, 7.0, 0.1, 0.0, 0.1)
    seen = np.array(((1.0, 0.0, *NOISE), (2.0, 0.0, *NOISE)))
    matched = np.full((2, 2), NEW)
    assert update_landmarks(landmarks, counts, seen, matched, np.zeros((2, 3))) == 3
    assert counts.tolist() == [1, 1]
    assert landmarks[1, 0, 0] == 7.0
