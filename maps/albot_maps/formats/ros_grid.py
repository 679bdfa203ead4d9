"""Read ROS map_server maps: a picture of grid cells and the YAML that describes it.

The format is that of https://wiki.ros.org/map_server: a cell is occupied if its darkness
exceeds `occupied_thresh`. The outlines of the occupied cells become walls.
"""

from __future__ import annotations

import struct
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from jaxtyping import Bool, Float64
from PIL import Image, UnidentifiedImageError
from scipy import ndimage

from albot_core.errors import InputError
from albot_core.files import exists, read_bytes
from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.geometry.types import Pose, Segments
from albot_core.yaml_document import YamlDocument, format_value
from albot_maps.world import LARGEST_COORDINATE, ROBOT_RADIUS, World

Cells = Bool[np.ndarray, "rows columns"]
"""One boolean per cell; the first row is the lowest on the map."""


LARGEST = 1 << 24
"""Largest number of cells of a picture: 200 m by 200 m in cells of 5 cm. A file of a few kilobytes
can unpack to more than fits in memory."""
MOST_RUNS = 500_000
"""Largest number of runs of occupied cells in a picture's rows; large buildings have about
ten thousand."""
_SIMPLIFIED_BY = 1.0
"""Largest distance (cells) of a corner that is left out from the simplified wall."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Description:
    """The content of a map's YAML."""

    picture: Path
    resolution: float
    """Length of a cell's side (m)."""
    origin: Pose
    """Pose of the map's lower left corner in the world."""
    occupied_above: float
    free_below: float
    negate: bool


def read_ros_grid(document: YamlDocument, path: Path) -> World:
    """Return the world of a map_server map, whose YAML is `document`, read from `path`.

    Even a single occupied cell is kept: it may be a table's leg. Every wall lies within one cell
    of an occupied cell's edge, and every such edge within one cell of a wall. Unknown cells are
    not walls. The start is the centre of the widest place in the largest connected part of the
    free cells in which the robot fits.

    Raises:
        InputError: The YAML is invalid, the picture is missing or unreadable, or no free place
            is large enough for the robot.
    """
    description = _describe(document, path)
    occupied, free = _read_cells(description)
    if not occupied.any():
        raise InputError(description.picture, "at least one occupied cell", "none")
    walls = trace_cells(occupied, description.picture) * description.resolution
    start = _start(occupied, free, description)
    return World(
        name=path.stem,
        walls=transform_segments(description.origin, walls),
        starts=np.array([[*transform_points(description.origin, start), 0.0]]),
        source=str(path),
    )


def trace_cells(occupied: Cells, source: Path) -> Segments:
    """Return the outlines of the occupied cells, simplified by at most one cell's side.

    Coordinates are in cells, from the lower left corner of the map. `source` names the map in
    errors.

    Raises:
        InputError: There are more than `MOST_RUNS` runs of occupied cells.
    """
    runs = occupied[:, 0].sum() + (occupied[:, 1:] & ~occupied[:, :-1]).sum()
    if runs > MOST_RUNS:
        raise InputError(source, f"{MOST_RUNS:,} runs of dark cells at most", f"{runs:,}")
    rows, lefts, rights = _runs(occupied)
    blobs = shapely.unary_union(shapely.box(lefts, rows, rights, rows + 1))
    outlines = shapely.get_rings(shapely.get_parts(blobs))
    rings = [_simplified(np.array(outline.coords)) for outline in outlines]
    return np.concatenate([np.concatenate((ring[:-1], ring[1:]), axis=1) for ring in rings])


def _simplified(
    ring: Float64[np.ndarray, "corners 2"],
) -> Float64[np.ndarray, "kept 2"]:
    """Return a closed line with fewer corners; unchanged if it would collapse to one segment.

    Its two halves are simplified separately, because simplification keeps the ends of a line.
    """
    far = int(np.argmax(((ring - ring[0]) ** 2).sum(axis=1)))
    halves = shapely.simplify(
        [shapely.LineString(ring[: far + 1]), shapely.LineString(ring[far:])],
        _SIMPLIFIED_BY,
        preserve_topology=False,
    )
    first, second = (np.array(half.coords) for half in halves)
    return ring if len(first) == len(second) == 2 else np.concatenate((first, second[1:]))


