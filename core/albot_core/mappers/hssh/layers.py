"""The preferred map in the form that renderers, recordings and exports use."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, inverse, relative, transform_segments
from albot_core.geometry.types import Pose
from albot_core.mappers.hssh.layout import gateways_of
from albot_core.mappers.hssh.topological_map import TopologicalMap
from albot_core.mappers.hssh.visits import Visits
from albot_core.maps.layers import PlaceEdge, PlaceGraph, PlaceNode


def place_graph(
    leaf: TopologicalMap | None, visits: Visits, frames: Float64[np.ndarray, "visits 3"]
) -> PlaceGraph:
    """Return places, and the paths between their gateways, laid out by the first visits.

    A place's frame is the middle of its ground, along the odometry of its first visit. Its line
    segments are its gateways.

    Args:
        leaf: The map; None before the first reading.
        visits: What was perceived.
        frames: The pose of each visit's odometry frame in the map's frame.
    """
    if leaf is None:
        return PlaceGraph()
    counts = np.bincount([visit.place for visit in leaf.visits], minlength=leaf.places).tolist()
    lines = gateways_of(visits, leaf, frames)
    poses: list[Pose] = []
    nodes = []
    for place, first in enumerate(leaf.firsts):
        visit = visits[first]
        pose = compose(frames[first], np.array((*visit.middle, 0.0)))
        poses.append(pose)
        nodes.append(
            PlaceNode(
                id=place,
                label=f"P{place}",
                pose=pose,
                middle=pose[:2],
                segments=transform_segments(inverse(pose), lines[place]),
                visits=counts[place],
            )
        )
    edges = []
    for number, (one, other) in enumerate(leaf.edges()):
        for k, (source, target) in enumerate(((one, other), (other, one))):
            edges.append(
                PlaceEdge(
                    source=source[0],
                    target=target[0],
                    motion=relative(poses[source[0]], poses[target[0]]),
                    doorway=nodes[source[0]].segments[source[1]],
                    reverse=2 * number + 1 - k,
                )
            )
    return PlaceGraph(nodes=tuple(nodes), edges=tuple(edges), current=leaf.here.place, home=0)
