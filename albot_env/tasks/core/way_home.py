"""The true way home: geodesic distances to the start, and success weighted by path length."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.planning.any_angle_search import FAR, first_anchor
from albot_env.tasks.core.row_arrays import Arrays, put_rows
from albot_maps import World
from albot_maps.geodesic import DistanceField

KEPT = 256
"""Maximum number of cached fields; the least recently used one is dropped first."""


class DistanceFields(NamedTuple):
    """Geodesic distances home for all robots, one row per robot (see `albot_maps.geodesic`)."""

    anchor_of: np.ndarray
    """(n, points) int32."""
    anchors: np.ndarray
    """(n, most, 4) float64."""
    shapes: np.ndarray
    """(n, 2) int64: number of columns, and of points per column."""
    corners: np.ndarray
    """(n, 3) float64: position x, y of the first point, and cell size (m)."""


@kernel()
def update_way_home(i: int, x: float, y: float, fields: DistanceFields, stats: Any) -> None:
    """Update robot i's geodesic distance home from x, y (world frame, m), and its next turn.

    The result goes into `distances` and `turns` of `stats`. Both stay unchanged if no grid point
    is near, because the robot is pushed into a corner.
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
def is_home(pose: np.ndarray, start: np.ndarray, radius: float) -> bool:
    """Return whether a robot is within `radius` (m) of its start, on a straight line."""
    return bool(length_of(pose[0] - start[0], pose[1] - start[1]) <= radius)


@kernel()
def judge_way_home(
    success: bool, left: float, longest: float, driven: float, at_home: float
) -> tuple[float, float]:
    """Return success weighted by path length, and the same with the share of the way covered.

    Args:
        success: Whether the robot has come home.
        left: Geodesic distance home (m).
        longest: That distance where the way home began (m).
        driven: Path length since then (m).
        at_home: The share covered if the way home began at home.
    """
    covered = at_home
    if longest > 0.0:
        covered = min(1.0, max(0.0, 1.0 - left / longest))
    spl = success_weighted(1.0 if success else 0.0, longest, driven)
    return spl, success_weighted(covered, longest, driven)


@kernel()
def success_weighted(success: float, geodesic: float, driven: float) -> float:
    """Return success weighted by path length: success × geodesic / max(geodesic, driven).

    Source: Anderson et al., On Evaluation of Embodied Navigation Agents, 2018, section 3. If both
    lengths are 0, the result is `success`.
    """
    longest = max(geodesic, driven)
    return success if longest <= 0.0 else success * (geodesic / longest)


def empty_fields(robots: int) -> DistanceFields:
    """Return the fields of `robots` robots that have no home yet."""
    return DistanceFields(
        anchor_of=np.zeros((robots, 0), np.int32),
        anchors=np.zeros((robots, 0, 4)),
        shapes=np.zeros((robots, 2), np.int64),
        corners=np.ones((robots, 3)),
    )


def with_field(fields: DistanceFields, row: int, field: DistanceField) -> DistanceFields:
    """Return the fields with one robot's row replaced; larger arrays are made only if needed."""
    fields = _with_room(fields, len(field.anchor_of), len(field.anchors))
    fields.anchor_of[row, : len(field.anchor_of)] = field.anchor_of
    fields.anchors[row, : len(field.anchors)] = field.anchors
    fields.shapes[row] = field.columns, field.rows
    fields.corners[row] = *field.corner, field.cell
    return fields


def with_field_rows(fields: DistanceFields, row: int, arrays: Arrays) -> DistanceFields:
    """Return the fields with one robot's row replaced by what `FieldCopies.of` returned."""
    fields = _with_room(fields, len(arrays["field.anchor_of"]), len(arrays["field.anchors"]))
    put_rows("field", fields, row, arrays)
    return fields


def _with_room(fields: DistanceFields, points: int, anchors: int) -> DistanceFields:
    """Return the fields with room for so many points and anchors per robot."""
    if points > fields.anchor_of.shape[1]:
        wider = np.zeros((len(fields.shapes), points), np.int32)
        wider[:, : fields.anchor_of.shape[1]] = fields.anchor_of
        fields = fields._replace(anchor_of=wider)
    if anchors > fields.anchors.shape[1]:
        more = np.zeros((len(fields.shapes), 2 * anchors, 4))
        more[:, : fields.anchors.shape[1]] = fields.anchors
        fields = fields._replace(anchors=more)
    return fields


class FieldCopies:
    """Copies of robots' fields for their states; all states of an episode share one.

    Args:
        robots: Number of robots.
    """

    def __init__(self, robots: int) -> None:
        self._copies: list[Arrays] = [{}] * robots

    def of(self, fields: DistanceFields, row: int) -> Arrays:
        """Return one robot's field as read-only arrays by name."""
        anchor_of = fields.anchor_of[row, : int(fields.shapes[row].prod())]
        rows = {
            "field.shapes": fields.shapes[row],
            "field.corners": fields.corners[row],
            "field.anchor_of": anchor_of,
            "field.anchors": fields.anchors[row, : int(anchor_of.max(initial=FAR)) + 1],
        }
        kept = self._copies[row]
        if not kept or any(not np.array_equal(kept[name], own) for name, own in rows.items()):
            kept = self._copies[row] = {name: own.copy() for name, own in rows.items()}
            for array in kept.values():
                array.flags.writeable = False
        return kept


class DistanceFieldCache:
    """Makes the distance fields of start positions, and caches the most recently used."""

    def __init__(self) -> None:
        # The world is kept beside its field, so that its id stays unique.
        self._kept: OrderedDict[tuple[int, bytes], tuple[World, DistanceField]] = OrderedDict()

    def find(self, world: World, start: Pose) -> DistanceField:
        """Return the geodesic distances to a start from everywhere in its world."""
        key = (id(world), start.tobytes())
        if key not in self._kept:
            field = DistanceField(world.walls, world.robot_radius, start[:2])
            if math.isinf(field.distance(start[:2])):
                field = DistanceField(world.walls, world.robot_radius, start[:2], tight=True)
            self._kept[key] = world, field
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key][1]