def _runs(
    cells: Cells,
) -> tuple[Float64[np.ndarray, "runs"], Float64[np.ndarray, "runs"], Float64[np.ndarray, "runs"]]:
    """Return row, left end and right end of every run of true cells."""
    padded = np.pad(cells, ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(padded, axis=1)
    rows, lefts = np.nonzero(change == 1)
    _, rights = np.nonzero(change == -1)
    return rows.astype(np.float64), lefts.astype(np.float64), rights.astype(np.float64)


def _start(occupied: Cells, free: Cells, description: _Description) -> Float64[np.ndarray, "2"]:
    """Return the centre (m) of the free cell that is furthest from walls and unknown cells."""
    clearance = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    # A traced wall may lie one cell away from the cells that it represents.
    roomy = clearance * description.resolution > ROBOT_RADIUS + 2 * description.resolution
    parts, count = ndimage.label(roomy)
    if not count:
        expected = f"free cells with room for a robot of radius {ROBOT_RADIUS} m"
        raise InputError(description.picture, expected, "none")
    largest = 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
    row, column = np.unravel_index(np.argmax(clearance * (parts == largest)), occupied.shape)
    return (np.array([column, row]) + 0.5) * description.resolution


def _read_cells(description: _Description) -> tuple[Cells, Cells]:
    """Return which cells are occupied and which are free; the others are unknown."""
    shade = read_shades(description.picture)
    shade /= 255
    darkness = shade if description.negate else np.subtract(1, shade, out=shade)
    upward = darkness[::-1]
    return upward > description.occupied_above, upward < description.free_below


def read_shades(path: Path) -> Float64[np.ndarray, "rows columns"]:
    """Return the picture's brightness, 0 to 255; of a coloured picture, the mean of its channels.

    A picture of more than `LARGEST` cells is not unpacked.

    Raises:
        InputError: The file cannot be read, is not a PGM or PNG with 8 bits per channel, or has
            more than `LARGEST` cells.
    """
    content = read_bytes(path, _BYTES * LARGEST)
    expected = "an intact PGM or PNG image"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # We count the cells.
            picture = Image.open(BytesIO(content), formats=("PNG", "PPM"))
        with picture:
            _check_picture(path, picture)
            colours: np.ndarray = np.asarray(picture.convert("RGB"))
    except InputError:
        raise
    except UnidentifiedImageError:  # Its message contains a memory address.
        raise InputError(path, expected, "another format") from None
    except Image.DecompressionBombError:
        raise InputError(path, f"{LARGEST:,} cells at most", "more") from None
    except _CORRUPT as error:
        raise InputError(path, expected, str(error)) from None
    return np.asarray(colours.mean(axis=2))


_BYTES = 4
"""Largest number of bytes per cell in a file: three digits and a space."""
_CORRUPT = (OSError, SyntaxError, ValueError, EOFError, IndexError, OverflowError, struct.error)
"""What Pillow raises for truncated or corrupt files."""


def _check_picture(path: Path, picture: Image.Image) -> None:
    """Raise InputError for a picture that is too large or has an unsupported mode.

    This happens before the picture is unpacked.
    """
    width, height = picture.size
    if width * height > LARGEST:
        raise InputError(path, f"{LARGEST:,} cells at most", f"{width:,} x {height:,}")
    if picture.mode.startswith(("I", "F")):
        raise InputError(path, "8 bits a channel", f"the mode {picture.mode}")


def _describe(document: YamlDocument, path: Path) -> _Description:
    fields = _Fields(document, path)
    x, y, yaw = fields.numbers("origin", 3)
    (resolution,) = fields.numbers("resolution", 1)
    if resolution <= 0:
        raise fields.error("resolution", "a positive length (m)")
    if document.data.get("mode", "trinary") not in {"trinary", "scale"}:
        raise fields.error("mode", "trinary or scale")
    if document.data.get("negate") not in {0, 1}:
        raise fields.error("negate", "0 or 1")
    occupied_above, free_below = fields.share("occupied_thresh"), fields.share("free_thresh")
    if free_below > occupied_above:  # A cell could be both.
        raise fields.error("free_thresh", f"at most occupied_thresh, {occupied_above:g}")
    return _Description(
        picture=fields.picture(),
        resolution=resolution,
        origin=np.array([x, y, yaw]),
        occupied_above=occupied_above,
        free_below=free_below,
        negate=bool(document.data["negate"]),
    )


class _Fields:
    """The values of a map's YAML; each is checked when it is accessed."""

    def __init__(self, document: YamlDocument, path: Path) -> None:
        self._document = document
        self._path = path

    def numbers(self, key: str, count: int) -> list[float]:
        """Return the `count` finite numbers at `key`."""
        value = self._document.data.get(key)
        values = value if isinstance(value, list) else [value]
        plain = [item for item in values if isinstance(item, int | float)]
        within = (np.abs(np.array(plain, np.float64)) <= LARGEST_COORDINATE).all()
        if len(plain) != len(values) or len(values) != count or not within:
            expected = "a number" if count == 1 else f"{count} numbers"
            raise self.error(key, f"{expected} within ±{LARGEST_COORDINATE:g}")
        return [float(item) for item in plain]

    def share(self, key: str) -> float:
        """Return the number in [0, 1] at `key`."""
        (value,) = self.numbers(key, 1)
        if not 0 <= value <= 1:
            raise self.error(key, "a number from 0 to 1")
        return value

    def picture(self) -> Path:
        """Return the path of the picture, which may be gzipped."""
        name = self._document.data.get("image")
        if not isinstance(name, str):
            raise self.error("image", "the name of a picture")
        path = self._path.parent / name
        for choice in (path, path.parent / f"{path.name}.gz"):
            if exists(choice) and not choice.is_dir():
                return choice
        raise self.error("image", "a picture that exists")

    def error(self, key: str, expected: str) -> InputError:
        """Return the error for an invalid value at `key`."""
        data: dict[str, Any] = self._document.data
        found = format_value(data[key]) if key in data else "no such key"
        return InputError(self._path, expected, found, place=self._document.place((key,)))
