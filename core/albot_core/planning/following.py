"""Following a way over the sketch, past what is in view and what was."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.pose_kernels import bearings_of
from albot_core.geometry.types import Points
from albot_core.planning.senses import Senses
from albot_core.planning.sketch import Sketch

SIGHT = 3.0
"""The farthest stretch (m) that is driven straight at once (Yeap et al.: 3 m)."""
BEHIND = 1.0
"""How far away (m) things that are out of view are minded."""


def waypoint(
    sketch: Sketch, senses: Senses, route: Float64[np.ndarray, "cells 2"], *, hopeful: bool = False
) -> Points:
    """The farthest point of a route that can be gone to straight (m, map frame)."""
    if not len(route):
        return senses.pose[:2]
    return sketch.along(senses.pose, route, SIGHT, hopeful=hopeful)


def things_around(sketch: Sketch, senses: Senses) -> Float64[np.ndarray, "points 2"]:
    """What is in view, and what was seen near by but lies behind now (m, robot's frame)."""
    known = senses.to_robot(sketch.obstacles(senses.pose, BEHIND))
    bearings = bearings_of(known)
    first, last = senses.laser.bearings[[0, -1]] + senses.laser.mount[2]
    behind = (bearings < first) | (bearings > last)
    return np.concatenate((senses.points, known[behind]))
