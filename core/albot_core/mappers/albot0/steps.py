"""Steps: pieces of a journey, each with the ground beside it and the echoes heard on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.types import Poses, Segments
from albot_core.kernels.compiled import kernel

PLACES, SONARS = 6, 8
"""For each step, number of points at which echoes are kept, and maximum number of sonars."""
ECHOES = PLACES * SONARS
"""Maximum number of echoes of each step."""
_FARTHEST_ECHO = 12.0
"""Echoes from farther away (m) are left out, because a sonar's cone is too wide there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Steps:
    """Pieces of robot paths, between which a journey can be split."""

    lines: Segments
    """The robot's position at the beginning and at the end of each step (m)."""
    widths: Float64[np.ndarray, "segments 2"]
    """How far the ground reaches to the left and to the right of each step (m)."""
    walled: Bool[np.ndarray, "segments 2"]
    """Whether a surface is there; if not, there is a gap, and the width is the sonar's range
    limit."""
    begins: Bool[np.ndarray, "segments"]
    """Whether a robot path begins with each step."""
    readings: Int64[np.ndarray, "segments"]
    """The number of each step's first reading."""
    echoes: Float64[np.ndarray, "segments echoes 2"]
    """The origins of the echoes that all sonars heard at points spread evenly along each step, in
    the frame of its line (m); zeros if no echo was heard."""

    def part(self, chosen: slice | Bool[np.ndarray, "segments"]) -> Steps:
        """Return some of the steps."""
        return Steps(
            lines=self.lines[chosen],
            widths=self.widths[chosen],
            walled=self.walled[chosen],
            begins=self.begins[chosen],
            readings=self.readings[chosen],
            echoes=self.echoes[chosen],
        )

    @property
    def swaths(self) -> Float64[np.ndarray, "segments 4 2"]:
        """The corners of the ground beside each step (m)."""
        return _swaths(self.lines, self.widths)

    @cached_property
    def heard(self) -> Bool[np.ndarray, "segments echoes"]:
        """Which of the echoes were heard, and are near enough to be localised."""
        away = np.hypot(self.echoes[..., 0], self.echoes[..., 1])
        return np.asarray((away > 0.0) & (away <= _FARTHEST_ECHO))

    @property
    def surfaces(self) -> Segments:
        """The surfaces beside the steps, those to the left first (m)."""
        swaths = self.swaths
        left = swaths[:, (0, 3)].reshape(-1, 4)[self.walled[:, 0]]
        right = swaths[:, (1, 2)].reshape(-1, 4)[self.walled[:, 1]]
        return np.concatenate((left, right))


def end_poses(lines: Segments) -> Poses:
    """Return the poses at the ends of steps, in the directions in which the steps lead."""
    ways = lines[:, 2:] - lines[:, :2]
    return np.column_stack((lines[:, 2:], np.arctan2(ways[:, 1], ways[:, 0])))


NO_STEPS = Steps(
    lines=np.empty((0, 4)),
    widths=np.empty((0, 2)),
    walled=np.empty((0, 2), np.bool_),
    begins=np.empty(0, np.bool_),
    readings=np.empty(0, np.int64),
    echoes=np.empty((0, ECHOES, 2)),
)
"""The steps of a robot that has gone nowhere."""


def join_steps(one: Steps, other: Steps) -> Steps:
    """Return the steps of one journey followed by those of another."""
    return Steps(
        lines=np.concatenate((one.lines, other.lines)),
        widths=np.concatenate((one.widths, other.widths)),
        walled=np.concatenate((one.walled, other.walled)),
        begins=np.concatenate((one.begins, other.begins)),
        readings=np.concatenate((one.readings, other.readings)),
        echoes=np.concatenate((one.echoes, other.echoes)),
    )


@kernel(arrays=True)
def _swaths(lines: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Return the value of `Steps.swaths`."""
    swaths = np.empty((lines.shape[0], 4, 2))
    for step in range(lines.shape[0]):
        x, y, u, v = lines[step]
        length = math.hypot(u - x, v - y)
        # To the left of the way, as far as the ground reaches there; then to the right.
        for side in range(2):
            away = widths[step, side] * (1.0 - 2.0 * side) / length
            east, north = away * (y - v), away * (u - x)
            swaths[step, side] = x + east, y + north
            swaths[step, 3 - side] = u + east, v + north
    return swaths
