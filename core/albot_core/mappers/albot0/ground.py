"""The ground that the robot saw beside its way, cut into faces that each have one area.

The swaths of a wandering robot overlap. A region's area is that of the union of its swaths, and a
journey is split by comparing very many regions. So swaths are cut into faces where they overlap,
once, as they come: the area of any region is then the sum over its faces, each counted once.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import chain
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float64, Int64

_SLIVER = 0.01
"""Faces smaller than this (m²) are left out: so much a sonar's widths do not tell."""
_GRID = 1e-3
"""Where edges all but coincide, shapely finds no answer, or a wrong one, but on a grid of this
spacing (m), on which it takes three times as long."""
_POLYGONAL = (3, 6)
"""shapely's type ids of polygons and multipolygons."""


class Ground:
    """The union of swaths, as faces.

    Attributes:
        count: How many swaths there are.
    """

    def __init__(self) -> None:
        self.count = 0
        self._faces: list[Any] = []
        self._boxes = np.empty((64, 4))
        self._areas = np.empty(64)
        self._covers: list[list[int]] = []

    def add(self, corners: Float64[np.ndarray, "corners 2"]) -> None:
        """Add the next swath, a polygon that may cross itself (m)."""
        number, swath = self.count, shapely.make_valid(shapely.polygons(corners))
        self.count += 1
        low, high = corners.min(axis=0), corners.max(axis=0)
        boxes = self._boxes[: len(self._faces)]
        near = (boxes[:, :2] < high).all(axis=1) & (boxes[:, 2:] > low).all(axis=1)
        rest = swath
        if near.any():
            rest = self._cut(np.flatnonzero(near), swath, number)
        if rest.area > _SLIVER:
            self._add_face(rest, [number])

    def _cut(self, near: Int64[np.ndarray, "some"], swath: Any, number: int) -> Any:
        """Cut faces along a swath; returns what of it covers none of them."""
        faces = np.array([self._faces[face] for face in near], object)
        common, outside, rest = _cut_shapes(faces, swath)
        covered = shapely.area(common) > _SLIVER
        left_over = shapely.area(outside) > _SLIVER
        for k in np.flatnonzero(covered):
            face = int(near[k])
            if left_over[k]:
                self._set_face(face, _polygonal(outside[k]))
                self._add_face(_polygonal(common[k]), [*self._covers[face], number])
            else:
                self._covers[face].append(number)
        return rest

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


def _cut_shapes(faces: Any, swath: Any) -> tuple[Any, Any, Any]:
    """Cut faces that do not overlap along a swath.

    Where edges all but coincide shapely finds no answer, or a wrong one without saying so: a whole
    face for the common part of two that only touch. So the areas of the parts are added up, and
    where they are not those of the faces and of the swath, all is done again on a grid.

    Returns:
        What each has in common with the swath, what of it is outside; and what of the swath covers
        no face.
    """
    with suppress(shapely.GEOSException):
        common, outside, rest = _cut_exactly(faces, swath)
        inside = shapely.area(common)
        off = np.abs(inside + shapely.area(outside) - shapely.area(faces)).max()
        if max(off, abs(inside.sum() + rest.area - swath.area)) < _SLIVER:
            return common, outside, rest
    return _cut_exactly(faces, swath, grid_size=_GRID)


def _cut_exactly(faces: Any, swath: Any, **grid: float) -> tuple[Any, Any, Any]:
    common = shapely.intersection(faces, swath, **grid)
    outside = shapely.difference(faces, swath, **grid)
    covered = faces[shapely.area(common) > _SLIVER]
    if not len(covered):  # Steps that follow each other only touch.
        return common, outside, swath
    rest = shapely.difference(swath, shapely.union_all(covered, **grid), **grid)
    return common, outside, _polygonal(rest)


def _polygonal(shape: Any) -> Any:
    """What of an intersection or a difference has an area: touching shapes have lines in common."""
    if shape.geom_type != "GeometryCollection":
        return shape
    parts = shapely.get_parts(shape)
    kept = parts[np.isin(shapely.get_type_id(parts), _POLYGONAL)]
    return shapely.union_all(kept, grid_size=_GRID)
