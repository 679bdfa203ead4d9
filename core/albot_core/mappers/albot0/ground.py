"""The ground that the robot saw beside its way, cut into faces that each have one area.

The swaths of a wandering robot overlap. A region's area is that of the union of its swaths, and a
journey is split by comparing very many regions. So swaths are cut into faces where they overlap,
once, as they come: the area of any region is then the sum over its faces, each counted once.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float64, Int64

_SLIVER = 0.01
"""Faces smaller than this (m²) are left out: so much a sonar's widths do not tell."""
_GRID = 1e-3
"""Where edges all but coincide, shapely finds no answer but on a grid of this spacing (m), on which
it takes much longer."""
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
        """Add the next swath, a simple polygon (m)."""
        number, swath = self.count, shapely.polygons(corners)
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
        common = _overlay(shapely.intersection, faces, swath)
        covered = shapely.area(common) > _SLIVER
        if not covered.any():  # Steps that follow each other only touch.
            return swath
        faces, common, near = faces[covered], common[covered], near[covered]
        outside = _overlay(shapely.difference, faces, swath)
        left_over = shapely.area(outside) > _SLIVER
        for k, face in enumerate(near.tolist()):
            if left_over[k]:
                self._set_face(face, _polygonal(outside[k]))
                self._add_face(_polygonal(common[k]), [*self._covers[face], number])
            else:
                self._covers[face].append(number)
        return _polygonal(_overlay(shapely.difference, swath, _overlay(shapely.union_all, faces)))

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


def _overlay(operation: Callable[..., Any], *shapes: Any) -> Any:
    """What an operation of shapely makes of shapes, those that cross themselves made valid."""
    try:
        return operation(*shapes)
    except shapely.GEOSException:
        return operation(*map(shapely.make_valid, shapes), grid_size=_GRID)


def _polygonal(shape: Any) -> Any:
    """What of an intersection or a difference has an area: touching shapes have lines in common."""
    if shape.geom_type != "GeometryCollection":
        return shape
    parts = shapely.get_parts(shape)
    kept = parts[np.isin(shapely.get_type_id(parts), _POLYGONAL)]
    return _overlay(shapely.union_all, kept)
