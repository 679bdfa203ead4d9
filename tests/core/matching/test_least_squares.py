"""A Gauss-Newton step against numpy's least squares over the same residuals."""

from __future__ import annotations

import numpy as np

from albot_core.matching.least_squares import (
    LINE_NOISE,
    LINE_SCALE,
    POINT_NOISE,
    POINT_NOISE_GROWTH,
    POINT_SCALE,
    held,
    pulled_by_line,
    pulled_by_point,
    solved,
    stiff,
)
from albot_core.matching.lines import describe

MOTION, TURN = 400.0, 130.0


def row_of(x1: float, y1: float, x2: float, y2: float) -> np.ndarray:
    row = np.empty(10)
    describe(np.array((x1, y1, x2, y2)), row)
    row[8], row[9] = np.hypot(x1, y1), np.hypot(x2, y2)
    return row


def turned(x: float, y: float, turn: float) -> np.ndarray:
    cos, sin = np.cos(turn), np.sin(turn)
    return np.array((cos * x - sin * y, sin * x + cos * y))


def test_a_step_is_that_of_least_squares() -> None:
    correction = np.array((0.03, -0.02, 0.01))
    cos, sin = np.cos(correction[2]), np.sin(correction[2])
    seen, wall = row_of(2.0, -1.0, 2.1, 1.5), row_of(2.05, -1.4, 2.05, 2.0)
    post, landmark = row_of(3.0, 1.0, 4.0, 1.2), row_of(3.1, 1.05, 4.0, 1.2)
    goal = np.array((0.05, 0.04, 0.0))
    equations = held(correction, (0.05, 0.04), MOTION, TURN)
    equations = pulled_by_line(equations, seen, wall, correction, cos, sin)
    equations = pulled_by_point(equations, 0, post, landmark, correction, cos, sin)

    # Rows of slopes, residuals and weights: what holds the step, both ends, and the point.
    slopes = [np.eye(3)[axis] for axis in range(3)]
    residuals, weights = list(goal - correction), [MOTION, MOTION, TURN]
    for end in range(2):  # Both ends of what is seen lie beside the wall, which runs along +y.
        arm = turned(*seen[2 * end : 2 * end + 2], correction[2])
        off = wall[0] - correction[0] - arm[0]
        slopes.append(np.array((-1.0, 0.0, arm[1])))
        residuals.append(-off)
        weights.append(seen[4] / (1 + (off / LINE_SCALE) ** 2) / LINE_NOISE**2)
    arm = turned(3.0, 1.0, correction[2])
    gap = landmark[:2] - correction[:2] - arm
    noise = POINT_NOISE + POINT_NOISE_GROWTH * np.hypot(3.0, 1.0)
    for axis, slope in enumerate(((1.0, 0.0, -arm[1]), (0.0, 1.0, arm[0]))):
        slopes.append(np.array(slope))
        residuals.append(gap[axis])
        weights.append(1 / (1 + gap @ gap / POINT_SCALE**2) / noise**2)
    roots = np.sqrt(weights)
    step = np.linalg.lstsq(np.array(slopes) * roots[:, None], roots * residuals, rcond=None)[0]
    np.testing.assert_allclose(solved(equations), step, rtol=1e-9, atol=1e-12)


def test_what_nothing_pulls_stays() -> None:
    assert solved(stiff(1.0, 2.0)) == (0.0, 0.0, 0.0)
    back = np.array((0.1, -0.2, 0.05))
    np.testing.assert_allclose(solved(held(back, (0.0, 0.0), MOTION, TURN)), -back)


def test_a_wall_seen_from_behind_pulls_nothing() -> None:
    behind, wall = row_of(2.0, 1.0, 2.0, -1.0), row_of(2.0, -1.0, 2.0, 1.0)
    before = stiff(MOTION, TURN)
    assert pulled_by_line(before, behind, wall, np.zeros(3), 1.0, 0.0) == before
