"""An occupancy grid as ROS's map_server reads it: a picture of gray cells (PGM) and a YAML file.

https://wiki.ros.org/map_server, section "Map format": rows from the top, that is from the greatest
y; a cell's probability is (255 - gray) / 255; above `occupied_thresh` it is occupied, below
`free_thresh` free, and between the two unknown.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from albot_core.errors import InputError
from albot_core.files import replacing, write_text
from albot_core.maps.layers import OccupancyGridLayer

OCCUPIED, FREE = 0.65, 0.196
"""The thresholds that map_saver writes."""
_BLACK, _WHITE, _UNKNOWN = 0, 254, 205
"""The grays that map_saver writes."""


def write_map_server(layer: OccupancyGridLayer, path: Path) -> None:
    """Write a grid as `path`, a YAML file, and the picture of the same name that ends in `.pgm`.

    As map_saver does, a cell becomes occupied, free or unknown: free below 0.5, which a map of few
    scans needs, and not only below `FREE`.

    Args:
        layer: The grid.
        path: The YAML file, whose name ends in `.yaml`.

    Raises:
        InputError: The name ends otherwise, or the grid has no cells.
    """
    if path.suffix != ".yaml":
        raise InputError(path, "a name that ends in .yaml", path.name)
    rows, columns = layer.occupancy.shape
    if not layer.occupancy.size:
        raise InputError(path, "a grid with cells", "an empty one")
    gray = np.full((rows, columns), _UNKNOWN, np.uint8)
    with np.errstate(invalid="ignore"):
        gray[layer.occupancy > OCCUPIED] = _BLACK
        gray[layer.occupancy < 0.5] = _WHITE
    picture = path.with_suffix(".pgm")
    with replacing(picture) as stream:
        stream.write(f"P5\n{columns} {rows}\n255\n".encode())
        stream.write(np.ascontiguousarray(gray[::-1]).tobytes())
    described = {
        "image": picture.name,
        "resolution": layer.resolution,
        "origin": layer.origin.tolist(),
        "negate": 0,
        "occupied_thresh": OCCUPIED,
        "free_thresh": FREE,
    }
    write_text(path, yaml.safe_dump(described, sort_keys=False))
