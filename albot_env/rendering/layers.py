"""The layers of a map as shapes to draw: one function per layer."""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from albot_core.counts import many
from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose
from albot_core.maps.layers import (
    Layer,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceGraph,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_env.rendering.shapes import Shape

_ASIDE = 0.8
"""Distance by which a place is drawn beside its exit instead of on it (m)."""


@singledispatch
def layer_shapes(layer: Layer, frame: Pose) -> tuple[Shape, ...]:
    """Return the shapes of a layer, from back to front.

    Args:
        layer: The layer.
        frame: Pose of the map frame (world frame).
    """
    raise NotImplementedError(type(layer).__name__)


@singledispatch
def layer_summary(layer: Layer) -> str:
    """Return a summary of a layer in two words; empty if there is nothing to count."""
    raise NotImplementedError(type(layer).__name__)


@layer_shapes.register
def _segments(layer: SegmentsLayer, frame: Pose) -> tuple[Shape, ...]:
    data = transform_segments(frame, layer.segments)
    return (Shape(kind="segments", style="surface", label="surfaces", data=data),)


@layer_summary.register
def _segments_summary(layer: SegmentsLayer) -> str:
    return many(len(layer.segments), "surface")


@layer_shapes.register
def _occupancy_grid(layer: OccupancyGridLayer, frame: Pose) -> tuple[Shape, ...]:
    data = compose(frame, layer.origin)
    return (Shape(kind="grid", style="grid", label="occupancy grid", data=data, grid=layer),)


@layer_summary.register
def _occupancy_grid_summary(layer: OccupancyGridLayer) -> str:
    rows, columns = layer.occupancy.shape
    return f"{columns} × {rows} cells"


@layer_shapes.register
def _place_graph(layer: PlaceGraph, frame: Pose) -> tuple[Shape, ...]:
    if not layer.nodes:
        return ()
    middles = _drawn_at(layer)
    numbers = {node.id: k for k, node in enumerate(layer.nodes)}
    links = [(*middles[numbers[one]], *middles[numbers[other]]) for one, other in layer.links]
    lines = transform_segments(frame, np.reshape(links, (-1, 4)).astype(np.float64))
    doorways = transform_segments(frame, layer.doorways())
    points = transform_points(frame, middles)
    if layer.is_dense:
        places = Shape(kind="dots", style="place", label="places", data=points)
    else:
        names = tuple(node.label for node in layer.nodes)
        places = Shape(kind="marks", style="place", label="places", data=points, names=names)
    shapes = (
        Shape(kind="segments", style="link", label="links", data=lines),
        Shape(kind="segments", style="doorway", label="exits", data=doorways),
        places,
    )
    return tuple(shape for shape in shapes if len(shape.data))


def _drawn_at(layer: PlaceGraph) -> Points:
    """Return where places are drawn (map frame, m): at their centres, or beside an exit there.

    The centre of a place with one exit is that exit; so may be that of the place beyond it.
    """
    points = np.array([node.middle for node in layer.nodes])
    numbers = {node.id: k for k, node in enumerate(layer.nodes)}
    for edge in layer.edges:
        if edge.doorway is None:
            continue
        number = numbers[edge.source]
        x1, y1, x2, y2 = transform_segments(layer.nodes[number].pose, edge.doorway[None])[0]
        width = np.hypot(x2 - x1, y2 - y1)
        if np.hypot(*(points[number] - ((x1 + x2) / 2, (y1 + y2) / 2))) < width / 2:
            points[number] += _ASIDE / width * np.array((y1 - y2, x2 - x1))
    return points


@layer_summary.register
def _place_graph_summary(layer: PlaceGraph) -> str:
    return many(len(layer.nodes), "place")


@layer_shapes.register
def _particles(layer: ParticlesLayer, frame: Pose) -> tuple[Shape, ...]:
    data = transform_points(frame, layer.poses[:, :2])
    return (Shape(kind="dots", style="particle", label="particles", data=data),)


@layer_summary.register
def _particles_summary(layer: ParticlesLayer) -> str:
    return many(len(layer.poses), "particle")


@layer_shapes.register
def _trajectory(layer: TrajectoryLayer, frame: Pose) -> tuple[Shape, ...]:
    data = transform_points(frame, layer.poses[:, :2])
    return (Shape(kind="line", style="corrected", label="path corrected", data=data),)


@layer_summary.register
def _trajectory_summary(layer: TrajectoryLayer) -> str:
    return ""
