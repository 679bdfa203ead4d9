"""Surfaces and places as GeoJSON, for geographic and plotting programs.

A FeatureCollection with a LineString for every surface and, of a mapper that knows places, a
Point for every place and a LineString for every exit. The coordinates are no longitudes
and latitudes, which RFC 7946 would have, but metres in the map's frame: x forward and y left
of the robot as it stood when the map began. The collection's member `frame` says so.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.files import write_text
from albot_core.geometry.types import Points, Segments
from albot_core.maps.place_graph import NOWHERE, Network

FRAME = "metres; x forward and y left of where the robot set out"

_DIGITS = 4
"""Digits after the point: a tenth of a millimetre."""


Feature = dict[str, object]


def map_to_geojson(surfaces: Segments, network: Network = NOWHERE) -> dict[str, object]:
    """A map as a GeoJSON object.

    The property `id` of a surface is its place in the map. Places and their exits have the
    property `kind` as well: a `place` is at its middle, with its number as `id` and its
    `label`; an `exit` bears the numbers of the place that it is `of` and that it `leads_to`.
    """
    features = [_line(line, id=number) for number, line in enumerate(surfaces)]
    features += [_point(p.middle, kind="place", id=p.id, label=p.label) for p in network.places]
    features += [
        _line(line, kind="exit", of=place.id, leads_to=door.leads_to)
        for place in network.places
        for line, door in zip(place.placed_exits, place.exits, strict=True)
    ]
    return {"type": "FeatureCollection", "frame": FRAME, "features": features}


def _line(line: Float64[np.ndarray, "4"], **properties: object) -> Feature:
    x1, y1, x2, y2 = (line.round(_DIGITS) + 0.0).tolist()
    return _feature("LineString", [[x1, y1], [x2, y2]], properties)


def _point(at: Points, **properties: object) -> Feature:
    return _feature("Point", (at.round(_DIGITS) + 0.0).tolist(), properties)


def _feature(kind: str, coordinates: list[object], properties: dict[str, object]) -> Feature:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def write_geojson(surfaces: Segments, path: Path, network: Network = NOWHERE) -> None:
    """Write a map as a GeoJSON file, whole or not at all."""
    write_text(path, json.dumps(map_to_geojson(surfaces, network)) + "\n")
