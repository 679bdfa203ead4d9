"""Compiled arithmetic of the two wheels."""

from __future__ import annotations

import math

import numpy as np

from albot_core.kernels.compiled import kernel


@kernel()
def wheels_for(
    speed: float, turn_rate: float, top_speed: float, top_turn_rate: float, wheel_base: float
) -> tuple[float, float]:
    """The wheel speeds left, right for a (v, ω) command, both slowed down alike where too fast."""
    speed = min(max(speed, -top_speed), top_speed)
    half = min(max(turn_rate, -top_turn_rate), top_turn_rate) * wheel_base / 2
    excess = max(1.0, (abs(speed) + abs(half)) / top_speed)
    return (speed - half) / excess, (speed + half) / excess


@kernel()
def aim(
    commands: np.ndarray,
    top_speed: float,
    top_turn_rate: float,
    wheel_base: float,
    targets: np.ndarray,
) -> None:
    """Fill `targets` (n, 2) with the wheel speeds for commands (n, 2) of v (m/s) and ω (rad/s)."""
    for i in range(commands.shape[0]):
        speed, turn_rate = commands[i, 0], commands[i, 1]
        left, right = wheels_for(speed, turn_rate, top_speed, top_turn_rate, wheel_base)
        targets[i, 0], targets[i, 1] = left, right


@kernel()
def ramped(
    left: float, right: float, to_left: float, to_right: float, possible: float
) -> tuple[float, float]:
    """The wheel speeds, changed in proportion and by at most `possible` (m/s) towards others."""
    change = max(abs(to_left - left), abs(to_right - right))
    if change <= possible:
        return to_left, to_right
    share = possible / change
    return left + share * (to_left - left), right + share * (to_right - right)


@kernel()
def chord(heading: float, turn: float) -> tuple[float, float]:
    """Direction of an arc's chord, and its length over the arc's.

    The arc sets out at a heading and turns so far (rad).
    """
    half = turn / 2
    return heading + half, math.sin(half) / half if half else 1.0
