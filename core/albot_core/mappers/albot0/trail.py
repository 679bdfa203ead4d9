"""The trail: the robot's most likely past path, and its present pose.

The paper's maps are never corrected, and neither are ours: ASRs are distinguished and compared by
the odometer alone. The paper does not say how its robot drives home, and ours could not do so by
the odometer: after 100 m two visits to one place lie metres apart. So beside the paper's maps the
robot keeps its most likely path by odometer and echoes together. This is ours.

A particle filter localises the robot among the echoes that it heard more than some metres before.
Each particle remembers its path (as in D. Hähnel, W. Burgard, D. Fox and S. Thrun, An efficient
FastSLAM algorithm for generating maps of large-scale cyclic environments from raw laser range
measurements, 2003), so the paths of the surviving particles also show where the robot was. Unlike
in that paper, all particles share one map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.poses import compose, inverse, relative
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot0.echo_field import EchoField
from albot_core.mappers.albot0.particles import Particles
from albot_core.mappers.albot0.paths import FARTHEST
from albot_core.mappers.albot0.relocalisation import DoubtConfig, Errors, relocalise
from albot_core.mappers.albot0.state import all_steps
from albot_core.mappers.albot0.steps import NO_STEPS, Steps, end_poses, join_steps
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.stored import Stored
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

_PARTICLES = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)
_REMEMBERED = Range("a whole number from 1 to 1000", 1.0, 1e3, whole=True)
_LIMIT = Range("a number within (0, 10]", 0.0, 10.0, beyond=True)
"""The limits of an echo field (m): sums of their squares fit into 32 bits."""
_AROUND = 8.0
"""Only echoes of steps nearer than this (m) are expected at the robot's position."""
_SUM = 1e-6
"""Maximum deviation of the sum of all weights from 1."""


@dataclass(frozen=True, kw_only=True)
class TrailConfig:
    """Thresholds of the particle filter that follows the robot's path."""

    particles: int = 400
    """Number of particles, at most 100,000."""
    drift: float = 0.025
    """Standard deviation of the odometer's error of heading after one metre (rad/√m)…"""
    turned: float = 0.03
    """…and after one radian of turn (rad/√rad)."""
    slip: float = 0.04
    """Standard deviation of the odometer's error of position after one metre (m/√m)."""
    spread: float = 0.2
    """Standard deviation of an echo's distance from the nearest one heard before (m)."""
    farthest: float = 0.4
    """Where the sound went freely before, all echoes farther than this (m) from any known echo are
    equally unlikely…"""
    unknown: float = 0.3
    """…and where it did not go, all those farther than this (m)."""
    alike: float = 10.0
    """Number of echoes that carry as much information as one independent echo. The echoes of one
    sonar within a metre mostly come from one surface."""
    through_surface: float = 0.2
    """Factor of the weight of a particle that moved through a surface. It is not 0, because
    surfaces are inexact, and small gaps in them are closed."""
    recent: float = 5.0
    """Echoes heard within the last metres of travel (m) are left out: they share the robot's
    error."""
    remembered: int = 40
    """Number of steps of its path that each particle remembers, at most 1000. Earlier steps are no
    longer changed."""
    doubt: DoubtConfig = field(default_factory=DoubtConfig)
    """How it is found out whether the odometer's frame was lost where the robot turned round."""

    def __post_init__(self) -> None:
        check_fields(self, _PARTICLES, "particles")
        check_fields(self, _REMEMBERED, "remembered")
        check_fields(self, NOT_NEGATIVE, "drift", "turned", "slip", "recent")
        check_fields(self, POSITIVE, "spread", "alike", "through_surface")
        check_fields(self, _LIMIT, "farthest", "unknown")


