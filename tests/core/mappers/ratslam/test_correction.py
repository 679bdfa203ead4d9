"""Map correction: where it leads, and when it is stable."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import compose, relative
from albot_core.mappers.ratslam.correction import correct_all_at_once, correct_link_by_link

PAPER = 0.5
"""α of table 1."""


def correct(poses, links, passes, form="link_by_link", rate=PAPER):
    sources, targets, motions = links
    arrays = np.array(sources), np.array(targets), np.array(motions, float)
    for _ in range(passes):
        if form == "link_by_link":
            ones = np.ones(len(sources))
            correct_link_by_link(poses, arrays, len(sources), rate, ones)
        else:
            is_limited = form == "all_at_once_limited"
            changes = np.zeros((len(poses), 4))
            correct_all_at_once(poses, arrays, len(sources), rate, changes, is_limited)


def unwrapped(one, other):
    motion = relative(one, other)
    motion[2] = other[2] - one[2]
    return motion


def square(laps: int = 1) -> np.ndarray:
    """Poses every metre round a square of 4 m, headings unwrapped."""
    pose, poses = np.zeros(3), []
    for k in range(16 * laps):
        poses.append(pose)
        step = np.array((1.0, 0.0, np.pi / 2 if k % 4 == 3 else 0.0))
        heading = pose[2] + step[2]
        pose = compose(pose, step)
        pose[2] = heading
    return np.array(poses)


@pytest.mark.parametrize("form", ["link_by_link", "all_at_once"])
@pytest.mark.parametrize("excess", [1.5, 90.0, 180.0, 360.0])
def test_a_lap_with_a_bias_closes_in_its_winding(form, excess):
    """Degrees a lap; spread evenly they are all taken out, a whole turn too."""
    truth = square()
    bias = np.radians(excess) / 16
    links = [(k, (k + 1) % 16) for k in range(16)]
    motions = []
    for one, other in links:
        end = truth[other] + ((0.0, 0.0, 2 * np.pi) if other == 0 else 0.0)
        motions.append(unwrapped(truth[one], end) + np.array((0, 0, bias)))
    motions[-1][2] -= 2 * np.pi  # The winding in which the first is met again.
    poses = np.zeros((16, 3))
    for k in range(15):
        poses[k + 1] = compose(poses[k], motions[k])
        poses[k + 1, 2] = poses[k, 2] + motions[k][2]
    correct(poses, (*zip(*links, strict=True), motions), 3000, form)
    if form == "all_at_once":
        np.testing.assert_allclose(poses, truth, atol=1e-6)
    else:  # Rates of 1/2 leave the last links looked at their due, of a sixteenth of the excess.
        assert np.hypot(*(poses - truth)[:, :2].T).max() < 0.25 * np.radians(excess)


def star(arms: int) -> tuple[np.ndarray, tuple]:
    """A junction: experience 1 with links to many others, all in their places but one."""
    angles = np.linspace(0, 2 * np.pi, arms, endpoint=False)
    ends = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(arms)))
    truth = np.concatenate((ends[:1], np.zeros((1, 3)), ends[1:])) - ends[0]
    others = [k for k in range(arms + 1) if k != 1]
    motions = [unwrapped(truth[1], truth[k]) for k in others]
    return truth, ([1] * arms, others, motions)


def test_at_junctions_only_link_by_link_is_stable():
    for arms, is_stable in ((2, True), (5, False)):
        truth, links = star(arms)
        for form in ("link_by_link", "all_at_once"):
            poses = truth.copy()
            poses[-1] += (0.3, -0.2, 0.1)
            with np.errstate(over="ignore", invalid="ignore"):
                correct(poses, links, 200, form)
            if is_stable or form == "link_by_link":
                np.testing.assert_allclose(poses, truth, atol=1e-6)
            else:
                assert not np.abs(poses).max() < 1e3


@pytest.mark.parametrize("rate", [0.1, 0.5, 0.9])
def test_random_graphs_are_stable_link_by_link(rate):
    rng = np.random.default_rng(1)
    truth = np.column_stack((rng.uniform(-5, 5, (30, 2)), rng.uniform(-3, 3, 30)))
    pairs = [(k, k + 1) for k in range(29)]
    pairs += [tuple(rng.choice(30, 2, replace=False).tolist()) for _ in range(60)]
    links = (*zip(*pairs, strict=True), [unwrapped(truth[i], truth[j]) for i, j in pairs])
    poses = truth + rng.normal(0, 0.5, truth.shape)
    poses[0] = truth[0]
    correct(poses, links, 2000, rate=rate)
    np.testing.assert_allclose(poses, truth, atol=1e-6)


def test_the_first_experience_stays():
    truth, links = star(4)
    poses = truth + 1.0
    correct(poses, links, 5)
    np.testing.assert_array_equal(poses[0], truth[0] + 1.0)


def test_all_at_once_is_the_papers_sum():
    """Eq. (12) to (14) spelled out, experience by experience."""
    rng = np.random.default_rng(2)
    before = rng.normal(size=(6, 3))
    pairs = [(0, 1), (1, 2), (2, 3), (3, 1), (4, 2), (5, 0)]
    motions = rng.normal(size=(6, 3))
    poses = before.copy()
    correct(poses, (*zip(*pairs, strict=True), motions), 1, "all_at_once")
    expected = before.copy()
    for i in range(1, 6):
        for (source, target), (x, y, turn) in zip(pairs, motions, strict=True):
            d, aside = np.hypot(x, y), np.arctan2(y, x)
            if source == i:
                j = target
                angle = before[i, 2] + aside
                expected[i] += PAPER * (
                    before[j] - (d * np.cos(angle), d * np.sin(angle), turn) - before[i]
                )
            if target == i:
                k = source
                angle = before[k, 2] + aside
                expected[i] += PAPER * (
                    before[k] + (d * np.cos(angle), d * np.sin(angle), turn) - before[i]
                )
    np.testing.assert_allclose(poses, expected, atol=1e-12)
