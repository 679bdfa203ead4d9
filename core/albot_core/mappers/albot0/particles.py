"""A particle filter: the poses where the robot may be.

Monte Carlo localisation with a likelihood field (S. Thrun, W. Burgard and D. Fox, Probabilistic
Robotics, 2005, sections 6.4 and 8.3): each particle is a pose, moved by the odometer's motion, and
weighed by the distances of its echoes from known echoes.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.segment_kernels import crosses
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot0.echo_field import CELL, EchoField

_HEADINGS = 36
"""Number of bins by which the likeliest heading is found…"""
_WINDOW = 9
"""…and the number of bins, an odd one, that are taken together…"""
_ONE_MODE = math.radians(60.0)
"""…of which all particles whose headings differ by no more than this (rad) are one mode."""
_LEAST = 1e-12
"""Minimum weight of a particle, as a share of the greatest weight."""


class Particles:
    """Poses where the robot may be, with their weights.

    Attributes:
        poses: (particles, 3): the poses (m, m, rad). Headings are not wrapped.
        weights: (particles,): their weights, which sum to 1.
        has_modes: Whether the particles may have headings of several modes (see `relocalise`).

    Args:
        pose: The initial pose of all particles.
        count: Number of particles.
        rng: Generator of their errors.
    """

    def __init__(self, pose: Pose, count: int, rng: np.random.Generator) -> None:
        self.poses: Float64[np.ndarray, "particles 3"] = np.repeat(pose[None], count, axis=0)
        self.weights: Float64[np.ndarray, "particles"] = np.full(count, 1.0 / count)
        self.has_modes = False
        self._rng = rng

    def move(self, motion: Pose, drift: float, turned: float, slip: float) -> None:
        """Move all particles, each with errors of its own.

        The mean of the errors is subtracted, because the mean of a few draws would mislead the
        robot.

        Args:
            motion: The robot's motion by the odometer.
            drift: Standard deviation of the heading's error after one metre (rad/√m).
            turned: Standard deviation of the heading's error after one radian of turn (rad/√rad).
            slip: Standard deviation of the position's error after one metre (m/√m).
        """
        x, y, turn = motion.tolist()
        gone = math.hypot(x, y)
        heading = math.sqrt(drift**2 * gone + turned**2 * abs(turn))
        errors = self._rng.standard_normal(self.poses.shape)
        spread = slip * math.sqrt(gone)
        _move(self.poses, self.weights, errors, x, y, turn, spread, heading)

    def weigh_moves(
        self, before: Float64[np.ndarray, "particles 3"], surfaces: Segments, factor: float
    ) -> None:
        """Reduce the weight of the particles that moved through a surface.

        Args:
            before: The poses before the move.
            surfaces: The surfaces (m).
            factor: Factor of the weight of these particles.
        """
        _weigh_moves(before, self.poses, self.weights, surfaces, factor)

    def weigh(self, points: Points, field: EchoField, spread: float, alike: float) -> None:
        """Weigh the particles by the distances of echoes, seen from them, to known echoes.

        Args:
            points: The origins of the echoes, in the robot's frame (m).
            field: The known echoes.
            spread: Standard deviation of a point's distance from the nearest known echo (m).
            alike: Number of points that carry as much information as one independent point.
        """
        scale = 0.5 / (alike * (100.0 * spread) ** 2)
        _weigh(self.poses, self.weights, points, field.corner, field.squares, scale)

    def resample(self) -> Int64[np.ndarray, "particles"]:
        """Resample the particles if few of them have most of the weight.

        Returns the indices of the particles drawn; each index once if there was no resampling.
        """
        count = len(self.weights)
        if np.square(self.weights).sum() * count < 2.0:
            return np.arange(count)
        return self.draw()

    def draw(self) -> Int64[np.ndarray, "particles"]:
        """Draw the particles anew by their weights; return the indices of those drawn."""
        chosen = self.drawn(len(self.weights))
        self.poses = self.poses[chosen]
        self.weights = np.full(len(chosen), 1.0 / len(chosen))
        return chosen

    def drawn(self, count: int) -> Int64[np.ndarray, "drawn"]:
        """Return the indices of particles drawn by their weights (low-variance sampling)."""
        places = (self._rng.random() + np.arange(count)) / count
        chosen = np.searchsorted(np.cumsum(self.weights), places)
        return np.asarray(np.minimum(chosen, len(self.weights) - 1))

    @property
    def likeliest(self) -> Float64[np.ndarray, "particles"]:
        """The weights of the likeliest mode: of particles with about the same heading.

        They sum to 1; those of all other particles are 0. There is one mode unless the odometer's
        frame was lost (see `relocalise`).
        """
        if not self.has_modes:
            return self.weights
        headings = self.poses[:, 2]
        bins = np.floor(headings / (2 * np.pi) * _HEADINGS).astype(np.int64) % _HEADINGS
        shares = np.bincount(bins, self.weights, minlength=_HEADINGS)
        half = _WINDOW // 2
        around = sum(np.roll(shares, shift) for shift in range(-half, half + 1))
        middle = (int(np.argmax(around)) + 0.5) * 2 * np.pi / _HEADINGS
        is_near = np.abs(wrap_angle(headings - middle)) <= _ONE_MODE
        weights = np.where(is_near, self.weights, 0.0)
        return np.asarray(weights / weights.sum())

    @property
    def mean(self) -> Pose:
        """The mean pose of the likeliest mode."""
        if not self.has_modes:
            return np.asarray(np.einsum("k,ki->i", self.weights, self.poses))
        weights = self.likeliest
        reference = self.poses[weights.argmax(), 2]
        off = wrap_angle(self.poses[:, 2] - reference)
        x, y = weights @ self.poses[:, :2]
        return np.array((x, y, reference + weights @ off))


@kernel()
def _move(
    poses: np.ndarray,
    weights: np.ndarray,
    errors: np.ndarray,
    x: float,
    y: float,
    turn: float,
    spread: float,
    heading: float,
) -> None:
    """Move particles; the standard deviations are `spread` (m) and `heading` (rad)."""
    means = (0.0, 0.0, 0.0)
    for k in range(poses.shape[0]):
        means = (
            means[0] + weights[k] * errors[k, 0],
            means[1] + weights[k] * errors[k, 1],
            means[2] + weights[k] * errors[k, 2],
        )
    for k in range(poses.shape[0]):
        # The robot first errs in its heading, then moves.
        direction = poses[k, 2] + heading * (errors[k, 2] - means[2])
        cos, sin = math.cos(direction), math.sin(direction)
        poses[k, 0] += cos * x - sin * y + spread * (errors[k, 0] - means[0])
        poses[k, 1] += sin * x + cos * y + spread * (errors[k, 1] - means[1])
        poses[k, 2] = direction + turn


@kernel(arrays=True)
def _weigh_moves(
    before: np.ndarray, poses: np.ndarray, weights: np.ndarray, surfaces: np.ndarray, factor: float
) -> None:
    """Weigh the particles as `Particles.weigh_moves` does."""
    least, most = np.full(2, math.inf), np.full(2, -math.inf)
    for k in range(poses.shape[0]):
        for axis in range(2):
            least[axis] = min(least[axis], before[k, axis], poses[k, axis])
            most[axis] = max(most[axis], before[k, axis], poses[k, axis])
    went_through = np.zeros(poses.shape[0], np.bool_)
    for i in range(surfaces.shape[0]):
        x, y, u, v = surfaces[i]
        if max(x, u) < least[0] or min(x, u) > most[0]:
            continue
        if max(y, v) < least[1] or min(y, v) > most[1]:
            continue
        for k in range(poses.shape[0]):
            way = before[k, 0], before[k, 1], poses[k, 0], poses[k, 1]
            went_through[k] |= crosses((x, y, u, v), way)
    for k in range(poses.shape[0]):
        if went_through[k]:
            weights[k] *= factor
    _normalise(weights)


@kernel(arrays=True)
def _weigh(
    poses: np.ndarray,
    weights: np.ndarray,
    points: np.ndarray,
    corner: np.ndarray,
    squares: np.ndarray,
    scale: float,
) -> None:
    """Weigh the particles as `Particles.weigh` does; `scale` is the factor of squares (cm²)."""
    sums = sum_squares(poses, points, corner, squares)
    least = sums.min()
    for k in range(poses.shape[0]):
        # The best value is subtracted in the exponent.
        weights[k] *= math.exp(scale * (least - sums[k]))
    _normalise(weights)


@kernel(arrays=True)
def _normalise(weights: np.ndarray) -> None:
    """Scale the weights to the sum 1, none of them 0."""
    least, total = _LEAST * weights.max(), 0.0
    for k in range(weights.shape[0]):
        weights[k] = max(weights[k], least)
        total += weights[k]
    for k in range(weights.shape[0]):
        weights[k] /= total


@kernel(arrays=True)
def sum_squares(
    poses: np.ndarray, points: np.ndarray, corner: np.ndarray, squares: np.ndarray
) -> np.ndarray:
    """Return, for each pose, the sum of squared distances from points to their nearest echo (cm²).

    Args:
        poses: (poses, 3): from which the points are seen.
        points: (points, 2): in the frame of each pose (m).
        corner: The corner of the field (see `EchoField`).
        squares: The squares of the field (see `EchoField`).
    """
    sums = np.zeros(poses.shape[0], np.int64)
    cells, rows = squares.reshape(-1), np.int32(squares.shape[1])
    last_column, last_row = squares.shape[0] - 1.0, squares.shape[1] - 1.0
    ahead, left = points[:, 0].copy(), points[:, 1].copy()
    for k in range(poses.shape[0]):
        cos, sin = math.cos(poses[k, 2]) / CELL, math.sin(poses[k, 2]) / CELL
        x, y = (poses[k, 0] - corner[0]) / CELL, (poses[k, 1] - corner[1]) / CELL
        total = np.int32(0)
        # Without a branch, and with numbers of one size, several points are looked up at once.
        for i in range(ahead.shape[0]):
            column = min(max(x + cos * ahead[i] - sin * left[i], 0.0), last_column)
            row = min(max(y + sin * ahead[i] + cos * left[i], 0.0), last_row)
            total += cells[np.int32(column) * rows + np.int32(row)]
        sums[k] = total
    return sums
