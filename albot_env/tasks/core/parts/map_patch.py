"""The part `map_patch`: what the mapper remembers around the robot, as egocentric rasters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.pose_kernels import rotate_back
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import MapperSpec
from albot_core.ranges import CELL, CELLS, POSITIVE, Range, check_fields
from albot_env.tasks.core.coverage_kernels import cut_patch
from albot_env.tasks.core.map_arrays import RaggedRows, TrailConfig
from albot_env.tasks.core.obstacle_kernels import ObstacleMemory, X, Y
from albot_env.tasks.core.parts.part import Need, ObservationPart, Sources
from albot_env.tasks.core.parts.scales import Channels, Scales

CHANNELS = Channels._fields
"""All channels, in their order in a patch."""
ON_REQUEST = ("obstacles",)
"""Channels that are shown only if they are named."""
_TRAIL = Range("a length above 0, at most 10,000 (m)", 0.0, 10_000.0, beyond=True)
_NEAR_BY = Range("a length above 0, at most 50 (m)", 0.0, 50.0, beyond=True)
_JUMP = 2.0
"""Points of a trail that are farther apart than this, along both axes together (m), are not
joined."""


@dataclass(frozen=True, kw_only=True)
class MapPatchConfig:
    """Scales, size and channels of the part `map_patch`.

    The robot is in the middle, its heading up: row 0 is farthest ahead, column 0 farthest to the
    left. All that is shown is believed: it comes from the mapper's map, its pose and the readings.
    """

    sides: tuple[float, ...] = (16.0, 64.0)
    """Sides of the squares that are shown at once, one scale after the other (m)."""
    cells: int = 32
    """Number of cells along each side."""
    channels: tuple[str, ...] | None = None
    """Names of the channels, of `CHANNELS`, in any order; None for all that the mapper can give,
    but `obstacles`:

    - `walls`: line segments, or occupied cells of an occupancy grid,
    - `free`: ground known to be free: of an occupancy grid, or else seen from within
      `CoverageConfig.radius`,
    - `trail`: where the robot has been: evenly from 1 at the latest position that the square shows
      down to almost 0 at the earliest, so that it tells on a small square, too, which way leads
      back,
    - `exits`: the lines across doorways of the place graph,
    - `home`: where home is believed; beyond the patch, at its edge in that direction,
    - `places`: the nodes of the place graph,
    - `obstacles`: where the laser saw surfaces during the last `obstacle_memory` metres, by
      odometry, and no beam has passed since; so a door that is shut, though the map knows it open,
      is known to be shut after the robot has turned away. It begins empty with each episode.

    1 is "here", -1 "not here or unknown"."""
    trail_spacing: float = 0.5
    """Distance between positions of the trail (m)."""
    trail_length: float = 200.0
    """Length of the trail that is remembered (m)."""
    obstacle_memory: float = 15.0
    """Distance that the robot travels until `obstacles` forgets a surface (m)."""
    obstacle_range: float = 5.0
    """Distance from the laser up to which `obstacles` marks surfaces and clears them (m)."""

    def __post_init__(self) -> None:
        check_fields(self, CELLS, "cells")
        check_fields(self, CELL, "trail_spacing")
        check_fields(self, _TRAIL, "trail_length")
        check_fields(self, _NEAR_BY, "obstacle_memory", "obstacle_range")
        sides: object = self.sides
        if not (
            isinstance(sides, tuple | list) and sides and all(side in POSITIVE for side in sides)
        ):
            raise InputError("MapPatchConfig.sides", "lengths above 0 (m)", str(self.sides))
        if self.trail_spacing > self.trail_length:
            expected = f"at most trail_length, {self.trail_length:g}"
            raise InputError("MapPatchConfig.trail_spacing", expected, f"{self.trail_spacing:g}")
        chosen: object = self.shown
        if not isinstance(chosen, tuple | list):
            expected = f"some of {', '.join(CHANNELS)}, or None"
            raise InputError("MapPatchConfig.channels", expected, repr(chosen))
        for name in chosen:
            if name not in CHANNELS:
                found = f"{name!r}{did_you_mean(str(name), CHANNELS)}"
                raise InputError("MapPatchConfig.channels", f"some of {', '.join(CHANNELS)}", found)
        if not chosen or len(set(chosen)) < len(chosen):
            expected = f"some of {', '.join(CHANNELS)}, each once"
            raise InputError("MapPatchConfig.channels", expected, str(list(chosen)))

    def chosen(self, spec: MapperSpec | None) -> tuple[str, ...]:
        """Return the channels to show with a mapper, in their order; None without a mapper.

        Raises:
            InputError: The mapper cannot give one that was asked for.
        """
        given = channels_of(spec)
        if self.channels is None:
            return tuple(name for name in given if name not in ON_REQUEST)
        for name in self.channels:
            if name not in given:
                mapper = "none" if spec is None else spec.name
                expected = f"some of {', '.join(given)}, which the mapper {mapper} can give"
                raise InputError("MapPatchConfig.channels", expected, name)
        return tuple(name for name in CHANNELS if name in self.channels)

    @property
    def shown(self) -> tuple[str, ...]:
        """The channels that are shown if the mapper can give them."""
        if self.channels is not None:
            return self.channels
        return tuple(name for name in CHANNELS if name not in ON_REQUEST)

    @property
    def trail(self) -> TrailConfig:
        """Which of the believed positions make a trail."""
        return TrailConfig(self.trail_spacing, round(self.trail_length / self.trail_spacing))


def channels_of(spec: MapperSpec | None) -> tuple[str, ...]:
    """Return the channels that a mapper's map has, in their order; None is "no mapper"."""
    layers = () if spec is None else spec.layers
    has = {
        "walls": "segments" in layers or "occupancy_grid" in layers,
        "exits": spec is not None and spec.has_exits,
        "places": "place_graph" in layers,
    }
    return tuple(name for name in CHANNELS if has.get(name, True))


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPatch:
    """What a patch shows, by channel."""

    sides: tuple[float, ...]
    """Sides of the squares (m), one per scale."""
    channels: dict[str, Float[np.ndarray, "scales cells cells"]] = field(default_factory=dict)
    """The channels that are shown, by name; see `MapPatchConfig.channels`."""


