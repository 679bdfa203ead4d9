"""The layers that a map can have, and the snapshot that holds those that one map has.

Renderers, recordings and exports know these types and no mapping system: each has one function a
layer. All coordinates are in the map's frame (m, rad). A layer's arrays may be the mapper's own:
they are read-only.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, TypeVar

import numpy as np
from jaxtyping import Float32, Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Poses, Segments

FEW, LABEL_SPACING = 10, 1.0
"""So many places are always labelled; more of them where they are farther apart than this (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentsLayer:
    """Line segments: the surfaces that were seen."""

    kind: ClassVar[str] = "segments"
    segments: Segments
    """The line segments (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupancyGridLayer:
    """A grid of cells that are occupied, free or unknown."""

    kind: ClassVar[str] = "occupancy_grid"
    origin: Pose
    """Pose of the outer corner of cell [0, 0]; columns run along its x axis, rows along its y."""
    resolution: float
    """Side of a cell (m)."""
    occupancy: Float32[np.ndarray, "rows columns"]
    """Probability that each cell is occupied; NaN where nothing is known."""

    def __post_init__(self) -> None:
        if not 0 < self.resolution < np.inf:
            found = str(self.resolution)
            raise InputError("OccupancyGridLayer.resolution", "a positive length (m)", found)

    def centres(self, least: float) -> Points:
        """The centres of the cells that are occupied with at least this probability (m)."""
        with np.errstate(invalid="ignore"):
            rows, columns = np.nonzero(self.occupancy >= least)
        local = (np.stack((columns, rows), axis=-1) + 0.5) * self.resolution
        return transform_points(self.origin, local)

    @property
    def corners(self) -> Float64[np.ndarray, "4 2"]:
        """The grid's four corners, counter-clockwise (m)."""
        rows, columns = self.occupancy.shape
        unit = np.array(((0, 0), (columns, 0), (columns, rows), (0, rows)), np.float64)
        return transform_points(self.origin, unit * self.resolution)


@dataclass(frozen=True, kw_only=True, eq=False)
class ParticlesLayer:
    """Where the robot may be: samples of the belief about its pose."""

    kind: ClassVar[str] = "particles"
    poses: Poses
    """The samples, (n, 3)."""
    weights: Float64[np.ndarray, "n"]
    """How likely each is; they sum to 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrajectoryLayer:
    """Where the robot has been, as the mapper believes now."""

    kind: ClassVar[str] = "trajectory"
    poses: Poses
    """The poses, (n, 3), in the order of time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceNode:
    """A place: a node of a place graph."""

    id: int
    """Its number; never used again for another place."""
    label: str
    """What it is called."""
    pose: Pose
    """Where its own frame lies in the map."""
    middle: Points
    """The point at which it is drawn, in the map's frame (m)."""
    segments: Segments = field(default_factory=lambda: np.empty((0, 4)))
    """What it is remembered by, in its own frame (m); empty where that is no line segments."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceEdge:
    """A way from one place to another: a directed edge of a place graph."""

    source: int
    """Id of the place that it leaves."""
    target: int
    """Id of the place that it leads to."""
    motion: Pose
    """The target's frame in the source's."""
    doorway: Float64[np.ndarray, "4"] | None = None
    """The line to cross on the way, in the source's frame (m). A robot that goes along it, from its
    first end to its second, has the source to its left. None where the way leads through no
    doorway."""
    reverse: int | None = None
    """Index in `PlaceGraph.edges` of the same way taken backwards; None where none is known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceGraph:
    """Places and the ways between them."""

    kind: ClassVar[str] = "place_graph"
    nodes: tuple[PlaceNode, ...] = ()
    """The places, in the order of their ids."""
    edges: tuple[PlaceEdge, ...] = ()
    """The ways between them."""
    current: int | None = None
    """Id of the place where the robot believes to be; None where it does not know."""
    home: int | None = None
    """Id of the place from which the robot set out."""

    def node(self, place: int) -> PlaceNode:
        """The place of an id.

        Raises:
            KeyError: There is none.
        """
        return self._by_id[place]

    @cached_property
    def _by_id(self) -> dict[int, PlaceNode]:
        return {node.id: node for node in self.nodes}

    def doorways(self) -> Segments:
        """The lines of all doorways, in the map's frame (m), in the order of the edges."""
        lines = [
            transform_segments(self.node(edge.source).pose, edge.doorway[None])[0]
            for edge in self.edges
            if edge.doorway is not None
        ]
        return np.reshape(lines, (-1, 4)).astype(np.float64)

    @property
    def is_dense(self) -> bool:
        """Whether places lie so close together that they are drawn small, without their labels.

        So where there are more than `FEW`, and half of them have another one within
        `LABEL_SPACING`: the labels would cover each other.
        """
        if len(self.nodes) <= FEW:
            return False
        from scipy.spatial import KDTree  # slow to load

        middles = np.array([node.middle for node in self.nodes])
        nearest, _ = KDTree(middles).query(middles, k=2)
        return bool(np.median(nearest[:, 1]) < LABEL_SPACING)

    @property
    def links(self) -> tuple[tuple[int, int], ...]:
        """The pairs of ids (less, greater) of places with an edge between them, each once."""
        pairs = {(min(e.source, e.target), max(e.source, e.target)) for e in self.edges}
        return tuple(sorted(pair for pair in pairs if pair[0] != pair[1]))


Layer = SegmentsLayer | OccupancyGridLayer | PlaceGraph | ParticlesLayer | TrajectoryLayer
"""Any layer."""

LAYERS: dict[str, type[Layer]] = {
    layer.kind: layer
    for layer in (SegmentsLayer, OccupancyGridLayer, PlaceGraph, ParticlesLayer, TrajectoryLayer)
}
"""All types of layers by their kind."""

OneLayer = TypeVar("OneLayer", bound=Layer)


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSnapshot:
    """A map at one moment: its layers, at most one of each type."""

    layers: tuple[Layer, ...] = ()
    """The layers, from back to front."""

    def layer(self, kind: type[OneLayer]) -> OneLayer | None:
        """The layer of a type; None where the map has none."""
        for layer in self.layers:
            if isinstance(layer, kind):
                return layer
        return None

    @property
    def segments(self) -> Segments:
        """The line segments (m); empty where the map has no such layer."""
        layer = self.layer(SegmentsLayer)
        return np.empty((0, 4)) if layer is None else layer.segments

    @property
    def place_graph(self) -> PlaceGraph:
        """The place graph; empty where the map has no such layer."""
        return self.layer(PlaceGraph) or PlaceGraph()


EMPTY_MAP = MapSnapshot()
"""The map of a robot without a mapper."""
