"""The layers that a map can have, and the snapshot that holds the layers of one map.

Renderers, recordings and exports depend on these types and not on a mapping system; each has one
function per layer. All coordinates are in the map's frame (m, rad). A layer's arrays may be the
mapper's own, so they must not be changed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, TypeVar

import numpy as np
from jaxtyping import Float32, Float64

from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Poses, Segments
from albot_core.ranges import POSITIVE, check_fields

FEW, LABEL_SPACING = 10, 1.0
"""Up to `FEW` places are always labelled; more only if they are `LABEL_SPACING` apart (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentsLayer:
    """Line segments: the observed surfaces."""

    kind: ClassVar[str] = "segments"
    segments: Segments
    """The line segments (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupancyGridLayer:
    """A grid of cells that are occupied, free or unknown."""

    kind: ClassVar[str] = "occupancy_grid"
    origin: Pose
    """Pose of the outer corner of cell [0, 0]; columns run along its x axis, rows along y."""
    resolution: float
    """Side of a cell (m)."""
    occupancy: Float32[np.ndarray, "rows columns"]
    """Probability that each cell is occupied; NaN for unknown cells."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "resolution")

    def centres(self, least: float) -> Points:
        """Return the centres of the cells with an occupancy of at least `least` (m, map frame)."""
        with np.errstate(invalid="ignore"):
            rows, columns = np.nonzero(self.occupancy >= least)
        local = (np.stack((columns, rows), axis=-1) + 0.5) * self.resolution
        return transform_points(self.origin, local)

    @property
    def corners(self) -> Float64[np.ndarray, "4 2"]:
        """The grid's four corners, counter-clockwise (m, map frame)."""
        rows, columns = self.occupancy.shape
        unit = np.array(((0, 0), (columns, 0), (columns, rows), (0, rows)), np.float64)
        return transform_points(self.origin, unit * self.resolution)


@dataclass(frozen=True, kw_only=True, eq=False)
class ParticlesLayer:
    """Particles: samples of the belief about the robot's pose."""

    kind: ClassVar[str] = "particles"
    poses: Poses
    """The samples, (n, 3)."""
    weights: Float64[np.ndarray, "n"]
    """The weight of each sample; the sum is 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrajectoryLayer:
    """The robot's past poses, as currently estimated by the mapper."""

    kind: ClassVar[str] = "trajectory"
    poses: Poses
    """The poses, (n, 3), in the order of time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceNode:
    """A place: a node of a place graph."""

    id: int
    """Its number, which is never reused for another place."""
    label: str
    """Its displayed name."""
    pose: Pose
    """Pose of its own frame in the map's frame."""
    middle: Points
    """The point at which it is drawn, in the map's frame (m)."""
    segments: Segments = field(default_factory=lambda: np.empty((0, 4)))
    """The line segments that describe it, in its own frame (m); empty if it has none."""
    visits: int | None = None
    """Number of stays in it so far; None if the mapper does not count them. Recordings do not keep
    it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceEdge:
    """A connection from one place to another: a directed edge of a place graph."""

    source: int
    """Id of the place where it begins."""
    target: int
    """Id of the place where it ends."""
    motion: Pose
    """Pose of the target's frame in the source's frame."""
    doorway: Float64[np.ndarray, "4"] | None = None
    """The line to cross: x1, y1, x2, y2 in the source's frame (m). Seen along the line from its
    first end to its second, the source is on the left. None without a doorway."""
    reverse: int | None = None
    """Index in `PlaceGraph.edges` of the edge in the opposite direction; None if there is none."""
    information: Float64[np.ndarray, "3 3"] | None = None
    """Information matrix of `motion`: the inverse of its covariance, along the axes of the target's
    frame (1/m², 1/rad²). Only ratios matter where a mapper knows no more. None if unknown.
    Recordings do not keep it."""
    time: float | None = None
    """Shortest time in which the robot has driven it (s); None if unknown. Recordings do not keep
    it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceGraph:
    """Places and the connections between them."""

    kind: ClassVar[str] = "place_graph"
    nodes: tuple[PlaceNode, ...] = ()
    """The places, in the order of their ids."""
    edges: tuple[PlaceEdge, ...] = ()
    """The connections."""
    current: int | None = None
    """Id of the place where the mapper estimates the robot to be; None if unknown."""
    home: int | None = None
    """Id of the place where the robot started; None if there is none."""
    frame: Pose = field(default_factory=lambda: np.zeros(3))
    """Pose of the graph's own frame in the map's frame: where the mapper believes that the places
    lie on its map now. Zero unless the map drifts apart from the places that are remembered.
    Recordings do not keep it."""

    def node(self, place: int) -> PlaceNode:
        """Return the place with an id.

        Raises:
            KeyError: There is no such place.
        """
        return self._by_id[place]

    @cached_property
    def _by_id(self) -> dict[int, PlaceNode]:
        return {node.id: node for node in self.nodes}

    def doorways(self) -> Segments:
        """Return the lines of all doorways (m, map frame), in the order of the edges."""
        lines = [
            transform_segments(self.node(edge.source).pose, edge.doorway[None])[0]
            for edge in self.edges
            if edge.doorway is not None
        ]
        return np.reshape(lines, (-1, 4)).astype(np.float64)

    @property
    def is_dense(self) -> bool:
        """Whether places are too dense for labels, and must be drawn small.

        This is the case if there are more than `FEW` and half of them have a neighbour within
        `LABEL_SPACING`.
        """
        if len(self.nodes) <= FEW:
            return False
        from scipy.spatial import KDTree  # slow to load

        middles = np.array([node.middle for node in self.nodes])
        nearest, _ = KDTree(middles).query(middles, k=2)
        return bool(np.median(nearest[:, 1]) < LABEL_SPACING)

    @property
    def links(self) -> tuple[tuple[int, int], ...]:
        """The pairs of ids (smaller, larger) of connected places, each once."""
        pairs = {(min(e.source, e.target), max(e.source, e.target)) for e in self.edges}
        return tuple(sorted(pair for pair in pairs if pair[0] != pair[1]))


Layer = SegmentsLayer | OccupancyGridLayer | PlaceGraph | ParticlesLayer | TrajectoryLayer
"""Any layer."""

LAYERS: dict[str, type[Layer]] = {
    layer.kind: layer
    for layer in (SegmentsLayer, OccupancyGridLayer, PlaceGraph, ParticlesLayer, TrajectoryLayer)
}
"""All types of layers, by kind."""

OneLayer = TypeVar("OneLayer", bound=Layer)


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSnapshot:
    """A map at one moment: its layers, at most one of each type."""

    layers: tuple[Layer, ...] = ()
    """The layers, from back to front."""

    def layer(self, kind: type[OneLayer]) -> OneLayer | None:
        """Return the layer of a type; None if the map has none."""
        for layer in self.layers:
            if isinstance(layer, kind):
                return layer
        return None

    @property
    def segments(self) -> Segments:
        """The line segments (m); empty if the map has no such layer."""
        layer = self.layer(SegmentsLayer)
        return np.empty((0, 4)) if layer is None else layer.segments

    @property
    def place_graph(self) -> PlaceGraph:
        """The place graph; empty if the map has no such layer."""
        return self.layer(PlaceGraph) or PlaceGraph()


EMPTY_MAP = MapSnapshot()
"""The map of a robot without a mapper."""
