"""The lasers that logs were made with: where their beams point, and where they sit."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Poses
from albot_core.sensing.reading import LaserGeometry

NO_RETURN = 30.0
"""Ranges at and beyond this (m) are taken for none: a SICK LMS sees no farther, and writes
81.83 and above where nothing came back."""

SICK_SPACINGS = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5}
"""Degrees between the beams of a SICK LMS that sweeps 180°, by their number."""

_MOUNT_PLAY = 0.01
"""How far (m, rad) a recorded laser may seem to stray from its place on the robot."""

_MOUNT_DIGITS = 4
"""Digits after the point (m, rad) to which the rounded poses of a log tell a mount."""


def sick_laser(
    beams: int,
    max_range: float = NO_RETURN,
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> LaserGeometry:
    """The SICK laser with one of the numbers of beams in `SICK_SPACINGS`, from -90° on."""
    spacing = float(np.deg2rad(SICK_SPACINGS[beams]))
    return LaserGeometry(beams=beams, spacing=spacing, max_range=max_range, mount=mount)


def steady_mount(robot: Poses, laser: Poses) -> tuple[float, float, float] | None:
    """The laser's pose in the robot's frame, from the poses of both at every scan.

    None where it does not keep still: then the two are not one body's, but two estimates.
    """
    mounts = relative(robot, laser)
    # Seen from the first, so that no heading lies where angles wrap.
    middle = compose(mounts[0], np.median(relative(mounts[0], mounts), axis=0))
    if (np.abs(relative(middle, mounts)) > _MOUNT_PLAY).any():
        return None
    x, y, heading = np.round(middle, _MOUNT_DIGITS) + 0.0
    return float(x), float(y), float(heading)