def _decode_map_patch(numbers: Float[np.ndarray, "layers cells cells"], scales: Scales) -> MapPatch:
    """Return the channels by name."""
    shown = scales.patches
    sides = tuple(shown.sides.tolist())
    rows = np.asarray(numbers).reshape(len(sides), -1, shown.cells, shown.cells)
    places = shown.channels._asdict()
    return MapPatch(
        sides=sides,
        channels={name: rows[:, place] for name, place in places.items() if place >= 0},
    )


MAP_PATCH = ObservationPart(
    name="map_patch",
    numbers="2 × 6 × 32 × 32",
    meaning=(
        "on request: what the mapper remembers around the robot, its heading up, in squares of "
        "16 m and 64 m, one channel each for walls, free ground, its own trail by age, exits, "
        "home and places, as far as the mapper can give them; if named, one for the obstacles "
        "that the laser saw lately (`MapPatchConfig`)"
    ),
    shape=lambda sizes: (sizes.map_layers, sizes.map_cells, sizes.map_cells),
    needs=frozenset((Need.GROUND, Need.MAP)),
    decode=_decode_map_patch,
)


class _View(NamedTuple):
    """Where and how large a patch is, in the map's frame."""

    x: float
    y: float
    """Position of the robot (m)."""
    cos: float
    sin: float
    """Cosine and sine of its heading."""
    cell: float
    """Side of a cell (m)."""
    cells: int
    """Number of cells along each side."""


