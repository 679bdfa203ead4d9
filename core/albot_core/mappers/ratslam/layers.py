"""Experience map and pose cells in the form that renderers, recordings and exports use."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.poses import wrap_angle
from albot_core.mappers.ratslam.experiences import ExperienceMap
from albot_core.mappers.ratslam.motions import nearest_turn
from albot_core.mappers.ratslam.pose_cells import PoseCells
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, TrajectoryLayer


def map_layers(
    experiences: ExperienceMap, visits: Int64[np.ndarray, "visits"], current: int
) -> MapSnapshot:
    """Return experiences and transitions, and the trajectory over them in order of time.

    Args:
        experiences: The map.
        visits: The experiences that the robot was in, in order.
        current: The experience that it is in now.
    """
    if not experiences.count:
        return MapSnapshot(layers=(PlaceGraph(), TrajectoryLayer(poses=np.empty((0, 3)))))
    poses = experiences.poses.copy()
    poses[:, 2] = wrap_angle(poses[:, 2])
    entered = visits[np.flatnonzero(np.diff(visits, prepend=-1))]
    stays = np.bincount(entered, minlength=len(poses)).tolist()
    nodes = tuple(
        PlaceNode(id=k, label=f"E{k}", pose=pose, middle=pose[:2], visits=stays[k])
        for k, pose in enumerate(poses)
    )
    links = experiences.links
    ends = list(zip(links.rows("source").tolist(), links.rows("target").tolist(), strict=True))
    number = {pair: k for k, pair in enumerate(ends)}
    motions = links.rows("motion").copy()
    motions[:, 2] = wrap_angle(motions[:, 2])
    # The correction gives each transition this share of its rate, in all directions alike.
    shares = links.rows("stiffness").tolist()
    times = links.rows("time").tolist()
    edges = tuple(
        PlaceEdge(
            source=one,
            target=other,
            motion=motion,
            reverse=number.get((other, one)),
            information=share * np.eye(3),
            time=time,
        )
        for (one, other), motion, share, time in zip(ends, motions, shares, times, strict=True)
    )
    graph = PlaceGraph(nodes=nodes, edges=edges, current=current, home=0)
    return MapSnapshot(layers=(graph, TrajectoryLayer(poses=poses[visits])))


def network_activity(cells: PoseCells) -> Activity:
    """Return the activity of the pose cells over (x', y'), the largest over θ'.

    Activity is drawn at the nearest fixed cell, up to half a cell from where it is.
    """
    (columns, rows, _), config, packet = cells.shape, cells.config, cells.packet
    values = np.zeros((rows, columns), np.float32)
    places = cells.cells % (columns * rows)
    np.maximum.at(values.ravel(), places, cells.activity.astype(np.float32))
    x, y = (packet.x + 0.5) * config.cell, (packet.y + 0.5) * config.cell
    pose = np.array((x, y, nearest_turn(packet.heading * config.cell_turn)))
    return Activity(cell=config.cell, values=values, packet=pose)
