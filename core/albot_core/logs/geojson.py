"""Surfaces as GeoJSON, for geographic and plotting programs.

A FeatureCollection with a LineString for every surface. The coordinates are no longitudes
and latitudes, which RFC 7946 would have, but metres in the map's frame: x forward and y left
of the robot as it stood when the map began. The collection's member `frame` says so.
"""

from __future__ import annotations

import json
from pathlib import Path

from albot_core.files import write_text
from albot_core.geometry.types import Segments

FRAME = "metres; x forward and y left of where the robot set out"

_DIGITS = 4
"""Digits after the point: a tenth of a millimetre."""


def surfaces_to_geojson(surfaces: Segments) -> dict[str, object]:
    """The surfaces as a GeoJSON object; each feature's property `id` is its place in the map."""
    features = [
        {
            "type": "Feature",
            "properties": {"id": number},
            "geometry": {"type": "LineString", "coordinates": [[x1, y1], [x2, y2]]},
        }
        for number, (x1, y1, x2, y2) in enumerate((surfaces.round(_DIGITS) + 0.0).tolist())
    ]
    return {"type": "FeatureCollection", "frame": FRAME, "features": features}


def write_geojson(surfaces: Segments, path: Path) -> None:
    """Write the surfaces as a GeoJSON file, whole or not at all."""
    write_text(path, json.dumps(surfaces_to_geojson(surfaces)) + "\n")
