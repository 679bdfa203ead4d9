"""Conversion of a map's layers to messages and back: one function per layer and direction.

An episode file holds each layer twice: exactly, in `/albot/map`, which `albot play` reads; and
on a topic of its own, for display in Foxglove.
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
from albot_core.plain_data import Location, read_array, read_fields, read_record
from albot_core.yaml_document import format_value
from albot_env.recording.foxglove import Message, lines, pose_of, scene, time_of

SEGMENT_COLOUR = {"r": 0.96, "g": 0.72, "b": 0.26, "a": 1.0}
LINK_COLOUR = {"r": 0.57, "g": 0.50, "b": 0.84, "a": 1.0}
DOORWAY_COLOUR = {"r": 0.97, "g": 0.51, "b": 0.67, "a": 1.0}

UNKNOWN = 255
"""Byte value of an unknown cell; other values k stand for the occupancy probability k / 254."""


def map_messages(snapshot: MapSnapshot, stamp: float) -> Iterator[Message]:
    """Return the messages of a map at a time (s)."""
    for layer in snapshot.layers:
        yield f"/map/{layer.kind}", drawn_layer(layer, stamp)
    yield "/albot/map", {layer.kind: plain_layer(layer) for layer in snapshot.layers}


def map_from_message(content: Any, where: Location) -> MapSnapshot:
    """Read the map from an `/albot/map` message; `where` is its place in the file.

    Raises:
        InputError: The message violates its schema; the error names the place.
    """
    layers = []
    for kind, fields in read_fields(dict.fromkeys(_READERS, Any), content, where).items():
        known, read = _READERS[kind]
        layers.append(read(read_record(known, fields, where.at(kind)), where.at(kind)))
    return MapSnapshot(layers=tuple(layers))


@singledispatch
def plain_layer(layer: Layer) -> dict[str, Any]:
    """Return a layer in the form of its kind's schema."""
    raise NotImplementedError(type(layer).__name__)


@singledispatch
def drawn_layer(layer: Layer, stamp: float) -> dict[str, Any]:
    """Return a layer as a message that Foxglove can draw."""
    raise NotImplementedError(type(layer).__name__)


@plain_layer.register
def _plain_segments(layer: SegmentsLayer) -> dict[str, Any]:
    return {"segments": layer.segments.tolist()}


@drawn_layer.register
def _drawn_segments(layer: SegmentsLayer, stamp: float) -> dict[str, Any]:
    return scene("segments", "map", stamp, lines=[lines(layer.segments, SEGMENT_COLOUR)])


def _read_segments(content: dict[str, Any], where: Location) -> SegmentsLayer:
    return SegmentsLayer(segments=_rows(4, content, "segments", where))


@plain_layer.register
def _plain_grid(layer: OccupancyGridLayer) -> dict[str, Any]:
    rows, columns = layer.occupancy.shape
    return {
        "origin": layer.origin.tolist(),
        "resolution": layer.resolution,
        "rows": rows,
        "columns": columns,
        "occupancy": base64.b64encode(occupancy_bytes(layer).tobytes()).decode(),
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
        "data": base64.b64encode(occupancy_bytes(layer).tobytes()).decode(),
    }


def occupancy_bytes(layer: OccupancyGridLayer) -> np.ndarray:
    """Return a byte for each cell, (rows, columns): `UNKNOWN`, or k for the probability k / 254."""
    known = ~np.isnan(layer.occupancy)
    chances = np.nan_to_num(layer.occupancy)
    return np.where(known, np.rint(254 * chances), UNKNOWN).astype(np.uint8)


