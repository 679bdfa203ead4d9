"""Motions: x, y (m) and a heading (rad) that is not wrapped."""

from __future__ import annotations

import math

from albot_core.geometry.poses import wrap_angle

Motion = tuple[float, float, float]
"""x, y (m) and unwrapped heading (rad)."""


def after(first: Motion, second: Motion) -> Motion:
    """Return a motion followed by another; headings are added without wrapping."""
    cos, sin = math.cos(first[2]), math.sin(first[2])
    x, y, turn = second
    return first[0] + cos * x - sin * y, first[1] + sin * x + cos * y, first[2] + turn


def before(whole: Motion, last: Motion) -> Motion:
    """Return the motion that, followed by `last`, gives `whole`."""
    heading = whole[2] - last[2]
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = cos * last[0] - sin * last[1], sin * last[0] + cos * last[1]
    return whole[0] - x, whole[1] - y, heading


def beyond(first: Motion, whole: Motion) -> Motion:
    """Return the motion that, after `first`, gives `whole`."""
    cos, sin = math.cos(first[2]), math.sin(first[2])
    x, y = whole[0] - first[0], whole[1] - first[1]
    return cos * x + sin * y, cos * y - sin * x, whole[2] - first[2]


def nearest_turn(turn: float) -> float:
    """Return the same angle within [-pi, pi)."""
    return float(wrap_angle(turn))


def motion_of(numbers: list[float]) -> Motion:
    """Return three numbers as a motion."""
    x, y, heading = numbers
    return x, y, heading
