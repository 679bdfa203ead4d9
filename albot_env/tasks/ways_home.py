"""The true ways home of robots, as the compiled loops take them."""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np

from albot_core.geometry.types import Pose
from albot_env.tasks.homing_kernel import Fields
from albot_maps import ROBOT_RADIUS, World
from albot_maps.geodesic import DistanceField

KEPT = 256
"""Fields that are kept; the one that was longest not asked for is made again."""


def no_fields(robots: int) -> Fields:
    """The fields of so many robots that have no home yet."""
    return Fields(
        anchor_of=np.zeros((robots, 0), np.int32),
        anchors=np.zeros((robots, 0, 4)),
        shapes=np.zeros((robots, 2), np.int64),
        corners=np.ones((robots, 3)),
    )


def with_field(fields: Fields, row: int, field: DistanceField) -> Fields:
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


class HomeFields:
    """Makes the fields of ways to where robots set out, and keeps the last of them."""

    def __init__(self) -> None:
        # The world is kept beside its field: so long no other one has its id.
        self._kept: OrderedDict[tuple[int, bytes], tuple[World, DistanceField]] = OrderedDict()

    def find(self, world: World, start: Pose) -> DistanceField:
        """How far it is to a start from everywhere in its world."""
        key = (id(world), start.tobytes())
        if key not in self._kept:
            self._kept[key] = world, _field_from(world, start)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key][1]


def _field_from(world: World, start: Pose) -> DistanceField:
    field = DistanceField(world.walls, ROBOT_RADIUS, start[:2])
    if math.isinf(field.distance(start[:2])):
        return DistanceField(world.walls, ROBOT_RADIUS, start[:2], tight=True)
    return field
