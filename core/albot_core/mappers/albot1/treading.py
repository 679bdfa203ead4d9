"""Treading on the trail, and following it home."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.network import PlaceNetwork
from albot_core.mappers.albot1.recognition import pose_in
from albot_core.mappers.albot1.trail import AHEAD, REACH


def tread(network: PlaceNetwork, pose: Pose, view: Segments) -> None:
    """The robot has gone a stride farther, or turned to look elsewhere.

    Args:
        network: The network of places, with the trail.
        pose: Where the robot is in the map.
        view: The surfaces in view, in its own frame (m).
    """
    network.trail.tread(network.current, _enduring(network, pose), view)


class TrailHome(NamedTuple):
    """The trail home from where the robot is."""

    point: Points
    """The point some metres (AHEAD) farther on it, in the map's frame (m); NaN where home is
    nearer."""
    length: float
    """How long it is (m); infinite where none leads home, or the robot has lost its way."""


def follow_home(network: PlaceNetwork, pose: Pose, view: Segments) -> TrailHome:
    """The trail home. The arguments are as for `tread`."""
    trail, here = network.trail, _enduring(network, pose)
    about = trail.look(network.current, here, view)
    own = trail.places == network.current
    start = np.where(about.can_go | own & (about.away < REACH), about.away, np.inf)
    if not np.isfinite(start).any():
        start = np.where(own if own.any() else np.ones_like(own), about.away, np.inf)
    way = trail.way(start)
    length = np.inf if network.lost_since else way.length
    ahead, before = AHEAD, here[:2].tolist()
    for k in way.points:
        point = trail.points[k].tolist()
        ahead -= math.dist(before, point)
        before = point
        if ahead <= 0:
            return TrailHome(transform_points(network.displacement, trail.points[k]), length)
    return TrailHome(np.full(2, np.nan), length)


def _enduring(network: PlaceNetwork, pose: Pose) -> Pose:
    """A pose of the map in the enduring frame (compiled: it is asked for at every stride)."""
    here = np.empty(3)
    pose_in(network.displacement, pose, here)
    return here
