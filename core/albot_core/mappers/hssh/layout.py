"""The global metrical level: where the places of a topological map lie."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, transform_segments
from albot_core.mappers.hssh.topological_map import TopologicalMap
from albot_core.mappers.hssh.visits import Visits


def frames_of(visits: Visits, leaf: TopologicalMap) -> Float64[np.ndarray, "visits 3"]:
    """Return the metric layout of a map: the pose of each visit's odometry frame in the map.

    A place lies where the odometry put it at its first visit; a later visit is laid on it. Where
    their gateways do not lie alike, the odometry since the last visit counts (ours).

    Args:
        visits: The visits.
        leaf: The map.
    """
    frames = np.zeros((len(leaf.visits), 3))
    for number, visit in enumerate(leaf.visits):
        first = leaf.firsts[visit.place]
        frames[number] = frames[number - 1] if number else 0.0
        if first != number:
            found = visits.alignment(number, first, leaf.common(number))
            if visits.is_alike(found):
                frames[number] = compose(frames[first], found.pose)
    return frames


def gateways_of(
    visits: Visits, leaf: TopologicalMap, frames: Float64[np.ndarray, "visits 3"]
) -> list[Float64[np.ndarray, "gateways 4"]]:
    """Return the gateways of each place in its order, in the map's frame (m).

    A gateway lies where it was seen first.

    Args:
        visits: The visits.
        leaf: The map.
        frames: Its layout.
    """
    lines = [np.zeros((star.gateways, 4)) for star in leaf.stars]
    for number in range(len(leaf.visits) - 1, -1, -1):
        place, gateways = leaf.visits[number]
        lines[place][list(gateways)] = transform_segments(frames[number], visits[number].gateways)
    return lines
