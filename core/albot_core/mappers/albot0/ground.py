"""The ground seen beside the robot's way, cut into faces whose areas can be added.

The swaths of a wandering robot overlap. A region's area is that of the union of its swaths, and
splitting a journey compares very many regions. So overlapping swaths are cut into faces once, as
they are added: the area of any region is then the sum over its faces, each counted once.
"""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float64, Int64
from shapely.errors import GEOSException

from albot_core.geometry.poses import inverse, transform_points

_SLIVER = 0.01
"""Faces smaller than this (m²) are left out, because sonar widths are less accurate. The areas of
the parts of a cut may also differ from that of the whole by at most this."""
_GRID = 1e-3
"""Where edges almost coincide, swaths are cut on a grid of this spacing (m). Without a grid shapely
finds no result there, or a wrong one without an error."""
_INSET = 2e-3
"""A swath is shrunk by this share of its size before it is tested which faces it overlaps."""
_POLYGONAL = (3, 6)
"""shapely's type ids of polygons and multipolygons."""


class Ground:
    """The union of swaths, as faces.

    Attributes:
        count: Number of swaths.
    """

    def __init__(self) -> None:
        self.count = 0
        self._frame = np.zeros(3)
        self._faces: list[Any] = []
        self._boxes = np.empty((64, 4))
        self._areas = np.empty(64)
        self._covers: list[list[int]] = []
        # The part of each swath that no earlier swath covers. Every face lies in one of these
        # parts.
        self._rests: list[Any] = []

    def add(self, swaths: Float64[np.ndarray, "swaths corners 2"]) -> None:
        """Add the next swaths, polygons that may cross themselves (m)."""
        if not len(swaths):
            return
        if not self.count:
            edge = swaths[0, 1] - swaths[0, 0]
            self._frame = inverse(np.array((*swaths[0, 0], np.arctan2(edge[1], edge[0]))))
        # The grid is aligned with the first swath, so that areas do not depend on the journey's
        # frame.
        swaths = transform_points(self._frame, swaths)
        # Consecutive steps touch: a swath that reaches no farther into a face does not cut it.
        inner = swaths + _INSET * (swaths.mean(axis=1, keepdims=True) - swaths)
        shapes, inner_shapes = shapely.make_valid(shapely.polygons(swaths)), shapely.polygons(inner)
        boxes = np.hstack((inner.min(axis=1), inner.max(axis=1)))
        shapely.prepare(shapes)
        for shape, inner_shape, box in zip(shapes, inner_shapes, boxes, strict=True):
            rest, number = _polygonal(shape), self.count
            self.count += 1
            others = self._boxes[: len(self._faces)]
            is_near = (others[:, :2] < box[2:]) & (others[:, 2:] > box[:2])
            near = np.flatnonzero(is_near[:, 0] & is_near[:, 1])
            if len(near):
                faces = np.array([self._faces[face] for face in near.tolist()], object)
                reaches_in = shapely.intersects(inner_shape, faces)
                if reaches_in.any():
                    rest = self._cut(near[reaches_in], faces[reaches_in], rest, number)
            self._rests.append(rest)
            if rest.area > _SLIVER:
                self._add_face(rest, [number])

    def _cut(self, near: Int64[np.ndarray, "some"], faces: Any, swath: Any, number: int) -> Any:
        """Cut faces along a swath; return the part of the swath that covers none of them."""
        first = {self._covers[face][0] for face in near.tolist()}
        known = [self._rests[each] for each in sorted(first)]
        common, outside, rest = _overlay(faces, self._areas[near], known, swath)
        for face, inside, left_over in zip(near.tolist(), common, outside, strict=True):
            if left_over is not None:
                self._set_face(face, _polygonal(left_over))
                self._add_face(_polygonal(inside), [*self._covers[face], number])
            elif inside is not None:
                self._covers[face].append(number)
        return _polygonal(rest)

    @property
    def index(
        self,
    ) -> tuple[
        Int64[np.ndarray, "swaths_and_1"], Int64[np.ndarray, "pairs"], Float64[np.ndarray, "faces"]
    ]:
        """The start of each swath's faces in the second array; these faces; all areas (m²)."""
        counts = np.fromiter(map(len, self._covers), np.int64, len(self._covers))
        swaths = np.fromiter(chain.from_iterable(self._covers), np.int64, counts.sum())
        faces = np.repeat(np.arange(len(counts)), counts)[np.argsort(swaths, kind="stable")]
        starts = np.zeros(self.count + 1, np.int64)
        np.cumsum(np.bincount(swaths, minlength=self.count), out=starts[1:])
        return starts, faces, self._areas[: len(counts)].copy()

    def _add_face(self, face: Any, cover: list[int]) -> None:
        self._faces.append(face)
        self._covers.append(cover)
        if len(self._faces) > len(self._boxes):
            self._boxes = np.concatenate((self._boxes, np.empty_like(self._boxes)))
            self._areas = np.concatenate((self._areas, np.empty_like(self._areas)))
        self._set_face(len(self._faces) - 1, face)

    def _set_face(self, index: int, face: Any) -> None:
        self._faces[index] = face
        self._boxes[index] = face.bounds
        self._areas[index] = face.area


def _overlay(
    faces: Any,
    areas: Float64[np.ndarray, "faces"],
    known: Any,
    swath: Any,
    grid: float | None = None,
) -> tuple[Any, Any, Any]:
    """Overlay a swath on faces, first without a grid, which is several times as fast.

    Args:
        faces: The faces that the swath overlaps.
        areas: The areas of the faces (m²).
        known: Fewer shapes, whose union covers at least these faces.
        swath: The swath.
        grid: Spacing of the grid (m); None for no grid.

    Returns:
        The part of each face inside the swath, None if it is a sliver; the part of each face
        outside the swath, None if the face is not cut; and the rest of the swath.
    """
    try:
        common, is_within = faces.copy(), shapely.contains(swath, faces)
        common[~is_within] = shapely.intersection(faces[~is_within], swath, grid_size=grid)
        shared = np.where(is_within, areas, shapely.area(common))
        is_cut = (shared > _SLIVER) & (areas - shared > _SLIVER)
        outside = np.full(len(faces), None)
        outside[is_cut] = shapely.difference(faces[is_cut], swath, grid_size=grid)
        union = known[0] if len(known) == 1 else shapely.union_all(known, grid_size=grid)
        rest = shapely.difference(swath, union, grid_size=grid)
    except GEOSException:
        if grid is not None:
            raise
        return _overlay(faces, areas, known, swath, _GRID)
    misfit = np.abs(shared + shapely.area(outside) - areas)[is_cut].sum()
    misfit += abs(shared.sum() + rest.area - swath.area)
    if grid is None and misfit > _SLIVER:
        return _overlay(faces, areas, known, swath, _GRID)
    common[shared <= _SLIVER] = None
    return common, outside, rest


def _polygonal(shape: Any) -> Any:
    """Return the parts of a shape that have an area, without lines that a cut may leave."""
    if shape.geom_type != "GeometryCollection":
        return shape
    parts = shapely.get_parts(shape)
    kept = parts[np.isin(shapely.get_type_id(parts), _POLYGONAL)]
    return shapely.union_all(kept, grid_size=_GRID)
