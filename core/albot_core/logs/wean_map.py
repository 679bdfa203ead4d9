"""The map of Carnegie Mellon's Wean Hall that comes with its logs.

A few lines of `robot_specifications->NAME VALUE`, a line `global_map[0]: ROWS COLUMNS`, and the
cells, a line each row: a probability, or -1 where nothing is known. The resolution is in
centimetres; x runs along the rows' number, y along the columns'. The text that comes with
the map says that 1 is occupied; but the corridors, in which the robot drove, hold 1, and
their walls 0. Walls are some 0.5 m thick in it, for the laser saw but their faces.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.ndimage import binary_dilation

from albot_core.errors import InputError
from albot_core.files import read_bytes
from albot_core.geometry.types import Points

WALL, FREE = 0.5, 0.9
"""A known cell below the first is part of a wall, one above the second is free."""
_RESOLUTION = "robot_specifications->resolution"
_CELLS = "global_map[0]:"


def read_wean_map(path: Path) -> Points:
    """The middles (n, 2) of the cells that are the face of a wall: free ones are beside (m).

    Raises:
        InputError: The file cannot be read, or is no such map.
    """
    lines = read_bytes(path).decode("utf-8", "replace").splitlines()
    header = {words[0]: words[1:] for words in map(str.split, lines[:20]) if words}
    if _RESOLUTION not in header or _CELLS not in header:
        raise InputError(path, f"lines {_RESOLUTION} and {_CELLS}", "others")
    first = next(index for index, line in enumerate(lines) if line.startswith(_CELLS)) + 1
    try:
        cell = 0.01 * float(header[_RESOLUTION][0])
        shape = (int(header[_CELLS][0]), int(header[_CELLS][1]))
        cells = np.array([line.split() for line in lines[first : first + shape[0]]], np.float64)
    except (ValueError, IndexError) as error:
        raise InputError(path, "numbers, as many in every row", str(error)) from None
    if cells.shape != shape or not cell > 0:
        raise InputError(path, f"{shape[0]} rows of {shape[1]} cells", f"{cells.shape}")
    walls = (cells >= 0) & (cells < WALL)
    faces = walls & binary_dilation(cells > FREE, np.ones((3, 3), np.bool_))
    return np.asarray(cell * (np.argwhere(faces) + 0.5))
