"""Checks of layers, because mappers from outside the project make maps, too."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from albot_core.maps.layers import (
    Layer,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_core.ranges import COUNT

_Shape = tuple[int | None, ...]
"""Lengths of an array's axes; None for any."""
_LINES: _Shape = (None, 4)
_POSES: _Shape = (None, 3)
_POSE: _Shape = (3,)


class LayerFault(NamedTuple):
    """What is wrong with a layer."""

    place: str
    """Name of the field."""
    expected: str
    """What it should be."""
    found: object
    """Its value."""


def layer_fault(layer: Layer) -> LayerFault | None:
    """Return the first thing in a layer that is not as its type says; None for a right one."""
    return next(_faults(layer), None)


def _faults(layer: Layer) -> Iterator[LayerFault]:
    if isinstance(layer, SegmentsLayer):
        yield from _not_numbers("segments", layer.segments, _LINES)
    elif isinstance(layer, OccupancyGridLayer):
        yield from _not_numbers("origin", layer.origin, _POSE)
        cells = layer.occupancy
        is_grid = isinstance(cells, np.ndarray) and cells.ndim == 2 and cells.dtype == np.float32
        if not is_grid or (cells < 0).any() or (cells > 1).any():
            expected = "probabilities (float32) in rows and columns, NaN for unknown ones"
            yield LayerFault("occupancy", expected, cells)
    elif isinstance(layer, ParticlesLayer):
        yield from _not_numbers("poses", layer.poses, _POSES)
        yield from _not_numbers("weights", layer.weights, (len(layer.poses),))
    elif isinstance(layer, TrajectoryLayer):
        yield from _not_numbers("poses", layer.poses, _POSES)
    else:
        yield from _graph_faults(layer)


def _graph_faults(graph: PlaceGraph) -> Iterator[LayerFault]:
    for field, kind in (("nodes", PlaceNode), ("edges", PlaceEdge)):
        items: object = getattr(graph, field)
        if not (isinstance(items, tuple) and all(isinstance(item, kind) for item in items)):
            yield LayerFault(field, f"a tuple of {kind.__name__}", items)
    before = -1
    for k, node in enumerate(graph.nodes):
        if node.id not in COUNT or node.id <= before:
            yield LayerFault(f"nodes[{k}].id", "whole numbers from 0, in order", node.id)
        before = node.id
        yield from _node_faults(f"nodes[{k}]", node)
    places = {node.id for node in graph.nodes}
    for name, place in (("current", graph.current), ("home", graph.home)):
        if place is not None and place not in places:
            yield LayerFault(name, "the id of a place, or None", place)
    for k, edge in enumerate(graph.edges):
        yield from _edge_faults(f"edges[{k}]", edge, places)
        if edge.reverse is not None and edge.reverse not in range(len(graph.edges)):
            yield LayerFault(f"edges[{k}].reverse", "the index of an edge, or None", edge.reverse)


def _node_faults(name: str, node: PlaceNode) -> Iterator[LayerFault]:
    label: object = node.label
    if not isinstance(label, str):
        yield LayerFault(f"{name}.label", "text", label)
    yield from _not_numbers(f"{name}.pose", node.pose, _POSE)
    yield from _not_numbers(f"{name}.middle", node.middle, (2,))
    yield from _not_numbers(f"{name}.segments", node.segments, _LINES)


def _edge_faults(name: str, edge: PlaceEdge, places: set[int]) -> Iterator[LayerFault]:
    for end, place in (("source", edge.source), ("target", edge.target)):
        if place not in places:
            yield LayerFault(f"{name}.{end}", "the id of a place", place)
    yield from _not_numbers(f"{name}.motion", edge.motion, _POSE)
    if edge.doorway is not None:
        yield from _not_numbers(f"{name}.doorway", edge.doorway, (4,))
    if edge.information is not None:
        yield from _not_numbers(f"{name}.information", edge.information, (3, 3))
    if edge.time is not None and not 0.0 <= edge.time < math.inf:
        yield LayerFault(f"{name}.time", "a time from 0 (s), or None", edge.time)


def _not_numbers(place: str, array: object, shape: _Shape) -> Iterator[LayerFault]:
    """Yield a fault unless it is an array of finite numbers, of a shape."""
    if (
        not isinstance(array, np.ndarray)
        or array.dtype.kind not in "fiu"
        or array.ndim != len(shape)
        or any(length not in (None, array.shape[axis]) for axis, length in enumerate(shape))
        or not np.isfinite(array).all()
    ):
        lengths = ", ".join("n" if length is None else str(length) for length in shape)
        lengths += "," if len(shape) == 1 else ""
        yield LayerFault(place, f"an array of finite numbers, of shape ({lengths})", array)
