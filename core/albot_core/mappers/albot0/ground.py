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

from albot_core.geometry.poses import inverse, transform_points

_SLIVER = 0.01
"""Faces smaller than this (m²) are left out: so much a sonar's widths do not tell."""
_GRID = 1e-3
"""Swaths are cut on a grid of this spacing (m). Without one, shapely finds no answer where edges
all but coincide; or a wrong one, without saying so."""
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

    def add(self, corners: Float64[np.ndarray, "corners 2"]) -> None:
        """Add the next swath, a polygon that may cross itself (m)."""
        if not self.count:
            edge = corners[1] - corners[0]
            self._frame = inverse(np.array((*corners[0], np.arctan2(edge[1], edge[0]))))
        # The grid lies as the first swath does, so that areas do not depend on the journey's frame.
        corners = transform_points(self._frame, corners)
        number, swath = self.count, _polygonal(shapely.make_valid(shapely.polygons(corners)))
        self.count += 1
        # Steps that follow each other touch: what reaches no farther in is not cut.
        inner = corners + _INSET * (corners.mean(axis=0) - corners)
        boxes = self._boxes[: len(self._faces)]
        is_near = (boxes[:, :2] < inner.max(axis=0)) & (boxes[:, 2:] > inner.min(axis=0))
        near = np.flatnonzero(is_near.all(axis=1))
        faces = np.array([self._faces[face] for face in near.tolist()], object)
        reaches_in = shapely.intersects(shapely.polygons(inner), faces)
        rest = swath
        if reaches_in.any():
            rest = self._cut(near[reaches_in], faces[reaches_in], swath, number)
        if rest.area > _SLIVER:
            self._add_face(rest, [number])

    def _cut(self, near: Int64[np.ndarray, "some"], faces: Any, swath: Any, number: int) -> Any:
        """Cut faces along a swath; returns what of it covers none of them."""
        common = shapely.intersection(faces, swath, grid_size=_GRID)
        covered = shapely.area(common) > _SLIVER
        if not covered.any():
            return swath
        faces, common, near = faces[covered], common[covered], near[covered]
        outside = shapely.difference(faces, swath, grid_size=_GRID)
        left_over = shapely.area(outside) > _SLIVER
        for k, face in enumerate(near.tolist()):
            if left_over[k]:
                self._set_face(face, _polygonal(outside[k]))
                self._add_face(_polygonal(common[k]), [*self._covers[face], number])
            else:
                self._covers[face].append(number)
        known = shapely.union_all(faces, grid_size=_GRID)
        return _polygonal(shapely.difference(swath, known, grid_size=_GRID))

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


def _polygonal(shape: Any) -> Any:
    """What of a shape has an area; common parts and crossed swaths may hold lines too."""
    if shape.geom_type != "GeometryCollection":
        return shape
    parts = shapely.get_parts(shape)
    kept = parts[np.isin(shapely.get_type_id(parts), _POLYGONAL)]
    return shapely.union_all(kept, grid_size=_GRID)