@kernel()
def fill_map_patch(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in what robot i's mapper remembers, at all scales."""
    shown, belief = sources.scales.patches, sources.state.beliefs[i]
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    layers = 0
    for place in shown.channels:
        layers = max(layers, place + 1)
    size = layers * shown.cells * shown.cells
    for k in range(shown.sides.shape[0]):
        square = row[k * size : (k + 1) * size]
        for j in range(size):
            square[j] = np.float32(-1.0)
        view = _View(belief[0], belief[1], cos, sin, shown.sides[k] / shown.cells, shown.cells)
        _show_layers(i, sources, view, square)


@kernel()
def _show_layers(i: int, sources: Sources, view: _View, square: np.ndarray) -> None:
    """Show what robot i's mapper remembers, channel by channel, in a square that is empty yet."""
    maps, channels, area = sources.maps, sources.scales.patches.channels, view.cells * view.cells
    if channels.walls >= 0:
        _draw_segments(i, maps.walls, view, square[channels.walls * area :])
    if channels.free >= 0:
        _show_free(i, sources, view, square[channels.free * area :])
    if channels.trail >= 0:
        _draw_trail(i, maps.trail, view, square[channels.trail * area :])
    if channels.exits >= 0:
        _draw_segments(i, maps.exits, view, square[channels.exits * area :])
    if channels.home >= 0:
        home = sources.state.homes_in_robot[i]
        _draw_home(home, view, square[channels.home * area :])
    if channels.places >= 0:
        patch = square[channels.places * area :]
        for place in range(maps.places.counts[i]):
            x, y = maps.places.rows[i, place, 0], maps.places.rows[i, place, 1]
            _draw_point(x, y, 1.0, view, patch)
    if channels.obstacles >= 0:
        _draw_obstacles(i, sources.obstacles, view, square[channels.obstacles * area :])


@kernel()
def _draw_obstacles(i: int, memory: ObstacleMemory, view: _View, patch: np.ndarray) -> None:
    """Show the surfaces that robot i saw lately, as seen from where its odometer is now."""
    pose, points = memory.poses[i], memory.points[i]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    here = _View(pose[0], pose[1], cos, sin, view.cell, view.cells)
    for k in range(memory.counts[i]):
        _draw_point(points[k, X], points[k, Y], 1.0, here, patch)


@kernel()
def _show_free(i: int, sources: Sources, view: _View, patch: np.ndarray) -> None:
    """Show the free ground of robot i's occupancy grid, or else the ground it believes covered."""
    belief, turn, free = sources.state.beliefs[i], (view.cos, view.sin), sources.maps.free
    if free.sides[i] > 0:
        cut_patch(free, i, belief, turn, view.cell, view.cells, patch)
    else:
        cut_patch(sources.believed, i, belief, turn, view.cell, view.cells, patch)


@kernel()
def place_in(x: float, y: float, view: _View) -> tuple[float, float]:
    """Return column and row, in cells from the patch's upper left corner, of a point (map, m)."""
    ahead, left = rotate_back(view.cos, view.sin, x - view.x, y - view.y)
    half = 0.5 * view.cells
    return half - left / view.cell, half - ahead / view.cell


@kernel()
def _draw_point(x: float, y: float, value: float, view: _View, patch: np.ndarray) -> None:
    """Show a point (map, m), unless its cell shows a greater value already."""
    u, v = place_in(x, y, view)
    if min(u, v) >= 0.0:
        _show(int(u), int(v), value, view.cells, patch)


@kernel()
def _draw_trail(i: int, trail: RaggedRows, view: _View, patch: np.ndarray) -> None:
    """Show robot i's trail: 1 at the latest position shown, evenly down to the earliest one shown.

    Positions are joined by lines, but not where the belief jumped. A line is as old as its older
    end.
    """
    count, points, jump = trail.counts[i], trail.rows[i], _JUMP / view.cell
    shown = 0
    for k in range(count):
        shown += _is_shown(place_in(points[k, 0], points[k, 1], view), view)
    rank, u, v = 0, math.inf, math.inf
    for k in range(count):
        end_u, end_v = place_in(points[k, 0], points[k, 1], view)
        if abs(end_u - u) + abs(end_v - v) <= jump:
            # A line may cross a square on which no position lies.
            draw_line((u, v), (end_u, end_v), rank / max(shown, 1), view.cells, patch)
        u, v = end_u, end_v
        if _is_shown((u, v), view):
            rank += 1
            _show(int(u), int(v), rank / shown, view.cells, patch)


@kernel()
def _is_shown(place: tuple[float, float], view: _View) -> bool:
    """Return whether a place, as from `place_in`, is on the patch."""
    return min(place) >= 0.0 and max(place) < view.cells


@kernel()
def _draw_home(home: np.ndarray, view: _View, patch: np.ndarray) -> None:
    """Show home, whose pose is in the robot's frame; beyond the patch, at its edge."""
    half = 0.5 * view.cells
    ahead, left = home[0] / view.cell, home[1] / view.cell
    away = max(abs(ahead), abs(left))
    if away > half:
        ahead, left = ahead * half / away, left * half / away
    column = min(max(int(half - left), 0), view.cells - 1)
    row = min(max(int(half - ahead), 0), view.cells - 1)
    patch[row * view.cells + column] = np.float32(1.0)


@kernel()
def _draw_segments(i: int, segments: RaggedRows, view: _View, patch: np.ndarray) -> None:
    """Show the cells through which robot i's segments x1, y1, x2, y2 (map, m) pass."""
    for k in range(segments.counts[i]):
        ends = segments.rows[i, k]
        u, v = place_in(ends[0], ends[1], view)
        end_u, end_v = place_in(ends[2], ends[3], view)
        draw_line((u, v), (end_u, end_v), 1.0, view.cells, patch)


@kernel()
def draw_line(
    start: tuple[float, float],
    end: tuple[float, float],
    value: float,
    cells: int,
    patch: np.ndarray,
) -> None:
    """Show the cells of a square patch through which a line passes, unless they show more already.

    The line leads from column and row to column and row (cells).

    The part on the patch is found as in Liang and Barsky, A new concept and method for line
    clipping (ACM Transactions on Graphics 3, 1984); its cells as in Amanatides and Woo, A fast
    voxel traversal algorithm for ray tracing (Eurographics 1987).
    """
    u, v = start
    du, dv = end[0] - u, end[1] - v
    # Most lines are beside the patch, or in one cell of a coarse one.
    if int(u) == int(end[0]) and int(v) == int(end[1]) and min(u, v, *end) >= 0.0:
        _show(int(u), int(v), value, cells, patch)
        return
    first, last = _within(u, du, cells, 0.0, 1.0)
    first, last = _within(v, dv, cells, first, last)
    if first > last:
        return
    column = min(max(int(u + first * du), 0), cells - 1)
    row = min(max(int(v + first * dv), 0), cells - 1)
    right, down = (1 if du > 0.0 else -1), (1 if dv > 0.0 else -1)
    # The shares of the line at which it comes into the next column and row.
    next_u = (column + (right > 0) - u) / du if du != 0.0 else math.inf
    next_v = (row + (down > 0) - v) / dv if dv != 0.0 else math.inf
    step_u = abs(1.0 / du) if du != 0.0 else math.inf
    step_v = abs(1.0 / dv) if dv != 0.0 else math.inf
    while _show(column, row, value, cells, patch) and min(next_u, next_v) < last:
        if next_u < next_v:
            column += right
            next_u += step_u
        else:
            row += down
            next_v += step_v


@kernel()
def _show(column: int, row: int, value: float, cells: int, patch: np.ndarray) -> bool:
    """Show a value in a cell, unless it shows more already; return whether the patch has it."""
    if column < 0 or column >= cells or row < 0 or row >= cells:
        return False
    cell = row * cells + column
    patch[cell] = max(patch[cell], np.float32(value))
    return True


@kernel()
def _within(at: float, along: float, cells: int, first: float, last: float) -> tuple[float, float]:
    """Return the shares of a line between which it is also on the patch along one axis."""
    if along == 0.0:
        return (first, last) if 0.0 <= at < cells else (1.0, 0.0)
    low, high = -at / along, (cells - at) / along
    return max(first, min(low, high)), min(last, max(low, high))
