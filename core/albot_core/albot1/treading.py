"""Treading on the trail, and following it home."""

from __future__ import annotations

import numpy as np

from albot_core.albot1.network import PlaceNetwork
from albot_core.albot1.recognition import pose_in
from albot_core.albot1.trail import AHEAD, REACH
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points, Pose, Segments


def tread(network: PlaceNetwork, pose: Pose, view: Segments) -> None:
    """The robot has gone a stride farther, or turned to look elsewhere.

    Args:
        network: The network of places, with the trail.
        pose: Where the robot is in the map.
        view: The surfaces in view, in its own frame (m).
    """
    network.trail.tread(network.current, _enduring(network, pose), view)


def waypoint_home(network: PlaceNetwork, pose: Pose, view: Segments) -> Points | None:
    """The point some metres (AHEAD) farther on the trail home, in the map's frame (m).

    None where home is nearer, or no trail leads there. The arguments are as for `tread`.
    """
    trail, here = network.trail, _enduring(network, pose)
    about = trail.look(network.current, here, view)
    own = trail.places == network.current
    start = np.where(about.can_go | own & (about.away < REACH), about.away, np.inf)
    if not np.isfinite(start).any():
        start = np.where(own if own.any() else np.ones_like(own), about.away, np.inf)
    ahead, before = AHEAD, here[:2]
    for k in trail.way(start):
        ahead -= float(np.hypot(*(trail.points[k] - before)))
        before = trail.points[k]
        if ahead <= 0:
            return transform_points(network.displacement, before)
    return None


def _enduring(network: PlaceNetwork, pose: Pose) -> Pose:
    """A pose of the map in the enduring frame (compiled: it is asked for at every stride)."""
    here = np.empty(3)
    pose_in(network.displacement, pose, here)
    return here
