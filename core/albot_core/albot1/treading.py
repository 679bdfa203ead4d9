"""Treading on the trail, and following it home."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.albot1.network import PlaceNetwork
from albot_core.albot1.trail import AHEAD, REACH, SAME, can_go_straight
from albot_core.geometry.poses import compose, inverse, relative, transform_points
from albot_core.geometry.types import Points, Pose, Segments


def tread(network: PlaceNetwork, pose: Pose, view: Segments) -> None:
    """The robot has gone a stride farther, or turned to look elsewhere.

    Args:
        network: The network of places, with the trail.
        pose: Where the robot is in the map.
        view: The surfaces in view, in its own frame (m).
    """
    trail = network.trail
    trail.tread(network.current, relative(network.frame, pose)[:2])
    away = _in_sight(_trodden(network), pose, view)
    seen = np.flatnonzero(np.isfinite(away))
    trail.sees(seen, away[seen])


def waypoint_home(network: PlaceNetwork, pose: Pose, view: Segments) -> Points | None:
    """The point some metres (AHEAD) farther on the trail home, in the map's frame (m).

    None where home is nearer, or no trail leads there. The arguments are as for `tread`.
    """
    trodden = _trodden(network)
    before = pose[:2]
    away = np.hypot(*(trodden - before).T)
    own = network.trail.places == network.current
    # It sets out from points of this place, from those that it stands on, and those it sees.
    near = np.where(own & (away < REACH) | (away < SAME), away, np.inf)
    near = np.minimum(near, _in_sight(trodden, pose, view))
    if not np.isfinite(near).any():
        near = np.where(own if own.any() else np.ones_like(own), away, np.inf)
    ahead = AHEAD
    for k in network.trail.way(near):
        ahead -= float(np.hypot(*(trodden[k] - before)))
        before = trodden[k]
        if ahead <= 0:
            return np.asarray(before)
    return None


def _trodden(network: PlaceNetwork) -> Float64[np.ndarray, "points 2"]:
    """The points of the trail, in the map's frame as it is now (m)."""
    trail = network.trail
    points = np.empty_like(trail.points)
    for place in np.unique(trail.places).tolist():
        own = trail.places == place
        frame = compose(network.displacement, network.sites[place].frame)
        points[own] = transform_points(frame, trail.points[own])
    return points


def _in_sight(
    trodden: Float64[np.ndarray, "points 2"], pose: Pose, view: Segments
) -> Float64[np.ndarray, "points"]:
    """How far away the points are that the robot could go to straight (m); others infinity."""
    points = transform_points(inverse(pose), trodden)
    clear = np.empty(len(points), np.bool_)
    can_go_straight(view, len(view), points, clear)
    return np.where(clear, np.hypot(*points.T), np.inf)
