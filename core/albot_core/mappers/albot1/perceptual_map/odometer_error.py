"""The odometer's errors, learnt from the log at hand as views are matched. Compiled.

This is ours. The thesis assumes a turn that is right to 5°, but the errors differ between robots
and floors. So the motion between two matched views is compared with the odometer's. The running
mean square of the turns' differences sets the cost of a turn that differs from the odometer's; that
of the translations sets how firmly the odometer's translation holds the pose. An odometer that has
never reported any motion counts as missing. Without an odometer the robot is expected to make the
same translation, in its own frame, as between the last two views with sure matches. The longer its
recent translations were, the more loosely this expectation holds the pose.
"""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.frames import relative_pose
from albot_core.matching.lines import wrap

TURN, HAS_MOVED, LAST_X, LAST_Y, SHIFT = 0, 1, 2, 3, 4
"""Elements of a robot's row: mean square error of a turn (rad²); 1 once the odometer has reported a
motion; the last translation by the views (m; the frame of the previous view); and the mean square
error of a translation along each axis (m²), or, without an odometer, half the mean square length of
the translation."""
UNSIGNED = [TURN, HAS_MOVED, SHIFT]
"""The elements that are never below 0."""
ROW = 5
"""Length of a robot's row."""
FIRST_TURN_ERROR = np.radians(5.0)
"""Initial root mean square error of a turn (rad)."""
FIRST_SHIFT_ERROR = 0.05
"""Initial root mean square error of a translation along each axis (m)."""
FIRST_TRANSLATION = 0.5
"""Initial root mean square translation between two views along each axis, for a robot without an
odometer (m)."""
STILL = 1e-9
"""Motions up to this (m, rad) are rounding errors."""
MEMORY = 30.0
"""Number of views over which errors are averaged, approximately."""
SHIFT_SCALE = 2.0
"""Ratio of the standard deviation of the expected translation to the learnt root mean square
error."""


def unknown_odometer() -> np.ndarray:
    """Return a robot's row (ROW,) before its first view."""
    row = np.zeros(ROW)
    row[TURN] = FIRST_TURN_ERROR**2
    row[SHIFT] = FIRST_TRANSLATION**2
    return row


@kernel()
def turn_scale(odometer: np.ndarray, limits: Albot1Limits) -> float:
    """Return the scale (rad) for the cost of a turn that differs from the odometer's."""
    return float(max(limits.turn_scale * np.sqrt(odometer[TURN]), limits.turn_cost))


@kernel()
def shift_scale(odometer: np.ndarray, limits: Albot1Limits) -> float:
    """Return the standard deviation (m) with which the expected translation holds the pose."""
    return float(max(SHIFT_SCALE * np.sqrt(odometer[SHIFT]), limits.motion_error))


@kernel()
def note_motion(odometer: np.ndarray, motion: np.ndarray) -> None:
    """Record the odometer's first motion, at which its error of translation is reset."""
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
    """Learn from the motion between two matched poses and the odometer's `motion`.

    Nothing is learnt from a match that is not sure. If the previous view `was_misread`, the last
    translation is not updated, so that one such view does not lead the robot in a wrong direction.
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
