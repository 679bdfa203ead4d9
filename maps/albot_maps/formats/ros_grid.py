"""Read ROS map_server maps: a picture of grid cells and the YAML that describes it.

The format is that of https://wiki.ros.org/map_server: a cell is occupied if its darkness
exceeds `occupied_thresh`. The outlines of the occupied cells become walls.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from jaxtyping import Bool, Float64, Int64
from scipy import ndimage

from albot_core.errors import InputError
from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.geometry.types import Pose, Segments
from albot_core.yaml_document import YamlDocument, format_value
from albot_maps.formats.picture import find_picture, read_shades
from albot_maps.formats.reachable import LEAST_SHARE, OPEN
from albot_maps.freespace import MARGIN
from albot_maps.world import LARGEST_COORDINATE, World

Cells = Bool[np.ndarray, "rows columns"]
"""One boolean per cell; the first row is the lowest on the map."""
MOST_RUNS = 500_000
"""Largest number of runs of occupied cells in a picture's rows; large buildings have about
ten thousand."""
_SIMPLIFIED_BY = 1.0
"""Largest distance (cells) of a corner that is left out from the simplified wall."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Description:
    """The content of a map's YAML."""

    picture: Path
    notes: tuple[str, ...]
    """What the reader assumed about the picture."""
    resolution: float
    """Length of a cell's side (m)."""
    origin: Pose
    """Pose of the map's lower left corner in the world."""
    occupied_above: float
    free_below: float
    negate: bool

    @property
    def home(self) -> Float64[np.ndarray, "2"]:
        """Position of the origin of the map's frame on the picture (cells)."""
        return np.asarray(inverse(self.origin)[:2] / self.resolution)


