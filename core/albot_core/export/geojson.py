"""Maps as GeoJSON, for geographic and plotting programs: one function per layer.

Unlike in RFC 7946, coordinates are not longitudes and latitudes but metres in the map's frame: x
forward and y left of the robot's first pose. The collection's member `frame` says so.
"""

from __future__ import annotations

import json
from functools import singledispatch
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.files import write_text
from albot_core.geometry.types import Points
from albot_core.maps.layers import (
    Layer,
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceGraph,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_core.maps.outlines import outlines

FRAME = "metres; x forward and y left of where the robot set out"

OCCUPIED = 0.65
"""Least probability of the cells of an occupancy grid that are exported."""

_DIGITS = 4
"""Decimals of coordinates: a tenth of a millimetre."""


Feature = dict[str, object]


def map_to_geojson(snapshot: MapSnapshot) -> dict[str, object]:
    """Return a map as a GeoJSON FeatureCollection.

    - Line segments: a LineString each; `id` is its number in the map.
    - Occupancy grid: a Point with `kind` `cell` at the centre of each occupied cell, with its
      `probability`; a LineString with `kind` `outline` for each piece of the border between free
      and occupied ground (see `outlines`).
    - Place graph: a Point with `kind` `place` for each place, with its number as `id` and its
      `label`. For each edge a LineString with the numbers of its source (`of`) and target
      (`leads_to`): with `kind` `exit` across its doorway or, without a doorway, with `kind`
      `link` from place to place.
    - Particles: a Point with `kind` `particle` each, with `heading` (rad) and `weight`.
    - Trajectory: a LineString with `kind` `trajectory`.
    """
    features = [feature for layer in snapshot.layers for feature in layer_features(layer)]
    return {"type": "FeatureCollection", "frame": FRAME, "features": features}


def write_geojson(snapshot: MapSnapshot, path: Path) -> None:
    """Write a map as a GeoJSON file, atomically."""
    write_text(path, json.dumps(map_to_geojson(snapshot)) + "\n")


@singledispatch
def layer_features(layer: Layer) -> list[Feature]:
    """Return the features of a layer; see `map_to_geojson`."""
    raise NotImplementedError(type(layer).__name__)


@layer_features.register
def _segments(layer: SegmentsLayer) -> list[Feature]:
    return [_line(line.reshape(2, 2), id=number) for number, line in enumerate(layer.segments)]


@layer_features.register
def _occupancy_grid(layer: OccupancyGridLayer) -> list[Feature]:
    with np.errstate(invalid="ignore"):
        occupied = layer.occupancy >= OCCUPIED
    chances = layer.occupancy[occupied].round(_DIGITS).tolist()
    centres = layer.centres(OCCUPIED)
    cells = [
        _point(at, kind="cell", probability=chance)
        for at, chance in zip(centres, chances, strict=True)
    ]
    return cells + [_line(line.reshape(2, 2), kind="outline") for line in outlines(layer)]


@layer_features.register
def _place_graph(layer: PlaceGraph) -> list[Feature]:
    places = [_point(n.middle, kind="place", id=n.id, label=n.label) for n in layer.nodes]
    exits = [edge for edge in layer.edges if edge.doorway is not None]
    doorways = [
        _line(line.reshape(2, 2), kind="exit", of=edge.source, leads_to=edge.target)
        for line, edge in zip(layer.doorways(), exits, strict=True)
    ]
    links = [
        _line(
            np.stack((layer.node(edge.source).middle, layer.node(edge.target).middle)),
            kind="link",
            of=edge.source,
            leads_to=edge.target,
        )
        for edge in layer.edges
        if edge.doorway is None
    ]
    return places + doorways + links


@layer_features.register
def _particles(layer: ParticlesLayer) -> list[Feature]:
    return [
        _point(pose[:2], kind="particle", heading=_rounded(pose[2]), weight=float(weight))
        for pose, weight in zip(layer.poses, layer.weights, strict=True)
    ]


@layer_features.register
def _trajectory(layer: TrajectoryLayer) -> list[Feature]:
    return [_line(layer.poses[:, :2], kind="trajectory")] if len(layer.poses) > 1 else []


def _rounded(number: float) -> float:
    return round(float(number), _DIGITS) + 0.0


def _line(points: Float64[np.ndarray, "points 2"], **properties: object) -> Feature:
    return _feature("LineString", (points.round(_DIGITS) + 0.0).tolist(), properties)


def _point(at: Points, **properties: object) -> Feature:
    return _feature("Point", (at.round(_DIGITS) + 0.0).tolist(), properties)


def _feature(kind: str, coordinates: list[object], properties: dict[str, object]) -> Feature:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}
