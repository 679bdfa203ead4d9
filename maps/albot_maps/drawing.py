"""Draw a world as a floor plan. Import it only where a picture is needed: it is slow to load."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from shapely.plotting import patch_from_polygon

from albot_core.files import atomic_write
from albot_maps.freespace import FreeSpace
from albot_maps.movables import Door, Movables, Walker
from albot_maps.world import World

_SOLID, _WALL, _TEXT = "#dcdcd8", "#22262b", "#59626d"
_GLASS = "#8fc4e8"
_EXIT, _START, _TOUR = "#0a8a5f", "#c8371f", "#3b6fb6"
_TINTS = ("#e6f0fb", "#fdf1df", "#e5f5e9", "#f4e9f7", "#fdeae6", "#f2f1dc")
_LONGER_SIDE = 11.0
"""The picture's longer side (inches)."""
_PLAN_SIDE = 4.0
"""Side of one plan on a sheet with several (inches)."""
_MOST_WITH_NAMES = 4
"""Largest number of plans on a sheet that still get names; with more, names overlap."""
_SMALLEST_START = 0.004
"""Least radius of a start's disc, as a share of the plan's longer side: it is to be seen."""
_HAIR = 1e-3
"""Half the wall width (m) used to find the regions of floor to fill."""


def save_picture(world: World, path: Path, *, tours: Iterable[str] = ()) -> None:
    """Write the plan of a world, with the tours named in `tours`, to a PNG file."""
    x_min, y_min, x_max, y_max = world.bounds
    size = np.array([x_max - x_min, y_max - y_min])
    figure = Figure(figsize=tuple(np.maximum(size / size.max() * _LONGER_SIDE, 3.0)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_world(world, axes, tours=tours)
    with atomic_write(path) as stream:
        figure.savefig(stream, format="png", dpi=120)


def save_sheet(worlds: Sequence[World], path: Path) -> None:
    """Write the plans of several worlds, each titled with its source, to one PNG file."""
    columns = math.isqrt(len(worlds) - 1) + 1
    rows = -(-len(worlds) // columns)
    figure = Figure(figsize=(_PLAN_SIDE * columns, _PLAN_SIDE * rows), layout="tight")
    for index, world in enumerate(worlds, 1):
        axes = figure.add_subplot(rows, columns, index)
        draw_world(world, axes, names=len(worlds) <= _MOST_WITH_NAMES)
        axes.set_title(world.source, fontsize=8, color=_TEXT)
    with atomic_write(path) as stream:
        figure.savefig(stream, format="png", dpi=100)


def draw_world(world: World, axes: Axes, *, tours: Iterable[str] = (), names: bool = True) -> None:
    """Draw floor, rooms, walls, exits, movables, starts, a scale bar and the tours in `tours`.

    Light blue is glass. Grey is what the robot cannot reach behind walls: the inside of
    furniture and of thick walls, and closed rooms.
    """
    _draw_floor(world, axes, names)
    for walls, colour in ((world.opaque, _WALL), (world.walls[world.glass], _GLASS)):
        axes.add_collection(LineCollection(list(walls.reshape(-1, 2, 2)), colors=colour, lw=1.2))
    for name in tours:
        axes.plot(*world.tours[name].T, color=_TOUR, lw=1.2, alpha=0.7)
    _draw_exits(world, axes, names)
    draw_movables(world.movables, axes)
    x_min, y_min, x_max, y_max = world.bounds
    radius = max(world.robot_radius, _SMALLEST_START * max(x_max - x_min, y_max - y_min))
    for x, y, heading in world.starts:
        axes.add_patch(Circle((x, y), radius, color=_START, zorder=3))
        nose = 2.5 * radius * np.array([np.cos(heading), np.sin(heading)])
        axes.plot([x, x + nose[0]], [y, y + nose[1]], color=_START, lw=1.5)
    _frame(world, axes)


def _draw_floor(world: World, axes: Axes, names: bool) -> None:
    """Shade what walls close off; tint and name the part of each room that the robot can reach."""
    space = FreeSpace(world.walls, _HAIR)
    floor = space.region_at(world.starts[0, :2])
    shut = [
        patch_from_polygon(region)
        for region in space.regions
        if region is not floor
        and space.is_enclosed(np.array(region.representative_point().coords[0]))
    ]
    axes.add_collection(PatchCollection(shut, facecolor=_SOLID, edgecolor="none"))
    starts = shapely.MultiPoint(world.starts[:, :2]).buffer(2 * world.robot_radius)
    for index, room in enumerate(world.rooms):
        pieces = shapely.get_parts(floor.intersection(shapely.Polygon(room.boundary)))
        polygons = [piece for piece in pieces if piece.geom_type == "Polygon"]
        patches = [patch_from_polygon(polygon) for polygon in polygons]
        tint = _TINTS[index % len(_TINTS)]
        axes.add_collection(PatchCollection(patches, facecolor=tint, edgecolor="none"))
        if not names:
            continue
        widest = max(polygons, key=lambda polygon: float(polygon.area))
        x, y = shapely.maximum_inscribed_circle(widest.difference(starts), tolerance=0.1).coords[0]
        size = _text_size(world)
        axes.text(x, y, room.name, color=_TEXT, fontsize=size, ha="center", va="center")


def _draw_exits(world: World, axes: Axes, names: bool) -> None:
    for opening in world.exits:
        x1, y1, x2, y2 = opening.segment
        axes.plot([x1, x2], [y1, y2], color=_EXIT, lw=2.5)
        if not names:
            continue
        axes.annotate(
            opening.name,
            ((x1 + x2) / 2, (y1 + y2) / 2),
            xytext=(4, 4),
            textcoords="offset points",
            color=_EXIT,
            fontsize=0.8 * _text_size(world),
        )


def _text_size(world: World) -> float:
    """Size of the names (points): smaller on a larger floor."""
    x_min, y_min, x_max, y_max = world.bounds
    return float(np.clip(420.0 / max(x_max - x_min, y_max - y_min), 4.0, 13.0))


def _frame(world: World, axes: Axes) -> None:
    """Set the axes' limits and draw a scale bar below the plan."""
    x_min, y_min, x_max, y_max = world.bounds
    margin = 0.04 * max(x_max - x_min, y_max - y_min)
    low = np.minimum((x_min - margin, y_min - 2 * margin), world.starts[:, :2].min(axis=0) - 0.5)
    high = np.maximum((x_max + margin, y_max + margin), world.starts[:, :2].max(axis=0) + 0.5)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()
    length = 10.0 ** np.floor(np.log10((x_max - x_min) / 2))
    y = y_min - 1.2 * margin
    axes.plot([x_min, x_min + length], [y, y], color=_WALL, lw=3, solid_capstyle="butt")
    axes.annotate(
        f"{length:g} m",
        (x_min + length, y),
        xytext=(6, 0),
        textcoords="offset points",
        va="center",
        fontsize=9,
        color=_WALL,
    )


_DOOR, _BOX, _WALKER = "#8a5a2b", "#c9a36b", "#7b3fa0"


def draw_movables(movables: Movables, axes: Axes) -> None:
    """Draw closed doors with the arc they sweep, boxes, and walkers with their routes."""
    for door in movables.doors:
        _draw_door(door, axes)
    for box in movables.boxes:
        axes.add_patch(Polygon(box.corners, facecolor=_BOX, edgecolor=_DOOR, lw=0.8))
    for walker in movables.walkers:
        _draw_walker(walker, axes)


def _draw_door(door: Door, axes: Axes) -> None:
    tip = np.array(door.hinge) + door.width * np.array([np.cos(door.heading), np.sin(door.heading)])
    axes.plot(*np.stack((door.hinge, tip)).T, color=_DOOR, lw=2.5)
    axes.plot(*np.array(door.sweep.exterior.coords).T, color=_DOOR, lw=0.8, ls=":")


def _draw_walker(walker: Walker, axes: Axes) -> None:
    points = [*walker.route, walker.route[0]] if walker.closed else walker.route
    axes.plot(*np.array(points).T, color=_WALKER, lw=1.0, ls="--", alpha=0.7)
    axes.add_patch(Circle(walker.route[0], walker.radius, color=_WALKER))
