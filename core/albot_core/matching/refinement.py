"""Gradient refinement of a matched pose, from the grid of poses to below a cell.

The score is the sum of the points' likelihoods, as in `correlation`. The field is interpolated by
cubics between cells, as by Hess et al. (ICRA 2016); linear interpolation would be flat between two
cells at equal distances from a wall. The likelihood of a point at a distance d from its surface is
exp(-d² / 2σ²), so the score is a robust estimate with Welsch's function. A Gauss-Newton step weighs
each point by its likelihood (iteratively reweighted least squares), and lets it move along the
normal of its surface only, as in A. Censi, An ICP variant using a point-to-line metric, ICRA 2008.
A step that lowers the score is repeated with more damping (Levenberg-Marquardt).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel, scratch
from albot_core.matching.likelihood_field import CERTAIN, LikelihoodField

_ITERATIONS = 12
_LEAST_STEP = 1e-5
"""The search ends after a step shorter than this (m, rad)."""
_DAMPING, _MOST_DAMPING = 1e-3, 1e4

_six = scratch(6)
_three = scratch(3)
_four = scratch(4)


class Refinement(NamedTuple):
    """A pose at which the score has a maximum."""

    pose: Pose
    """The pose."""
    response: float
    """The mean likelihood of the points, within [0, 1]."""
    information: Float64[np.ndarray, "3 3"]
    """Curvature of the maximum without the prior: the inverse of the pose's covariance if the
    points were independent (1/m², 1/m, 1/rad²)."""


def refine(
    field: LikelihoodField,
    points: Float64[np.ndarray, "points 2"],
    normals: Float64[np.ndarray, "points 2"],
    start: Pose,
    guess: Pose,
    prior: Float64[np.ndarray, "3"],
) -> Refinement:
    """Find the maximum of the score uphill from a pose.

    Args:
        field: The likelihood field.
        points: The scan's points in the robot's frame (m).
        normals: The unit surface normals at the points; (0, 0) where unknown.
        start: The pose at which the search begins.
        guess: The odometer's pose.
        prior: As in `correlate`.
    """
    pose, information = np.empty(3), np.empty((3, 3))
    response = climb(
        field.finest,
        field.corner,
        field.config.cell,
        field.config.sigma,
        points,
        normals,
        start,
        guess,
        prior,
        pose,
        information,
    )
    return Refinement(pose, response, information)


@kernel()
def climb(
    finest: np.ndarray,
    corner: np.ndarray,
    cell: float,
    sigma: float,
    points: np.ndarray,
    normals: np.ndarray,
    start: np.ndarray,
    guess: np.ndarray,
    prior: np.ndarray,
    pose: np.ndarray,
    information: np.ndarray,
) -> float:
    """Run `refine` on arrays; fill in `pose` and `information`, return the response."""
    gradient, matrix, tried = _three(), _six(), _three()
    next_gradient, next_matrix = _three(), _six()
    for a in range(3):
        pose[a] = start[a]
    field = (finest, corner, cell, sigma)
    scan = (points, normals)
    score: float = _score_at(field, scan, pose, guess, prior, gradient, matrix)
    damping = _DAMPING
    for _ in range(_ITERATIONS):
        dx, dy, turn = _solve(matrix, prior, gradient, damping)
        tried[0], tried[1], tried[2] = pose[0] + dx, pose[1] + dy, pose[2] + turn
        reached = _score_at(field, scan, tried, guess, prior, next_gradient, next_matrix)
        if reached < score:
            damping *= 10.0
            if damping > _MOST_DAMPING:
                break
            continue
        score, damping = reached, max(0.1 * damping, 1e-9)
        for a in range(3):
            pose[a], gradient[a] = tried[a], next_gradient[a]
        for a in range(6):
            matrix[a] = next_matrix[a]
        if max(abs(dx), abs(dy), abs(turn)) < _LEAST_STEP:
            break
    information[0, 0], information[1, 1], information[2, 2] = matrix[0], matrix[3], matrix[5]
    information[0, 1] = information[1, 0] = matrix[1]
    information[0, 2] = information[2, 0] = matrix[2]
    information[1, 2] = information[2, 1] = matrix[4]
    x, y, turn = pose[0] - guess[0], pose[1] - guess[1], pose[2] - guess[2]
    score += float(prior[0] * x * x + prior[1] * y * y + prior[2] * turn * turn)
    return score / max(len(points), 1)


@kernel()
def _score_at(
    field: tuple[np.ndarray, np.ndarray, float, float],
    scan: tuple[np.ndarray, np.ndarray],
    pose: np.ndarray,
    guess: np.ndarray,
    prior: np.ndarray,
    gradient: np.ndarray,
    matrix: np.ndarray,
) -> float:
    """Return the score at a pose; fill in its gradient and its upper Gauss-Newton matrix."""
    finest, corner, cell, sigma = field
    points, normals = scan
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    side = len(finest)
    u, du, v, dv = _four(), _four(), _four(), _four()
    score = 0.0
    for a in range(3):
        gradient[a] = 0.0
    for a in range(6):
        matrix[a] = 0.0
    for k in range(len(points)):
        # From the robot to the point, in the field's frame; a turn moves it by (-dy, dx).
        dx = cos * points[k, 0] - sin * points[k, 1]
        dy = sin * points[k, 0] + cos * points[k, 1]
        column = (pose[0] + dx - corner[0]) / cell - 0.5
        row = (pose[1] + dy - corner[1]) / cell - 0.5
        if not (1.0 <= column < side - 2 and 1.0 <= row < side - 2):
            continue
        c, r = int(column), int(row)
        _weigh(column - c, u, du)
        _weigh(row - r, v, dv)
        likelihood = gx = gy = 0.0
        for i in range(4):
            along = slope = 0.0
            for j in range(4):
                value = float(finest[r - 1 + i, c - 1 + j])
                along += u[j] * value
                slope += du[j] * value
            likelihood += v[i] * along
            gx += v[i] * slope
            gy += dv[i] * along
        if likelihood <= 0.0:
            continue
        likelihood, gx, gy = likelihood / CERTAIN, gx / (CERTAIN * cell), gy / (CERTAIN * cell)
        score += likelihood
        gradient[0] += gx
        gradient[1] += gy
        gradient[2] += gy * dx - gx * dy
        weight = likelihood / (sigma * sigma)
        nx = cos * normals[k, 0] - sin * normals[k, 1]
        ny = sin * normals[k, 0] + cos * normals[k, 1]
        if nx == 0.0 and ny == 0.0:
            # Unknown normal: half the information in every direction.
            xx, xy, yy = 0.5, 0.0, 0.5
        else:
            xx, xy, yy = nx * nx, nx * ny, ny * ny
        tx, ty = -dy, dx
        matrix[0] += weight * xx
        matrix[1] += weight * xy
        matrix[2] += weight * (xx * tx + xy * ty)
        matrix[3] += weight * yy
        matrix[4] += weight * (xy * tx + yy * ty)
        matrix[5] += weight * (xx * tx * tx + 2.0 * xy * tx * ty + yy * ty * ty)
    for a in range(3):
        off = pose[a] - guess[a]
        score -= prior[a] * off * off
        gradient[a] -= 2.0 * prior[a] * off
    return score


@kernel()
def _weigh(t: float, weights: np.ndarray, slopes: np.ndarray) -> None:
    """Fill in the weights of four values in a row, and the weights' derivatives.

    They interpolate at t of the way between the middle two values, by a cubic whose slopes there
    are those of the lines between the neighbours (Catmull-Rom).
    """
    weights[0] = 0.5 * t * (t * (2.0 - t) - 1.0)
    weights[1] = 0.5 * (t * t * (3.0 * t - 5.0) + 2.0)
    weights[2] = 0.5 * t * (t * (4.0 - 3.0 * t) + 1.0)
    weights[3] = 0.5 * t * t * (t - 1.0)
    slopes[0] = 0.5 * (t * (4.0 - 3.0 * t) - 1.0)
    slopes[1] = 0.5 * t * (9.0 * t - 10.0)
    slopes[2] = 0.5 * (t * (8.0 - 9.0 * t) + 1.0)
    slopes[3] = 0.5 * t * (3.0 * t - 2.0)


@kernel()
def _solve(
    matrix: np.ndarray, prior: np.ndarray, gradient: np.ndarray, damping: float
) -> tuple[float, float, float]:
    """Return the step that solves the damped equations, by a Cholesky decomposition."""
    grown = 1.0 + damping
    a = (matrix[0] + 2.0 * prior[0]) * grown + 1e-9
    b, c = matrix[1], matrix[2]
    d = (matrix[3] + 2.0 * prior[1]) * grown + 1e-9
    e = matrix[4]
    f = (matrix[5] + 2.0 * prior[2]) * grown + 1e-9
    l11 = math.sqrt(a)
    l21, l31 = b / l11, c / l11
    l22 = math.sqrt(max(d - l21 * l21, 1e-12))
    l32 = (e - l31 * l21) / l22
    l33 = math.sqrt(max(f - l31 * l31 - l32 * l32, 1e-12))
    y1 = gradient[0] / l11
    y2 = (gradient[1] - l21 * y1) / l22
    y3 = (gradient[2] - l31 * y1 - l32 * y2) / l33
    turn = y3 / l33
    y = (y2 - l32 * turn) / l22
    return (y1 - l21 * y - l31 * turn) / l11, y, turn