def _check_trail(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the trail's steps are as long as the odometer's."""
    total = state["trail.weights"].sum()
    refuse_unless(abs(total - 1.0) <= _SUM, "trail.weights", "shares that sum to 1", total)
    remembered = min(sizes["trail"], sizes["most_remembered"])
    expected = f"the last {remembered} steps"
    refuse_unless(sizes["remembered"] == remembered, "trail.past", expected, sizes["remembered"])
    lines, known = state["trail.lines"], all_steps(state).lines
    expected = "lengths as the odometer has them"
    refuse_unless(len(lines) == len(known), "trail.lines", expected, f"{len(lines)} steps")
    one, other = (np.hypot(*(each[:, 2:] - each[:, :2]).T) for each in (lines, known))
    refuse_unless(np.allclose(one, other, rtol=1e-3, atol=1e-3), "trail.lines", expected)


class Trail(Stored):
    """The robot's most likely past path, and its pose at the path's end.

    Attributes:
        steps: The most likely path.
        particles: The possible poses at its end.
        frame: The pose of the trail's frame in the odometer's frame.
        kept: The probability that the odometer kept its frame where the robot was told to return.

    Args:
        config: Thresholds of the particle filter.
        rng: Generator of the particles' errors.
    """

    SCHEMA = Schema(
        Field("trail.lines", "trail 4", at=None, least=-2 * FARTHEST, most=2 * FARTHEST),
        Field(
            "trail.past", "remembered particles 3", at=None, least=-2 * FARTHEST, most=2 * FARTHEST
        ),
        Field("trail.drawn", "remembered particles", int, at=None, least=0, below="particles"),
        Field("trail.weights", "particles", at="particles.weights", above=0),
        Field("trail.starts", "particles 3", least=-2 * FARTHEST, most=2 * FARTHEST),
        Field("trail.turned", "", int, least=0, most="trail"),
        Field("trail.kept", "", at="kept", least=0, most=1),
        Field("trail.has_modes", "", bool, at="particles.has_modes"),
        rules=(_check_trail,),
    )

    def __init__(self, config: TrailConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self.steps = NO_STEPS
        self.particles = Particles(np.zeros(3), config.particles, rng)
        self.frame = np.zeros(3)
        self._latest = np.zeros(3)
        self.kept = 1.0
        # Where the robot was told to turn round: the number of steps before, 0 if it was not; and
        # the possible poses there.
        self._turned = 0
        self._starts = self.particles.poses.copy()
        # The pose there by the odometer, and the steps since then by the odometer.
        self._turned_at = self._latest
        self._home = NO_STEPS
        # The particles' poses at the end of each step, and which of them were drawn there. The
        # latest step uses the row of the oldest.
        self._past = np.empty((config.remembered, config.particles, 3))
        self._drawn = np.empty((config.remembered, config.particles), np.int64)

    def turn_round(self) -> None:
        """Doubt, from now on, whether the odometer goes on in its frame."""
        self._turned, self._turned_at, self._home = len(self.steps.lines), self._latest, NO_STEPS
        if self._turned:
            row = (self._turned - 1) % self._config.remembered
            self._drawn[row] = self._drawn[row, self.particles.draw()]
        self._starts = self.particles.poses.copy()
        self.kept = 1.0

    def extend(self, steps: Steps) -> None:
        """Follow the robot along its next steps, given in the odometer's frame."""
        config, particles, before = self._config, self.particles, self._heard_before()
        field, surfaces = EchoField(before, config.farthest, config.unknown), before.surfaces
        lengths = np.hypot(*(steps.lines[:, 2:] - steps.lines[:, :2]).T)
        poses = np.vstack((self._latest, end_poses(steps.lines)))
        motions = relative(poses[:-1], poses[1:])
        for step, (length, motion) in enumerate(zip(lengths.tolist(), motions, strict=True)):
            came_from = particles.poses.copy()
            particles.move(motion, config.drift, config.turned, config.slip)
            particles.weigh_moves(came_from, surfaces, config.through_surface)
            seen = steps.echoes[step, steps.heard[step]] - (length, 0.0)
            particles.weigh(seen, field, config.spread, config.alike)
            row = (len(self.steps.lines) + step) % config.remembered
            self._past[row] = particles.poses
            self._drawn[row] = particles.resample()
        self.steps = join_steps(self.steps, steps)
        if self._turned:
            self._home = join_steps(self._home, steps)
            self._doubt_frame()
        self._latest = poses[-1]
        self._lay_out()

    def _doubt_frame(self) -> None:
        """Compare the way home with the way out, in the odometer's frame and in others.

        While the frame is in doubt, all of the way home is compared anew at every stop. If another
        frame is likelier, the particles are drawn anew.
        """
        config, home, count = self._config, self._home, len(self._home.lines)
        lengths = np.hypot(*(home.lines[:, 2:] - home.lines[:, :2]).T)
        if not config.doubt.lost or lengths.sum() > config.doubt.way or count >= config.remembered:
            return
        errors = Errors(
            config.drift, config.turned, config.slip, config.spread, config.through_surface
        )
        out = self.steps.part(slice(0, self._turned))
        found = relocalise(
            starts=self._starts,
            turned_at=self._turned_at,
            home=home,
            out=out,
            errors=errors,
            config=config.doubt,
            rng=self._rng,
        )
        self.kept = found.kept
        self.particles.has_modes |= found.kept < config.doubt.least
        if self.particles.has_modes:
            rows = self._rows(len(self.steps.lines))[-count:]
            self._past[rows] = found.paths
            self._drawn[rows] = np.arange(config.particles)
            before = (self._turned - 1) % config.remembered
            self._drawn[before] = self._drawn[before, found.starts]
            self._starts = self._starts[found.starts]
            self.particles.poses = found.paths[-1].copy()
            self.particles.weights = np.full(config.particles, 1.0 / config.particles)

    def _heard_before(self) -> Steps:
        """Return the steps whose echoes the robot may hear again, without the latest steps."""
        lines = self.steps.lines
        if not len(lines):
            return self.steps
        left = np.cumsum(np.hypot(*(lines[:, 2:] - lines[:, :2]).T)[::-1])[::-1]
        away = np.hypot(*(lines[:, 2:] - self.particles.mean[:2]).T)
        return self.steps.part((left > self._config.recent) & (away < _AROUND))

    def _lay_out(self) -> None:
        """Correct the latest steps to the mean paths of the surviving particles."""
        rows = self._rows(len(self.steps.lines))
        # The array of lines was made by the join just before, so nothing else refers to it.
        latest = self.steps.lines[-len(rows) :]
        _lay_along(latest, self._past, self._drawn, rows, self.particles.likeliest)
        self.frame = compose(self._latest, inverse(self.particles.mean))

    def _rows(self, steps: int) -> Int64[np.ndarray, "remembered"]:
        """Return the rows of the steps that are remembered out of `steps`, the oldest first."""
        remembered = self._config.remembered
        return np.arange(max(steps - remembered, 0), steps) % remembered

    def _sizes(self) -> dict[str, Any]:
        config = self._config
        return {"particles": config.particles, "most_remembered": config.remembered}

    def _stored(self) -> dict[str, np.ndarray]:
        # The data that do not follow from the odometer's steps.
        rows = self._rows(len(self.steps.lines))
        return {
            "trail.lines": self.steps.lines,
            "trail.past": self._past[rows],
            "trail.drawn": self._drawn[rows],
        }

    def _restored(self, state: Arrays) -> None:
        steps = all_steps(state)
        self.steps = replace(steps, lines=state["trail.lines"].copy())
        rows = self._rows(len(steps.lines))
        self._past[rows], self._drawn[rows] = state["trail.past"], state["trail.drawn"]
        if len(rows):
            self.particles.poses = self._past[rows[-1], self._drawn[rows[-1]]]
            self._latest = end_poses(steps.lines[-1:])[0]
            self.frame = compose(self._latest, inverse(self.particles.mean))
        if self._turned:
            self._turned_at = end_poses(steps.lines[self._turned - 1 : self._turned])[0]
            self._home = steps.part(slice(self._turned, None))


@kernel(arrays=True)
def _lay_along(
    lines: np.ndarray, past: np.ndarray, drawn: np.ndarray, rows: np.ndarray, weights: np.ndarray
) -> None:
    """Correct steps to the mean paths of the surviving particles.

    Args:
        lines: (steps, 4): the steps, the oldest first; they keep their lengths (m).
        past: (remembered, particles, 3): the poses of all particles at the end of each step.
        drawn: (remembered, particles): the particles drawn there.
        rows: (steps,): the rows of the steps in these arrays.
        weights: Weights of the surviving particles.
    """
    shares, earlier = weights.copy(), np.empty_like(weights)
    for step in range(rows.shape[0] - 1, -1, -1):
        # A particle has the weights of all particles that were drawn from it.
        row = rows[step]
        earlier[:] = 0.0
        for k in range(shares.shape[0]):
            earlier[drawn[row, k]] += shares[k]
        shares, earlier = earlier, shares
        east = north = cos = sin = 0.0
        for k in range(shares.shape[0]):
            east += shares[k] * past[row, k, 0]
            north += shares[k] * past[row, k, 1]
            cos += shares[k] * math.cos(past[row, k, 2])
            sin += shares[k] * math.sin(past[row, k, 2])
        heading = math.atan2(sin, cos)
        x, y, to_x, to_y = lines[step]
        length = math.hypot(to_x - x, to_y - y)
        lines[step, 0], lines[step, 2] = east - length * math.cos(heading), east
        lines[step, 1], lines[step, 3] = north - length * math.sin(heading), north
