"""The earlier readings that were taken where the robot is now, and how sure that is.

This is ours. The thesis decides whether a place is known; these numbers say on what ground, so that
others can decide anew.
"""

from __future__ import annotations

import numpy as np

from albot_core.geometry.pose_kernels import transform_point
from albot_core.geometry.poses import transform_points
from albot_core.geometry.segment_kernels import distance_to_segment
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.mapper import PlaceMatches

NEAR = 0.3
"""A point of a surface in view is where the place has a surface if that is no farther away (m)."""
SAMPLES = 5
"""Number of points of each surface in view that are compared."""


def match_place(network: PlaceNetwork, pose: Pose, view: Segments, most: int) -> PlaceMatches:
    """Return the earlier stays in the present place, by their readings nearest to the robot.

    Args:
        network: The network of places.
        pose: The robot's pose in the map.
        view: The surfaces in view (robot's frame, m).
        most: Maximum number of matches.

    Returns:
        The matches, the nearest first; none in a place that is not known from before. The score
        is the share of the surfaces in view that the description of the place has, which knows
        nothing of the present stay. The probability is that of the comparison by which the place
        was recognised in this stay, and 1 where the robot came in through a known exit. The
        ambiguity is the highest probability of another place with which it was compared.
    """
    crumbs = network.breadcrumbs
    first = network.stays[-1][0]
    earlier = np.flatnonzero((crumbs.places == network.current) & (crumbs.readings < first))
    if not network.is_familiar or not len(earlier):
        return np.empty((0, 6))
    points = transform_points(network.map_to_graph, crumbs.points[earlier])
    away = np.hypot(*(points - pose[:2]).T)
    begins = np.array([stay for stay, _ in network.stays])
    stays = np.searchsorted(begins, crumbs.readings[earlier], side="right")
    order = np.argsort(away, kind="stable")
    _, nearest = np.unique(stays[order], return_index=True)
    chosen = order[np.sort(nearest)][:most]
    score = share_explained(view, pose, network.frame, network.here.surfaces)
    probability, ambiguity = _probabilities(network)
    matches = np.empty((len(chosen), 6))
    matches[:, :3] = score, probability, ambiguity
    matches[:, 3:5] = points[chosen]
    matches[:, 5] = crumbs.readings[earlier][chosen]
    return matches


def _probabilities(network: PlaceNetwork) -> tuple[float, float]:
    """Return the probability that the present place is the one believed, and that of a rival."""
    probability, rival = 1.0, 0.0
    for event in reversed(network.log.events):
        if event.kind == EventKind.RECOGNIZED:
            probability = event.probability or event.share
        elif event.kind == EventKind.REFUSED:
            rival = max(rival, event.probability)
        elif event.kind != EventKind.FOLLOWED:
            break
    return probability, rival


@kernel()
def share_explained(
    view: np.ndarray, pose: np.ndarray, frame: np.ndarray, surfaces: np.ndarray
) -> float:
    """Return the share of the length of surfaces in view that lie on surfaces of a place.

    Args:
        view: The surfaces in view (n, 4; robot's frame, m).
        pose: The robot's pose (map).
        frame: Pose of the place's frame (map).
        surfaces: The place's surfaces (m, 4; place's frame, m).
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turn, slope = np.cos(frame[2]), np.sin(frame[2])
    whole = explained = 0.0
    for k in range(view.shape[0]):
        dx, dy = view[k, 2] - view[k, 0], view[k, 3] - view[k, 1]
        length, hits = np.sqrt(dx * dx + dy * dy), 0
        for j in range(SAMPLES):
            share = (j + 0.5) / SAMPLES
            x, y = transform_point(pose, cos, sin, view[k, 0] + share * dx, view[k, 1] + share * dy)
            east, north = x - frame[0], y - frame[1]
            x, y = turn * east + slope * north, turn * north - slope * east
            for i in range(surfaces.shape[0]):
                s = surfaces[i]
                if distance_to_segment(x, y, s[0], s[1], s[2], s[3]) <= NEAR:
                    hits += 1
                    break
        whole += length
        explained += length * hits / SAMPLES
    return explained / whole if whole > 0.0 else 0.0
