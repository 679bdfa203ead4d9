"""How far the odometer is off: learnt from the log at hand as views are matched. Compiled.

This is ours. The thesis supposes a turn that is right to 5°. How large the errors really are
differs between robots and floors. So what a match says of the last turn is held against what the
odometer said, and the running mean square of the difference tells how much a turn costs that
departs from the odometer's; of the translation, in the same way, how firmly it holds the pose. An
odometer that has never reported any motion counts as missing. Without an odometer the robot is
expected to make the same translation, in its own frame, as between the last two views that were
surely matched. The farther it has moved of late, the more loosely this holds the pose.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import relative_pose
from albot_core.matching.lines import wrap

TURN, HAS_MOVED, LAST_X, LAST_Y, SHIFT = 0, 1, 2, 3, 4
"""Places in a robot's row: mean square error of a turn (rad²), 1 once the odometer has reported a
motion, the last translation by the views (m; the frame of the view before), and the mean square
error of a translation along each axis (m²); without an odometer half the mean square length of the
translation."""
UNSIGNED = [TURN, HAS_MOVED, SHIFT]
"""Those that are never below 0."""
ROW = 5
"""Length of a robot's row."""
FIRST_TURN_ERROR = np.radians(5.0)
"""Error (rad) of an odometer of which nothing is known yet, root mean square."""
FIRST_SHIFT_ERROR = 0.05
"""Likewise for a translation along each axis (m)."""
FIRST_TRANSLATION = 0.5
"""Translation between two views (m) of a robot without an odometer of which nothing is known yet,
root mean square along each axis."""
STILL = 1e-9
"""A motion up to this (m, rad) is none but for rounding."""
MEMORY = 30.0
"""Errors are averaged over about so many views."""
SHIFT_SCALE = 2.0
"""The odometer's translation is held on a scale of so many times its errors of late."""


def unknown_odometer() -> np.ndarray:
    """A robot's row (ROW,) before its first view."""
    row = np.zeros(ROW)
    row[TURN] = FIRST_TURN_ERROR**2
    row[SHIFT] = FIRST_TRANSLATION**2
    return row


@kernel()
def turn_scale(odometer: np.ndarray, limits: Albot1Limits) -> float:
    """The scale (rad) on which a turn costs votes that departs from the odometer's."""
    return float(max(limits.turn_scale * np.sqrt(odometer[TURN]), limits.turn_cost))


@kernel()
def shift_scale(odometer: np.ndarray, limits: Albot1Limits) -> float:
    """The standard deviation (m) by which the expected translation holds the pose."""
    return float(max(SHIFT_SCALE * np.sqrt(odometer[SHIFT]), limits.motion_error))


@kernel()
def note_motion(odometer: np.ndarray, motion: np.ndarray) -> None:
    """Note whether the odometer has ever reported a motion; its translations' error starts then."""
    if odometer[HAS_MOVED] > 0.0:
        return
    if abs(motion[0]) > STILL or abs(motion[1]) > STILL or abs(motion[2]) > STILL:
        odometer[HAS_MOVED] = 1.0
        odometer[SHIFT] = FIRST_SHIFT_ERROR**2


_moved = scratch(3)


@kernel()
def learn_error(
    odometer: np.ndarray,
    previous: np.ndarray,
    motion: np.ndarray,
    current: np.ndarray,
    is_sure: bool,
    was_misread: bool,
) -> None:
    """Learn from where the views led, from one pose to another, and the odometer's `motion`.

    Nothing is learnt of a match that is not sure. If the previous view `was_misread`, nor is where
    the robot goes on to: one such view must not send it on in a wrong direction.
    """
    if not is_sure:
        return
    moved = _moved()
    relative_pose(previous, current, moved)
    if not was_misread:
        odometer[LAST_X], odometer[LAST_Y] = moved[0], moved[1]
    off = wrap(moved[2] - motion[2])
    odometer[TURN] += (off * off - odometer[TURN]) / MEMORY
    dx, dy = moved[0] - motion[0], moved[1] - motion[1]
    odometer[SHIFT] += (0.5 * (dx * dx + dy * dy) - odometer[SHIFT]) / MEMORY