def read_ros_grid(document: YamlDocument, path: Path, robot_radius: float) -> World:
    """Return the world of a map_server map, for a robot of this radius (m).

    `document` is the map's YAML, read from `path`.

    Even a single occupied cell is kept: it may be a table's leg. Every wall lies within one cell
    of an occupied cell's edge, and every such edge within one cell of a wall. Unknown cells are
    not walls. The start is on free ground within walls, see `_start`.

    Raises:
        InputError: The YAML is invalid, the picture is missing or unreadable, or no free place
            is large enough for the robot.
    """
    description = _describe(document, path)
    occupied, free = _read_cells(description)
    if not occupied.any():
        raise InputError(description.picture, "at least one occupied cell", "none")
    walls = trace_cells(occupied, description.picture) * description.resolution
    start, notes = _start(occupied, free, description, robot_radius)
    return World(
        name=path.stem,
        walls=transform_segments(description.origin, walls),
        starts=np.array([[*transform_points(description.origin, start), 0.0]]),
        notes=(*description.notes, *notes),
        source=str(path),
        robot_radius=robot_radius,
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


def _start(
    occupied: Cells, free: Cells, description: _Description, robot_radius: float
) -> tuple[Float64[np.ndarray, "2"], tuple[str, ...]]:
    """Return the start (m, from the lower left corner of the map), and notes about it.

    It is the centre of the widest place in a connected part of the free cells in which a robot
    fits. Parts within walls come first: no robot gets from them over free cells to the edge of the
    picture. Of these it is the part with the origin of the map's frame, where the robot that made
    the map usually began; else the largest. Ground outside that is far larger than all of them
    comes before closets of a building that is open. If a robot gets out of all parts, the start
    lies among the walls all the same.
    """
    notes: tuple[str, ...] = ()
    parts = _Parts(free, description, robot_radius)
    if not free.any():  # As where all but the walls is transparent.
        parts = _Parts(~occupied, description, robot_radius)
        notes = ("no cell is free; the start is on unknown ones",)
    inside = parts.inside
    for among in (_hull(occupied), _near(occupied, description.resolution, robot_radius)):
        near_walls = parts.areas(among)
        within = np.where(inside, parts.areas(), 0)
        if within.max(initial=0) >= LEAST_SHARE * max(1, near_walls.max(initial=0)):
            home = parts.at(description.home)
            large = home and within[home - 1] >= _LEAST_HOME * within.max()
            return parts.widest(home if large else 1 + int(np.argmax(within))), notes
        if near_walls.max(initial=0):
            return parts.widest(1 + int(np.argmax(near_walls)), among), (*notes, OPEN)
    expected = f"free cells with room for a robot of radius {robot_radius:g} m"
    raise InputError(description.picture, expected, "none")


_LEAST_HOME = 0.01
"""The part with the frame's origin is preferred if its area is at least this share of that of the
largest part: it may be a pocket that the mapping left over."""


class _Parts:
    """The connected parts of the free cells in which a robot fits, numbered from 1.

    Args:
        free: The cells on which it may drive.
        description: The map.
        robot_radius: Radius of the robot (m).
    """

    def __init__(self, free: Cells, description: _Description, robot_radius: float) -> None:
        self._robot_radius = robot_radius
        self._resolution = resolution = description.resolution
        self._clearance = _depths(free)
        # A traced wall may lie one cell away from the cells that it represents.
        roomy = self._clearance * resolution > robot_radius + 2 * resolution
        self._labels, self.count = ndimage.label(roomy)
        self._free = free

    @property
    def inside(self) -> Bool[np.ndarray, "parts"]:
        """Whether a robot cannot get from each part to the edge of the picture."""
        # Beyond its edge a picture has no walls. Where every cell is free there are none at all.
        passable = np.ones_like(self._free)
        if not self._free.all():
            apart = ndimage.distance_transform_edt(self._free)
            passable = apart * self._resolution > self._robot_radius
        joined, count = ndimage.label(passable)
        leaves = np.zeros(count + 1, np.bool_)
        for edge in (joined[0], joined[-1], joined[:, 0], joined[:, -1]):
            leaves[edge] = True
        leaves[0] = False
        leaving = np.bincount(self._labels[leaves[joined]], minlength=self.count + 1)
        return np.asarray(leaving[1:] == 0)

    def areas(self, among: Cells | None = None) -> Int64[np.ndarray, "parts"]:
        """Return the number of cells of each part, of those of `among` if it is given."""
        labels = self._labels.ravel() if among is None else self._labels[among]
        return np.bincount(labels, minlength=self.count + 1)[1:]

    def at(self, place: Float64[np.ndarray, "2"]) -> int:
        """Return the number of the part at a place (cells); 0 if there is none."""
        column, row = np.floor(place).astype(int).tolist()
        rows, columns = self._labels.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return int(self._labels[row, column]) if inside else 0

    def widest(self, number: int, among: Cells | None = None) -> Float64[np.ndarray, "2"]:
        """Return the centre (m) of the cell of a part that is furthest from what is not free."""
        part = self._labels == number
        clearance = self._clearance
        if among is not None:
            part &= among
            # As far as possible from the end of the ground among the walls, too.
            clearance = np.minimum(clearance, _depths(among))
        row, column = np.unravel_index(np.argmax(clearance * part), part.shape)
        return (np.array([column, row]) + 0.5) * self._resolution


def _depths(cells: Cells) -> Float64[np.ndarray, "rows columns"]:
    """Return each cell's distance (cells) from the nearest that is not one of them, or the edge."""
    return np.asarray(ndimage.distance_transform_edt(np.pad(cells, 1))[1:-1, 1:-1])


def _hull(occupied: Cells) -> Cells:
    """Return the cells in the convex hull of the occupied cells."""
    rows, columns = np.nonzero(occupied)
    hull = shapely.MultiPoint(np.stack((columns, rows), axis=1)).convex_hull
    x, y = np.meshgrid(*(np.arange(length) for length in occupied.shape[::-1]))
    return np.asarray(shapely.contains_xy(hull, x, y))


def _near(occupied: Cells, resolution: float, robot_radius: float) -> Cells:
    """Return the cells in the rectangle around the occupied cells, widened as in `FreeSpace`."""
    margin = int((MARGIN - 1) * robot_radius / resolution)
    near = np.zeros_like(occupied)
    rows, columns = np.nonzero(occupied)
    row, column = max(0, rows.min() - margin), max(0, columns.min() - margin)
    near[row : rows.max() + margin + 1, column : columns.max() + margin + 1] = True
    return near


def _read_cells(description: _Description) -> tuple[Cells, Cells]:
    """Return which cells are occupied and which are free; the others are unknown."""
    shade = read_shades(description.picture)
    shade /= 255
    darkness = shade if description.negate else np.subtract(1, shade, out=shade)
    upward = darkness[::-1]
    return upward > description.occupied_above, upward < description.free_below


def _describe(document: YamlDocument, path: Path) -> _Description:
    fields = _Fields(document, path)
    x, y, yaw = fields.numbers("origin", 3)
    (resolution,) = fields.numbers("resolution", 1)
    if resolution <= 0:
        raise fields.error("resolution", "a positive length (m)")
    if document.data.get("mode", "trinary") not in ("trinary", "scale"):
        raise fields.error("mode", "trinary or scale")
    if document.data.get("negate") not in (0, 1):
        raise fields.error("negate", "0 or 1")
    occupied_above, free_below = fields.share("occupied_thresh"), fields.share("free_thresh")
    if free_below > occupied_above:  # A cell could be both.
        raise fields.error("free_thresh", f"at most occupied_thresh, {occupied_above:g}")
    picture, note = fields.picture()
    return _Description(
        picture=picture,
        notes=(note,) if note else (),
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

    def picture(self) -> tuple[Path, str]:
        """Return the path of the picture, and a note if it is not where the file says."""
        name = self._document.data.get("image")
        if not isinstance(name, str):
            raise self.error("image", "the name of a picture")
        found = find_picture(self._path.parent, name)
        if found is None:
            raise self.error("image", "a picture that exists")
        return found

    def error(self, key: str, expected: str) -> InputError:
        """Return the error for an invalid value at `key`."""
        data: dict[str, Any] = self._document.data
        found = format_value(data[key]) if key in data else "no such key"
        return InputError(self._path, expected, found, place=self._document.place((key,)))
