"""The kernels of the drive: acceleration of the wheels, and the arc that they roll."""

from __future__ import annotations

import math

from albot_core.kernels.compiled import kernel

GRAVITY = 9.81


@kernel()
def ramped(
    left: float, right: float, to_left: float, to_right: float, possible: float
) -> tuple[float, float]:
    """Return the wheel speeds after a change towards the targets of at most `possible` (m/s).

    Both wheels change in proportion, so that a turn on the spot stays a turn on the spot.
    """
    change = max(abs(to_left - left), abs(to_right - right))
    if change <= possible:
        return to_left, to_right
    share = possible / change
    return left + share * (to_left - left), right + share * (to_right - right)


@kernel()
def chord(heading: float, turn: float) -> tuple[float, float]:
    """Return the direction of an arc's chord (rad) and the ratio of chord length to arc length.

    The arc starts at `heading` (rad) and turns by `turn` (rad).
    """
    half = turn / 2
    return heading + half, math.sin(half) / half if half else 1.0
