"""Poses where the robot may be: a particle filter.

Monte Carlo localisation with a likelihood field (S. Thrun, W. Burgard and D. Fox, Probabilistic
Robotics, 2005, sections 6.4 and 8.3): each particle is a pose, moved as the odometer says, and
weighed by how near the echoes heard come to echoes that are known.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.albot0.echo_field import EchoField

_LEAST = 1e-12
"""The least weight of a particle, as a share of the greatest."""


class Particles:
    """Poses where the robot may be, with their weights.

    Attributes:
        poses: The poses (m, m, rad).
        weights: Their weights, which sum to 1.

    Args:
        pose: Where all are at first.
        count: How many there are.
        rng: What draws their errors.
    """

    def __init__(self, pose: Pose, count: int, rng: np.random.Generator) -> None:
        self.poses: Poses = np.repeat(pose[None], count, axis=0)
        self.weights = np.full(count, 1.0 / count)
        self._rng = rng

    def move(self, motion: Pose, drift: float, turned: float, slip: float) -> None:
        """Move all particles, each with errors of its own.

        Args:
            motion: How the odometer has the robot moved.
            drift: Standard deviation of the heading's error after one metre (rad/√m)…
            turned: …and after one radian of turn (rad/√rad).
            slip: Standard deviation of the place's error after one metre (m/√m).
        """
        errors = self._rng.standard_normal(self.poses.shape)
        gone = np.hypot(motion[0], motion[1])
        errors[:, :2] *= slip * np.sqrt(gone)
        errors[:, 2] *= np.sqrt(drift**2 * gone + turned**2 * abs(motion[2]))
        # The robot first errs in its heading, then goes.
        self.poses[:, 2] += errors[:, 2]
        self.poses = compose(self.poses, motion)
        self.poses[:, :2] += errors[:, :2]

    def weigh(self, points: Points, field: EchoField, spread: float, alike: float) -> None:
        """Weigh the particles by how near to known echoes points seen from them are.

        Args:
            points: Where echoes came from, in the robot's frame (m).
            field: The known echoes.
            spread: Standard deviation of a point's distance from the nearest one (m).
            alike: So many points tell as much as one.
        """
        if not len(points):
            return
        misfits = field.misfits(self.poses, points) / spread**2
        total = 0.5 * misfits / alike - np.log(self.weights)
        # The best one is taken off in the exponent, and none is ruled out.
        self.weights = np.exp(total.min() - total)
        self.normalise()

    def normalise(self) -> None:
        """Have the weights sum to 1, none of them 0."""
        weights = np.maximum(self.weights, _LEAST * self.weights.max())
        self.weights = weights / weights.sum()

    def resample(self) -> Int64[np.ndarray, "particles"] | None:
        """Draw the particles anew where few of them have most of the weight (low variance).

        Returns which were drawn; None where all stayed.
        """
        count = len(self.weights)
        if np.square(self.weights).sum() * count < 2.0:
            return None
        drawn = (self._rng.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(self.weights), drawn), count - 1)
        self.poses = self.poses[chosen]
        self.weights = np.full(count, 1.0 / count)
        return chosen

    @property
    def mean(self) -> Pose:
        """The mean pose."""
        return mean_pose(self.poses, self.weights)


def mean_pose(
    poses: Float64[np.ndarray, "*some particles 3"], weights: Float64[np.ndarray, "particles"]
) -> Float64[np.ndarray, "*some 3"]:
    """The weighted mean of poses."""
    places = np.moveaxis(poses[..., :2], -1, 0) @ weights
    heading = np.angle(np.exp(1j * poses[..., 2]) @ weights)
    return np.asarray(np.stack((*places, heading), axis=-1))
