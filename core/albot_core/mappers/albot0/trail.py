"""The way that the robot came, as it knows it best, and where it now is.

The paper's maps are never corrected, and neither are ours: ASRs are told apart, and compared, by
the odometer alone. But its robot is not told how to drive home, and ours could not by the odometer:
after 100 m two visits to one place lie metres apart. So beside the paper's maps the robot keeps its
way as it is most likely by odometer and echoes together. This is ours.

A particle filter looks for the robot among what it heard some metres before. Each particle
remembers its way (as in D. Hähnel, W. Burgard, D. Fox and S. Thrun, An efficient FastSLAM algorithm
for generating maps of large-scale cyclic environments from raw laser range measurements, 2003), so
that the ways of those that are left tell where the robot was, too. Unlike there they share one map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.poses import compose, inverse, relative
from albot_core.geometry.types import Poses, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot0.echo_field import EchoField
from albot_core.mappers.albot0.particles import Particles
from albot_core.mappers.albot0.paths import FARTHEST
from albot_core.mappers.albot0.state import all_steps
from albot_core.mappers.albot0.steps import NO_STEPS, Steps, join_steps
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.stored import Stored
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

_PARTICLES = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)
_REMEMBERED = Range("a whole number from 1 to 1000", 1.0, 1e3, whole=True)
_LIMIT = Range("a number within (0, 10]", 0.0, 10.0, beyond=True)
"""The limits of an echo field (m): sums of their squares stay within 32 bits."""
_AROUND = 8.0
"""Echoes of steps that are farther away than this (m) are not heard from where the robot is."""
_SUM = 1e-6
"""By so much the sum of all weights may be off 1."""


@dataclass(frozen=True, kw_only=True)
class TrailConfig:
    """How the robot is looked for on the way that it came."""

    particles: int = 400
    """How many ways are kept, 100,000 at most."""
    drift: float = 0.025
    """Standard deviation of the odometer's error of heading after one metre (rad/√m)…"""
    turned: float = 0.03
    """…and after one radian of turn (rad/√rad)."""
    slip: float = 0.04
    """Standard deviation of its error of place after one metre (m/√m)."""
    spread: float = 0.2
    """Standard deviation of an echo's distance from the nearest one heard before (m)."""
    farthest: float = 0.4
    """Where the sound went freely before, echoes farther than this (m) from any are as unlikely as
    each other…"""
    unknown: float = 0.3
    """…and those farther than this (m), where it did not go."""
    alike: float = 10.0
    """So many echoes tell as much as one. Those of one sonar within a metre mostly come from one
    surface."""
    through_surface: float = 0.2
    """Factor of the weight of a particle that moved through a surface. It is not 0: surfaces are
    inexact, and small gaps in them are closed."""
    recent: float = 5.0
    """What was heard within the last metres (m) is left out: it errs as the robot does."""
    remembered: int = 40
    """How many steps of its way each particle remembers, 1000 at most. What lies before them stays
    as it is."""

    def __post_init__(self) -> None:
        check_fields(self, _PARTICLES, "particles")
        check_fields(self, _REMEMBERED, "remembered")
        check_fields(self, NOT_NEGATIVE, "drift", "turned", "slip", "recent")
        check_fields(self, POSITIVE, "spread", "alike", "through_surface")
        check_fields(self, _LIMIT, "farthest", "unknown")