def _read_grid(content: dict[str, Any], where: Location) -> OccupancyGridLayer:
    shape = content["rows"], content["columns"]
    try:
        raw = np.frombuffer(base64.b64decode(content["occupancy"], validate=True), np.uint8)
        if min(shape) < 0:  # numpy would replace a length of -1 by a computed one.
            raise ValueError
        cells = raw.reshape(shape)
        occupancy = np.where(cells == UNKNOWN, np.nan, cells / 254).astype(np.float32)
    except (ValueError, OverflowError):
        expected = f"{shape[0]} x {shape[1]} bytes in base 64"
        raise where.at("occupancy").error(expected, format_value(content["occupancy"])) from None
    origin = _row(3, content, "origin", where)
    resolution = float(read_array((), content["resolution"], where.at("resolution")))
    with where.relocate_errors():
        return OccupancyGridLayer(origin=origin, resolution=resolution, occupancy=occupancy)


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


def _read_graph(content: dict[str, Any], where: Location) -> PlaceGraph:
    nodes, edges = [], []
    for k, node in enumerate(content["nodes"]):
        at = where.at("nodes", k)
        fields = read_record(_NODE, node, at)
        nodes.append(
            PlaceNode(
                id=fields["id"],
                label=fields["label"],
                pose=_row(3, fields, "pose", at),
                middle=_row(2, fields, "middle", at),
                segments=_rows(4, fields, "segments", at),
            )
        )
    ids = {node.id for node in nodes}
    if len(ids) < len(nodes):
        raise where.at("nodes").error("ids of their own", "one twice")
    for k, edge in enumerate(content["edges"]):
        at = where.at("edges", k)
        fields = read_record(_EDGE, edge, at)
        for name, known in (
            ("source", ids),
            ("target", ids),
            ("reverse", range(len(content["edges"]))),
        ):
            if fields[name] is not None and fields[name] not in known:
                raise at.at(name).error("the number of one that is there", str(fields[name]))
        doorway = None if fields["doorway"] is None else _row(4, fields, "doorway", at)
        edges.append(
            PlaceEdge(
                source=fields["source"],
                target=fields["target"],
                motion=_row(3, fields, "motion", at),
                doorway=doorway,
                reverse=fields["reverse"],
            )
        )
    for name in ("current", "home"):
        if content[name] is not None and content[name] not in ids:
            raise where.at(name).error("the id of a place", str(content[name]))
    return PlaceGraph(
        nodes=tuple(nodes), edges=tuple(edges), current=content["current"], home=content["home"]
    )


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


def _read_particles(content: dict[str, Any], where: Location) -> ParticlesLayer:
    poses = _rows(3, content, "poses", where)
    return ParticlesLayer(poses=poses, weights=_row(len(poses), content, "weights", where))


def _read_trajectory(content: dict[str, Any], where: Location) -> TrajectoryLayer:
    return TrajectoryLayer(poses=_rows(3, content, "poses", where))


def _row(count: int, content: dict[str, Any], name: str, where: Location) -> np.ndarray:
    """Return an array of `count` numbers."""
    return read_array((count,), content[name], where.at(name))


def _rows(count: int, content: dict[str, Any], name: str, where: Location) -> np.ndarray:
    """Return an array of rows of `count` numbers."""
    return read_array((None, count), content[name], where.at(name))


_NODE = {"id": int, "label": str, "pose": Any, "middle": Any, "segments": Any}
_EDGE = {"source": int, "target": int, "motion": Any, "doorway": Any, "reverse": int | None}
_GRID = {"origin": Any, "resolution": float, "rows": int, "columns": int, "occupancy": str}
_GRAPH = {"nodes": list[Any], "edges": list[Any], "current": int | None, "home": int | None}
_READERS: dict[str, tuple[dict[str, Any], Callable[[dict[str, Any], Location], Layer]]] = {
    SegmentsLayer.kind: ({"segments": Any}, _read_segments),
    OccupancyGridLayer.kind: (_GRID, _read_grid),
    PlaceGraph.kind: (_GRAPH, _read_graph),
    ParticlesLayer.kind: ({"poses": Any, "weights": Any}, _read_particles),
    TrajectoryLayer.kind: ({"poses": Any}, _read_trajectory),
}
"""Fields and reader of each kind of layer; `Any` stands for lists of numbers."""
