"""Lines through points, against numpy's eigenvectors; bends, against walls of known shape."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.sensing.beam_model import RANGE_NOISE, BeamModel, variance_across
from albot_core.sensing.line_fit import LEAST_POINTS, find_bend, fit_line

RAYS, UNUSED = BeamModel(0.02, 0.0, True), BeamModel(0.02, 0.0, False)
WIDE = BeamModel(0.02, np.radians(0.5), True)
SIGNIFICANCE = 10.0


def wall(bend: float, rng: np.random.Generator, noise: float = RANGE_NOISE) -> np.ndarray:
    """Points every 0.1 m along 4 m of a wall 2 m to the left, bent by so much half-way (rad)."""
    along = np.arange(-2.0, 2.05, 0.1)
    points = np.stack((along, 2.0 + np.tan(bend) * np.maximum(along, 0.0)), axis=1)
    return points + noise * rng.standard_normal(points.shape)


def _weight_of(point: np.ndarray, aside: float, model: BeamModel) -> float:
    square = float(point @ point)
    return square / variance_across(square, aside, model)


@pytest.mark.parametrize("model", [UNUSED, RAYS, WIDE])
@pytest.mark.parametrize("seed", range(5))
def test_a_line_is_the_first_principal_axis(model: BeamModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, eye, line = wall(0.0, rng, 0.03), (0.3, 0.1), np.empty(4)
    fit_line(points, 2, len(points) - 3, eye, model, np.empty(len(points)), line)
    used = points[2:-2]
    run = (used[-1] - used[0]) / np.hypot(*(used[-1] - used[0]))
    aside = float((used[0] - eye) @ (-run[1], run[0]))
    weights = np.ones(len(used))
    if model.is_used:
        weights = np.array([_weight_of(p - eye, aside, model) for p in used])
    mean = weights @ used / weights.sum()
    axis = np.linalg.eigh((used - mean).T * weights @ (used - mean))[1][:, 1]
    assert line[:2] == pytest.approx(mean)
    assert abs(axis @ (-line[3], line[2])) < 1e-9
    assert line[2:] @ run > 0.99


def test_a_range_of_0_has_no_weight() -> None:
    points, line = wall(0.0, np.random.default_rng(0), noise=0.0) - (0.0, 2.0), np.empty(4)
    points[10] = (0.4, 0.0)  # at the laser, on the line of a wall that leads to it
    fit_line(points, 0, len(points) - 1, (0.4, 0.0), RAYS, np.empty(len(points)), line)
    assert line[2:].tolist() == pytest.approx([1.0, 0.0])


@pytest.mark.parametrize("degrees", [-6.0, 4.0, 10.0])
def test_a_bend_is_found_where_it_is(degrees: float) -> None:
    for seed in range(20):
        points = wall(np.radians(degrees), np.random.default_rng(seed))
        bend = find_bend(points, 0, len(points) - 1, SIGNIFICANCE)
        assert abs(points[bend, 0]) < 0.4


def test_a_bent_wall_without_noise_breaks_at_its_bend_alone() -> None:
    points = wall(np.radians(3.0), np.random.default_rng(0), noise=0.0)
    bend = find_bend(points, 0, len(points) - 1, SIGNIFICANCE)
    assert points[bend, 0] == pytest.approx(0.0)
    for first, last in ((0, bend), (bend, len(points) - 1)):
        assert find_bend(points, first, last, SIGNIFICANCE) == -1


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01, 0.03])
def test_a_straight_wall_is_hardly_ever_broken_however_noisy(noise: float) -> None:
    broken = sum(
        find_bend(wall(0.0, np.random.default_rng(seed), noise), 0, 40, SIGNIFICANCE) >= 0
        for seed in range(300)
    )
    assert broken <= 3


def test_few_points_are_never_broken() -> None:
    points = wall(0.5, np.random.default_rng(0), noise=0.0)
    middle = len(points) // 2
    first = middle - LEAST_POINTS + 1
    assert find_bend(points, first, first + 2 * LEAST_POINTS - 2, SIGNIFICANCE) == -1
    assert find_bend(points, first, first + 2 * LEAST_POINTS - 1, SIGNIFICANCE) == middle


@pytest.mark.parametrize("turn", [0.3, 2.0, -2.5])
def test_bends_move_with_the_world(turn: float) -> None:
    points = wall(np.radians(5.0), np.random.default_rng(3))
    cos, sin = np.cos(turn), np.sin(turn)
    matrix, shift = np.array(((cos, -sin), (sin, cos))), np.array((7.0, -4.0))
    moved = points @ matrix.T + shift
    last = len(points) - 1
    here = find_bend(points, 0, last, SIGNIFICANCE)
    assert here == find_bend(moved, 0, last, SIGNIFICANCE) > 0
