"""The layers of a map as messages, and back: one function a layer and direction.

An episode file holds each layer twice: exactly, in `/albot/map`, which `albot play` reads; and on a
topic of its own, as Foxglove draws it.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from functools import singledispatch
from typing import Any

import numpy as np

from albot_core.maps.layers import (
    Layer,
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_env.recording.foxglove import Message, lines, pose_of, scene, time_of

SEGMENT_COLOUR = {"r": 0.96, "g": 0.72, "b": 0.26, "a": 1.0}
LINK_COLOUR = {"r": 0.57, "g": 0.50, "b": 0.84, "a": 1.0}
DOORWAY_COLOUR = {"r": 0.97, "g": 0.51, "b": 0.67, "a": 1.0}

UNKNOWN = 255
"""The byte of a cell of which nothing is known; others are occupied with k / 254."""


def map_messages(snapshot: MapSnapshot, stamp: float) -> Iterator[Message]:
    """The messages of a map at a moment (s)."""
    for layer in snapshot.layers:
        yield f"/map/{layer.kind}", drawn_layer(layer, stamp)
    yield "/albot/map", {layer.kind: plain_layer(layer) for layer in snapshot.layers}


def map_from_message(content: dict[str, Any]) -> MapSnapshot:
    """The map of an `/albot/map` message.

    Raises:
        KeyError, TypeError, ValueError: The message is not as its schema says.
    """
    return MapSnapshot(layers=tuple(_READERS[kind](layer) for kind, layer in content.items()))


@singledispatch
def plain_layer(layer: Layer) -> dict[str, Any]:
    """A layer as the schema of its kind says."""
    raise NotImplementedError(type(layer).__name__)


@singledispatch
def drawn_layer(layer: Layer, stamp: float) -> dict[str, Any]:
    """A layer as a message that Foxglove draws."""
    raise NotImplementedError(type(layer).__name__)


@plain_layer.register
def _plain_segments(layer: SegmentsLayer) -> dict[str, Any]:
    return {"segments": layer.segments.tolist()}


@drawn_layer.register
def _drawn_segments(layer: SegmentsLayer, stamp: float) -> dict[str, Any]:
    return scene("segments", "map", stamp, lines=[lines(layer.segments, SEGMENT_COLOUR)])


def _read_segments(content: dict[str, Any]) -> SegmentsLayer:
    return SegmentsLayer(segments=_rows(content["segments"], 4))


@plain_layer.register
def _plain_grid(layer: OccupancyGridLayer) -> dict[str, Any]:
    rows, columns = layer.occupancy.shape
    return {
        "origin": layer.origin.tolist(),
        "resolution": layer.resolution,
        "rows": rows,
        "columns": columns,
        "occupancy": base64.b64encode(_bytes(layer).tobytes()).decode(),
    }


@drawn_layer.register
def _drawn_grid(layer: OccupancyGridLayer, stamp: float) -> dict[str, Any]:
    columns = layer.occupancy.shape[1]
    return {
        "timestamp": time_of(stamp),
        "frame_id": "map",
        "pose": pose_of(layer.origin),
        "column_count": columns,
        "cell_size": {"x": layer.resolution, "y": layer.resolution},
        "row_stride": columns,
        "cell_stride": 1,
        "fields": [{"name": "occupancy", "offset": 0, "type": 1}],
        "data": base64.b64encode(_bytes(layer).tobytes()).decode(),
    }


def _bytes(layer: OccupancyGridLayer) -> np.ndarray:
    known = ~np.isnan(layer.occupancy)
    chances = np.nan_to_num(layer.occupancy)
    return np.where(known, np.rint(254 * chances), UNKNOWN).astype(np.uint8)


def _read_grid(content: dict[str, Any]) -> OccupancyGridLayer:
    raw = np.frombuffer(base64.b64decode(content["occupancy"], validate=True), np.uint8)
    cells = raw.reshape(int(content["rows"]), int(content["columns"]))
    occupancy = np.where(cells == UNKNOWN, np.nan, cells / 254).astype(np.float32)
    return OccupancyGridLayer(
        origin=_row(content["origin"], 3),
        resolution=float(content["resolution"]),
        occupancy=occupancy,
    )


@plain_layer.register
def _plain_graph(layer: PlaceGraph) -> dict[str, Any]:
    return {
        "nodes": [
            {
                "id": node.id,
                "label": node.label,
                "pose": node.pose.tolist(),
                "middle": node.middle.tolist(),
                "segments": node.segments.tolist(),
            }
            for node in layer.nodes
        ],
        "edges": [
            {
                "source": edge.source,
                "target": edge.target,
                "motion": edge.motion.tolist(),
                "doorway": None if edge.doorway is None else edge.doorway.tolist(),
                "reverse": edge.reverse,
            }
            for edge in layer.edges
        ],
        "current": layer.current,
        "home": layer.home,
    }


@drawn_layer.register
def _drawn_graph(layer: PlaceGraph, stamp: float) -> dict[str, Any]:
    links = [(*layer.node(one).middle, *layer.node(other).middle) for one, other in layer.links]
    texts = [
        {
            "pose": pose_of(np.array((*node.middle, 0.0))),
            "billboard": True,
            "font_size": 0.4,
            "scale_invariant": False,
            "color": LINK_COLOUR,
            "text": node.label,
        }
        for node in layer.nodes
    ]
    drawn = [
        lines(np.reshape(links, (-1, 4)).astype(np.float64), LINK_COLOUR),
        lines(layer.doorways(), DOORWAY_COLOUR),
    ]
    return scene("place_graph", "map", stamp, lines=drawn, texts=texts)


def _read_graph(content: dict[str, Any]) -> PlaceGraph:
    nodes = tuple(
        PlaceNode(
            id=int(node["id"]),
            label=str(node["label"]),
            pose=_row(node["pose"], 3),
            middle=_row(node["middle"], 2),
            segments=_rows(node["segments"], 4),
        )
        for node in content["nodes"]
    )
    edges = tuple(
        PlaceEdge(
            source=int(edge["source"]),
            target=int(edge["target"]),
            motion=_row(edge["motion"], 3),
            doorway=None if edge["doorway"] is None else _row(edge["doorway"], 4),
            reverse=edge["reverse"],
        )
        for edge in content["edges"]
    )
    graph = PlaceGraph(nodes=nodes, edges=edges, current=content["current"], home=content["home"])
    for edge in edges:
        graph.node(edge.source), graph.node(edge.target)
    return graph


@plain_layer.register
def _plain_particles(layer: ParticlesLayer) -> dict[str, Any]:
    return {"poses": layer.poses.tolist(), "weights": layer.weights.tolist()}


@plain_layer.register
def _plain_trajectory(layer: TrajectoryLayer) -> dict[str, Any]:
    return {"poses": layer.poses.tolist()}


@drawn_layer.register
def _drawn_poses(layer: ParticlesLayer | TrajectoryLayer, stamp: float) -> dict[str, Any]:
    poses = [pose_of(pose) for pose in layer.poses]
    return {"timestamp": time_of(stamp), "frame_id": "map", "poses": poses}


def _read_particles(content: dict[str, Any]) -> ParticlesLayer:
    poses = _rows(content["poses"], 3)
    return ParticlesLayer(poses=poses, weights=_row(content["weights"], len(poses)))


def _read_trajectory(content: dict[str, Any]) -> TrajectoryLayer:
    return TrajectoryLayer(poses=_rows(content["poses"], 3))


_READERS: dict[str, Callable[[dict[str, Any]], Layer]] = {
    SegmentsLayer.kind: _read_segments,
    OccupancyGridLayer.kind: _read_grid,
    PlaceGraph.kind: _read_graph,
    ParticlesLayer.kind: _read_particles,
    TrajectoryLayer.kind: _read_trajectory,
}


def _row(numbers: Any, count: int) -> np.ndarray:
    """So many numbers."""
    array = np.array(numbers, np.float64)
    if array.shape != (count,):
        raise ValueError(f"{count} numbers expected, found {array.shape}")
    return array


def _rows(numbers: Any, count: int) -> np.ndarray:
    """Rows of so many numbers."""
    return np.array(numbers, np.float64).reshape(-1, count)
