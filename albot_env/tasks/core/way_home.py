"""The true way home: how far it is from everywhere, and how straight a robot came."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.planning.grid_search import FAR, first_anchor
from albot_maps import ROBOT_RADIUS, World
from albot_maps.geodesic import DistanceField

KEPT = 256
"""Fields that are kept; the one that was longest not asked for is made again."""


class DistanceFields(NamedTuple):
    """The true ways home of all robots, a row each (see `albot_maps.geodesic`)."""

    anchor_of: np.ndarray
    """(n, points) int32."""
    anchors: np.ndarray
    """(n, most, 4) float64."""
    shapes: np.ndarray
    """(n, 2) int64: columns, and points in each."""
    corners: np.ndarray
    """(n, 3) float64: where the first point lies, and the cell (m)."""


@kernel()
def update_way_home(i: int, x: float, y: float, fields: DistanceFields, stats: Any) -> None:
    """Update how far it is home from x, y (world frame, m) for robot i, and where the way turns.

    `stats` has `distances` and `turns`, which stay as they are where no way is near: the robot is
    pushed into a corner.
    """
    corner = fields.corners[i]
    cell = corner[2]
    u, v = (x - corner[0]) / cell, (y - corner[1]) / cell
    columns, rows = fields.shapes[i]
    anchors = fields.anchors[i]
    a = first_anchor(u, v, columns, rows, anchors, fields.anchor_of[i])
    if a == FAR:
        return
    ahead = anchors[a]
    stats.distances[i] = (ahead[2] + length_of(u - ahead[0], v - ahead[1])) * cell
    stats.turns[i, 0] = ahead[0] * cell + corner[0]
    stats.turns[i, 1] = ahead[1] * cell + corner[1]


@kernel()
def success_weighted(success: float, geodesic: float, driven: float) -> float:
    """Success weighted by path length: success × shortest way / the longer of it and that driven.

    Anderson et al., On Evaluation of Embodied Navigation Agents, 2018, section 3. Where
    both are 0, so is the detour.
    """
    longest = max(geodesic, driven)
    return success if longest <= 0.0 else success * (geodesic / longest)


def empty_fields(robots: int) -> DistanceFields:
    """Those of so many robots that have no home yet."""
    return DistanceFields(
        anchor_of=np.zeros((robots, 0), np.int32),
        anchors=np.zeros((robots, 0, 4)),
        shapes=np.zeros((robots, 2), np.int64),
        corners=np.ones((robots, 3)),
    )


def with_field(fields: DistanceFields, row: int, field: DistanceField) -> DistanceFields:
    """The fields with one robot's own in its row; larger arrays only where needed."""
    points, anchors = len(field.anchor_of), len(field.anchors)
    if points > fields.anchor_of.shape[1]:
        wider = np.zeros((len(fields.shapes), points), np.int32)
        wider[:, : fields.anchor_of.shape[1]] = fields.anchor_of
        fields = fields._replace(anchor_of=wider)
    if anchors > fields.anchors.shape[1]:
        more = np.zeros((len(fields.shapes), 2 * anchors, 4))
        more[:, : fields.anchors.shape[1]] = fields.anchors
        fields = fields._replace(anchors=more)
    fields.anchor_of[row, :points] = field.anchor_of
    fields.anchors[row, :anchors] = field.anchors
    fields.shapes[row] = field.columns, field.rows
    fields.corners[row] = *field.corner, field.cell
    return fields


class DistanceFieldCache:
    """Makes the distance fields of where robots set out, and keeps the last of them."""

    def __init__(self) -> None:
        # The world is kept beside its field: so long no other one has its id.
        self._kept: OrderedDict[tuple[int, bytes], tuple[World, DistanceField]] = OrderedDict()

    def find(self, world: World, start: Pose) -> DistanceField:
        """How far it is to a start from everywhere in its world."""
        key = (id(world), start.tobytes())
        if key not in self._kept:
            field = DistanceField(world.walls, ROBOT_RADIUS, start[:2])
            if math.isinf(field.distance(start[:2])):
                field = DistanceField(world.walls, ROBOT_RADIUS, start[:2], tight=True)
            self._kept[key] = world, field
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key][1]
