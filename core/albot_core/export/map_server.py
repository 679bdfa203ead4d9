"""Occupancy grids in the format of ROS's map_server: a picture of gray cells (PGM) and a YAML file.

https://wiki.ros.org/map_server, section "Map format": the first row has the largest y. The
probability of a cell is (255 - gray) / 255. The cell is occupied above `occupied_thresh`, free
below `free_thresh`, and unknown in between.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from albot_core.errors import InputError
from albot_core.files import atomic_write, write_text
from albot_core.maps.layers import OccupancyGridLayer

OCCUPIED, FREE = 0.65, 0.196
"""Thresholds as written by map_saver."""
_BLACK, _WHITE, _UNKNOWN = 0, 254, 205
"""Gray values as written by map_saver."""


def write_map_server(layer: OccupancyGridLayer, path: Path) -> None:
    """Write a grid as the YAML file `path`, and a picture with the same name and suffix `.pgm`.

    As in map_saver, a cell becomes occupied, free or unknown. Unlike there, it is free below 0.5,
    not only below `FREE`, because a map of few scans needs this.

    Args:
        layer: The grid.
        path: The YAML file, whose name ends in `.yaml`.

    Raises:
        InputError: The name does not end in `.yaml`, or the grid has no cells.
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
    with atomic_write(picture) as stream:
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
