"""The ground that the robot saw beside its way, cut into faces that each have one area.

The swaths of a wandering robot overlap. A region's area is that of the union of its swaths, and a
journey is split by comparing very many regions. So swaths are cut into faces where they overlap,
once, as they come: the area of any region is then the sum over its faces, each counted once.
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
"""Faces smaller than this (m²) are left out: so much a sonar's widths do not tell. By no more than
this may the areas of the parts of a cut be off that of the whole, either."""
_GRID = 1e-3
"""Where edges all but coincide, swaths are cut on a grid of this spacing (m). There shapely without
one finds no answer, or a wrong one without saying so."""
_INSET = 2e-3
"""By this share of its size a swath is made smaller when it is asked which faces it overlaps."""
_POLYGONAL = (3, 6)
"""shapely's type ids of polygons and multipolygons."""


class Ground:
    """The union of swaths, as faces.

    Attributes:
        count: How many swaths there are.
    """

    def __init__(self) -> None:
        self.count = 0
        self._frame = np.zeros(3)
        self._faces: list[Any] = []
        self._boxes = np.empty((64, 4))
        self._areas = np.empty(64)
        self._covers: list[list[int]] = []
        # What of each swath none before it covers. Every face is a part of one of these.
        self._rests: list[Any] = []

    def add(self, swaths: Float64[np.ndarray, "swaths corners 2"]) -> None:
        """Add the next swaths, polygons that may cross themselves (m)."""
        if not len(swaths):
            return
        if not self.count:
            edge = swaths[0, 1] - swaths[0, 0]
            self._frame = inverse(np.array((*swaths[0, 0], np.arctan2(edge[1], edge[0]))))
        # The grid lies as the first swath does, so that areas do not depend on the journey's frame.
        swaths = transform_points(self._frame, swaths)
        # Steps that follow each other touch: what reaches no farther in is not cut.
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
        """Cut faces along a swath; returns what of it covers none of them."""
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
        """Where in the second array the faces of each swath begin; these; the areas of all (m²)."""
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
    """Lay a swath over faces; without a grid first, which is several times as fast.

    Args:
        faces: The faces that it overlaps.
        areas: Their areas (m²).
        known: Fewer shapes that together cover what these faces cover, and more.
        swath: The swath.
        grid: Spacing of the grid (m).

    Returns:
        What each face has in common with the swath, None where that is a sliver; what it has
        outside, None where it is not cut; and the rest of the swath.
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
    """What of a shape has an area; common parts and crossed swaths may hold lines too."""
    if shape.geom_type != "GeometryCollection":
        return shape
    parts = shapely.get_parts(shape)
    kept = parts[np.isin(shapely.get_type_id(parts), _POLYGONAL)]
    return shapely.union_all(kept, grid_size=_GRID)