def _check_trail(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the trail's steps are as long as the odometer has them."""
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
    """The way that the robot came, and its pose at the end of it.

    Attributes:
        steps: The way as it is most likely.
        particles: Where the robot may be at the end of it.
        frame: Where the trail's frame lies in the odometer's.

    Args:
        config: How the robot is looked for.
        rng: What draws the particles' errors.
    """

    SCHEMA = Schema(
        Field("trail.lines", "trail 4", at=None, least=-2 * FARTHEST, most=2 * FARTHEST),
        Field(
            "trail.past", "remembered particles 3", at=None, least=-2 * FARTHEST, most=2 * FARTHEST
        ),
        Field("trail.drawn", "remembered particles", int, at=None, least=0, below="particles"),
        Field("trail.weights", "particles", at="particles.weights", above=0),
        rules=(_check_trail,),
    )

    def __init__(self, config: TrailConfig, rng: np.random.Generator) -> None:
        self._config = config
        self.steps = NO_STEPS
        self.particles = Particles(np.zeros(3), config.particles, rng)
        self.frame = np.zeros(3)
        self._latest = np.zeros(3)
        # Where the particles were at the end of each step, and which of them were drawn there. The
        # latest step takes the row of the oldest.
        self._past = np.empty((config.remembered, config.particles, 3))
        self._drawn = np.empty((config.remembered, config.particles), np.int64)

    def extend(self, steps: Steps) -> None:
        """Follow the robot along its next steps, which lie as the odometer has them."""
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
        self._latest = poses[-1]
        self.steps = join_steps(self.steps, steps)
        self._lay_out()

    def _heard_before(self) -> Steps:
        """The steps from which the robot may hear what it heard on them, but the latest."""
        lines = self.steps.lines
        if not len(lines):
            return self.steps
        left = np.cumsum(np.hypot(*(lines[:, 2:] - lines[:, :2]).T)[::-1])[::-1]
        away = np.hypot(*(lines[:, 2:] - self.particles.mean[:2]).T)
        return self.steps.part((left > self._config.recent) & (away < _AROUND))

    def _lay_out(self) -> None:
        """Lay the latest steps where the particles that are left have them in the mean."""
        rows = self._rows(len(self.steps.lines))
        # The steps' lines are in no other hands yet: they were joined a moment ago.
        latest = self.steps.lines[-len(rows) :]
        _lay_along(latest, self._past, self._drawn, rows, self.particles.weights)
        self.frame = compose(self._latest, inverse(self.particles.mean))

    def _rows(self, steps: int) -> Int64[np.ndarray, "remembered"]:
        """The rows of the steps that are remembered of so many, from the oldest on."""
        remembered = self._config.remembered
        return np.arange(max(steps - remembered, 0), steps) % remembered

    def _sizes(self) -> dict[str, Any]:
        config = self._config
        return {"particles": config.particles, "most_remembered": config.remembered}

    def _stored(self) -> dict[str, np.ndarray]:
        # What the steps, as the odometer has them, do not tell.
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


def end_poses(lines: Segments) -> Poses:
    """The poses at the ends of steps, in the directions in which they lead."""
    ways = lines[:, 2:] - lines[:, :2]
    return np.column_stack((lines[:, 2:], np.arctan2(ways[:, 1], ways[:, 0])))


@kernel(arrays=True)
def _lay_along(
    lines: np.ndarray, past: np.ndarray, drawn: np.ndarray, rows: np.ndarray, weights: np.ndarray
) -> None:
    """Lay steps where the particles that are left have them in the mean.

    Args:
        lines: (steps, 4): the steps, from the oldest on; they keep their lengths (m).
        past: (remembered, particles, 3): where all particles were at the end of each step.
        drawn: (remembered, particles): which were drawn there.
        rows: (steps,): the rows of the steps in these.
        weights: Weights of the particles that are left.
    """
    shares, earlier = weights.copy(), np.empty_like(weights)
    for step in range(rows.shape[0] - 1, -1, -1):
        # A particle has the weights of all that were drawn from it.
        row = rows[step]
        earlier[:] = 0.0
        for k in range(shares.shape[0]):
            earlier[drawn[row, k]] += shares[k]
        shares, earlier = earlier, shares
        east = north = heading = 0.0
        for k in range(shares.shape[0]):
            east += shares[k] * past[row, k, 0]
            north += shares[k] * past[row, k, 1]
            heading += shares[k] * past[row, k, 2]
        x, y, to_x, to_y = lines[step]
        length = math.hypot(to_x - x, to_y - y)
        lines[step, 0], lines[step, 2] = east - length * math.cos(heading), east
        lines[step, 1], lines[step, 3] = north - length * math.sin(heading), north
