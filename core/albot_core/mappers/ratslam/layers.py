"""The experience map as layers, for renderers, recordings and exports."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.poses import wrap_angle
from albot_core.mappers.ratslam.experiences import ExperienceMap
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, TrajectoryLayer


def map_layers(
    experiences: ExperienceMap, visits: Int64[np.ndarray, "visits"], current: int
) -> MapSnapshot:
    """The experiences and transitions, and the way over them in the order of time.

    Args:
        experiences: The map.
        visits: The experiences that the robot has been in, in order.
        current: That in which it is now.
    """
    if not experiences.count:
        return MapSnapshot(layers=(PlaceGraph(), TrajectoryLayer(poses=np.empty((0, 3)))))
    poses = experiences.poses.copy()
    poses[:, 2] = wrap_angle(poses[:, 2])
    nodes = tuple(
        PlaceNode(id=k, label=f"E{k}", pose=pose, middle=pose[:2]) for k, pose in enumerate(poses)
    )
    links = experiences.links
    ends = list(zip(links.rows("source").tolist(), links.rows("target").tolist(), strict=True))
    number = {pair: k for k, pair in enumerate(ends)}
    motions = links.rows("motion").copy()
    motions[:, 2] = wrap_angle(motions[:, 2])
    edges = tuple(
        PlaceEdge(source=one, target=other, motion=motion, reverse=number.get((other, one)))
        for (one, other), motion in zip(ends, motions, strict=True)
    )
    graph = PlaceGraph(nodes=nodes, edges=edges, current=current, home=0)
    return MapSnapshot(layers=(graph, TrajectoryLayer(poses=poses[visits])))
