"""Relocalisation: in which frame the way home lies, if the odometer lost that of the way out.

The paper's robot is turned off between its journeys, so that its two maps lie in different frames,
and it "has no way of aligning them". Its cues need no frame. Our trail does: so the robot compares
the geometry of the way home with that of the way out. Either the odometer kept its frame, or the
way home begins near the end of the way out with any heading. Many poses of both kinds are moved
along the way home so far, and weighed by its echoes (Monte Carlo localisation, as in `particles`).
This is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.albot0.echo_field import EchoField
from albot_core.mappers.albot0.particles import Particles
from albot_core.mappers.albot0.steps import Steps, end_poses
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

_FARTHEST = 0.6
"""All echoes farther than this (m) from any known echo are equally unlikely."""
_COUNT = Range("a whole number from 2 to 1000000", 2.0, 1e6, whole=True)


@dataclass(frozen=True, kw_only=True)
class DoubtConfig:
    """How it is found out whether the odometer's frame was lost where the robot turned round."""

    lost: float = 0.01
    """Probability, before the way home, that the frame was lost: the robot was turned off and moved
    where it was told to return. 0 for a robot that is never turned off."""
    least: float = 0.05
    """The particles go by another frame where the probability that the odometer kept its own falls
    below this."""
    moved: float = 0.4
    """Standard deviation of how far the robot was moved then (m)."""
    way: float = 12.0
    """The frame is in doubt on the first metres of the way home (m)."""
    candidates: int = 4000
    """Number of poses that are compared, half of them in the odometer's frame."""
    alike: float = 6.0
    """Number of echoes that carry as much information as one independent echo. It is less than
    `TrailConfig.alike`, because a whole way is compared, not a step."""

    def __post_init__(self) -> None:
        check_fields(self, SHARE, "lost", "least")
        check_fields(self, NOT_NEGATIVE, "moved")
        check_fields(self, POSITIVE, "way", "alike")
        check_fields(self, _COUNT, "candidates")


class Errors(NamedTuple):
    """The errors of the odometer and of echoes; see `TrailConfig`."""

    drift: float
    turned: float
    slip: float
    spread: float
    through_surface: float


class Relocalised(NamedTuple):
    """Where the way home may lie in the frame of the way out."""

    kept: float
    """The probability that the odometer kept its frame."""
    starts: Int64[np.ndarray, "particles"]
    """At which of the given poses each particle began."""
    paths: Float64[np.ndarray, "steps particles 3"]
    """The particles' poses at the end of each step of the way home."""


def relocalise(
    starts: Poses,
    turned_at: Pose,
    home: Steps,
    out: Steps,
    errors: Errors,
    config: DoubtConfig,
    rng: np.random.Generator,
) -> Relocalised:
    """Find the frame of the way home by its geometry.

    Args:
        starts: The possible poses at the end of the way out, equally likely, in its frame.
        turned_at: The pose there by the odometer.
        home: The steps of the way home so far, at least one, by the odometer.
        out: The steps of the way out, in its frame.
        errors: Standard deviations of errors.
        config: Thresholds.
        rng: Generator of the particles' errors.
    """
    count, half = config.candidates, config.candidates // 2
    field, surfaces = EchoField(out, _FARTHEST, _FARTHEST), out.surfaces
    lengths = np.hypot(*(home.lines[:, 2:] - home.lines[:, :2]).T)
    poses = np.vstack((turned_at, end_poses(home.lines)))
    motions = relative(poses[:-1], poses[1:])

    begun = rng.integers(len(starts), size=count)
    particles = Particles(np.zeros(3), count, rng)
    particles.poses = starts[begun]
    # The first half goes on in the odometer's frame. The other begins anew where the first step
    # begins, with any heading.
    anew = particles.poses[half:].copy()
    anew[:, :2] += config.moved * rng.standard_normal((count - half, 2))
    anew[:, 2] = rng.uniform(-np.pi, np.pi, count - half)
    particles.weights[:half] = (1.0 - config.lost) / half
    particles.weights[half:] = config.lost / (count - half)
    paths = np.empty((len(motions), count, 3))
    for step, (length, motion) in enumerate(zip(lengths.tolist(), motions, strict=True)):
        came_from = particles.poses.copy()
        particles.move(motion, errors.drift, errors.turned, errors.slip)
        if step == 0:
            came_from[half:] = anew
            particles.poses[half:] = compose(anew, np.array((length, 0.0, 0.0)))
        particles.weigh_moves(came_from, surfaces, errors.through_surface)
        seen = home.echoes[step, home.heard[step]] - (length, 0.0)
        particles.weigh(seen, field, errors.spread, config.alike)
        paths[step] = particles.poses
    kept = float(particles.weights[:half].sum())
    chosen = particles.drawn(len(starts))
    return Relocalised(min(kept, 1.0), begun[chosen], paths[:, chosen])
