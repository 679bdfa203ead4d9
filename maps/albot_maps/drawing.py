"""Draw a world as a floor plan. Import it only where a picture is needed: it is slow to load."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from shapely.plotting import patch_from_polygon

from albot_core.drawing.figure import round_length
from albot_core.drawing.labels import Label, place_labels
from albot_core.drawing.palette import (
    BELIEVED,
    CORRECTED,
    EXIT,
    HOME,
    PARTICLE,
    PLACE,
    SOLID,
    TEXT,
    TINTS,
    TRUTH,
    WALL,
)
from albot_core.geometry.types import Points
from albot_maps.freespace import FreeSpace
from albot_maps.movables import Door, Movables, Walker
from albot_maps.world import World

_LONGER_SIDE = 11.0
"""The picture's longer side (inches)."""
_PLAN_SIDE, _LARGEST_SHEET = 4.0, 24.0
"""Side of one plan on a sheet with several, and largest side of the sheet (inches)."""
_MOST_WITH_NAMES = 4
"""Largest number of plans on a sheet that still get names; with more, names overlap."""
_SMALLESTHOME = 0.004
"""Least radius of a start's disc, as a share of the plan's longer side: it is to be seen."""
_MOST_NAMED = 150
"""Largest number of exits that are named."""
_HAIR = 1e-3
"""Half the wall width (m) used to find the regions of floor to fill."""


def world_figure(world: World, *, tours: Iterable[str] = ()) -> Figure:
    """Return the plan of a world, with the tours named in `tours`."""
    x_min, y_min, x_max, y_max = world.bounds
    size = np.array([x_max - x_min, y_max - y_min])
    figure = Figure(figsize=tuple(np.maximum(size / size.max() * _LONGER_SIDE, 3.0)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_world(world, axes, tours=tours, names=True)
    return figure


def sheet_figure(worlds: Sequence[World]) -> Figure:
    """Return the plans of several worlds at one scale, each titled with its source."""
    columns = math.isqrt(len(worlds) - 1) + 1
    rows = -(-len(worlds) // columns)
    side = min(_PLAN_SIDE, _LARGEST_SHEET / columns)
    figure = Figure(figsize=(side * columns, side * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    # All plans get the same extent, and thus one scale and one length of the scale bar.
    corners = [np.reshape(_limits(world), (2, 2)) for world in worlds]
    extent = np.max([high - low for low, high in corners], axis=0)
    bar = round_length(float(extent[0]))
    names = len(worlds) <= _MOST_WITH_NAMES
    for axes in grid:
        axes.set_axis_off()
    for world, axes, (low, high) in zip(worlds, grid, corners, strict=False):
        axes.set_title(world.source, fontsize=8, color=TEXT)
        middle = (low + high) / 2
        limits = np.ravel((middle - extent / 2, middle + extent / 2))
        draw_world(world, axes, names=names, limits=limits, bar=bar)
    return figure


def draw_world(
    world: World,
    axes: Axes,
    *,
    tours: Iterable[str] = (),
    names: bool = True,
    limits: Float64[np.ndarray, "4"] | None = None,
    bar: float | None = None,
) -> None:
    """Draw floor, rooms, walls, exits, movables, starts, a scale bar and the tours in `tours`.

    Light blue is glass. Grey is what the robot cannot reach behind walls: the inside of
    furniture and of thick walls, and closed rooms. The name of a room is left out if it does not
    fit into it.

    Args:
        world: The world.
        axes: Where to draw.
        tours: Names of tours to draw.
        names: Whether to write the names of rooms and exits.
        limits: Smallest x, y and largest x, y (m); None for the plan with a margin.
        bar: Length of the scale bar (m); None for a round one.
    """
    x0, y0, x1, y1 = _limits(world) if limits is None else limits
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    axes.set_axis_off()
    rooms = _draw_floor(world, axes)
    for walls, colour in ((world.opaque, WALL), (world.walls[world.glass], CORRECTED)):
        axes.add_collection(LineCollection(list(walls.reshape(-1, 2, 2)), colors=colour, lw=1.2))
    for name in tours:
        axes.plot(*world.tours[name].T, color=TRUTH, lw=1.2)
    for x1, y1, x2, y2 in (opening.segment for opening in world.exits):
        axes.plot([x1, x2], [y1, y2], color=EXIT, lw=2.5)
    draw_movables(world.movables, axes)
    x_min, y_min, x_max, y_max = world.bounds
    radius = max(world.robot_radius, _SMALLESTHOME * max(x_max - x_min, y_max - y_min))
    for x, y, heading in world.starts:
        axes.add_patch(Circle((x, y), radius, color=HOME, zorder=3))
        nose = 2.5 * radius * np.array([np.cos(heading), np.sin(heading)])
        axes.plot([x, x + nose[0]], [y, y + nose[1]], color=HOME, lw=1.5)
    _draw_bar(world, axes, bar)
    if names:
        _write_names(world, axes, rooms)


def _draw_floor(world: World, axes: Axes) -> list[shapely.Polygon]:
    """Shade what walls close off, and tint the part of each room that the robot can reach.

    Return the largest piece of each such part.
    """
    space = FreeSpace(world.walls, _HAIR)
    floor = space.region_at(world.starts[0, :2])
    shut = [
        patch_from_polygon(region)
        for region in space.regions
        if region is not floor
        and space.is_enclosed(np.array(region.representative_point().coords[0]))
    ]
    axes.add_collection(PatchCollection(shut, facecolor=SOLID, edgecolor="none"))
    rooms = []
    for index, room in enumerate(world.rooms):
        pieces = shapely.get_parts(floor.intersection(shapely.Polygon(room.boundary)))
        polygons = [piece for piece in pieces if piece.geom_type == "Polygon"]
        patches = [patch_from_polygon(polygon) for polygon in polygons]
        tint = TINTS[index % len(TINTS)]
        axes.add_collection(PatchCollection(patches, facecolor=tint, edgecolor="none"))
        rooms.append(max(polygons, key=lambda polygon: float(polygon.area)))
    return rooms


def _write_names(world: World, axes: Axes, rooms: Sequence[shapely.Polygon]) -> None:
    """Name rooms within their walls, and exits beside them, none over another.

    Of very many exits none is named: the names would cover the plan.
    """
    size = _text_size(world)
    labels = [
        Label(text=room.name, at=_middle(room.boundary), size=size, within=outline)
        for room, outline in zip(world.rooms, rooms, strict=True)
    ]
    labels += [
        Label(
            text=opening.name,
            at=_middle(np.reshape(opening.segment, (2, 2))),
            colour=WALL,
            size=max(0.7 * size, 4.0),
            radius=2.0,
        )
        for opening in (world.exits if len(world.exits) <= _MOST_NAMED else ())
    ]
    place_labels(axes, labels, segments=world.walls, points=world.starts[:, :2])


def _middle(points: Points) -> tuple[float, float]:
    x, y = np.mean(points, axis=0)
    return float(x), float(y)


def _text_size(world: World) -> float:
    """Size of the names (points): smaller on a larger floor."""
    x_min, y_min, x_max, y_max = world.bounds
    return float(np.clip(420.0 / max(x_max - x_min, y_max - y_min), 4.0, 13.0))


def _limits(world: World) -> Float64[np.ndarray, "4"]:
    """Return the smallest x, y and the largest x, y of a plan with its margin and scale bar (m)."""
    x_min, y_min, x_max, y_max = world.bounds
    margin = 0.04 * max(x_max - x_min, y_max - y_min)
    starts = world.starts[:, :2]
    low = np.minimum((x_min - margin, y_min - 2 * margin), starts.min(axis=0) - 0.5)
    high = np.maximum((x_max + margin, y_max + margin), starts.max(axis=0) + 0.5)
    return np.concatenate((low, high))


def _draw_bar(world: World, axes: Axes, length: float | None) -> None:
    """Draw a scale bar below the plan, of `length` (m) if given."""
    x_min, y_min, x_max, y_max = world.bounds
    length = round_length(x_max - x_min) if length is None else length
    y = y_min - 0.048 * max(x_max - x_min, y_max - y_min)
    axes.plot([x_min, x_min + length], [y, y], color=WALL, lw=3, solid_capstyle="butt")
    axes.annotate(
        f"{length:g} m",
        (x_min + length, y),
        xytext=(6, 0),
        textcoords="offset points",
        va="center",
        fontsize=9,
        color=WALL,
    )


def draw_movables(movables: Movables, axes: Axes) -> None:
    """Draw closed doors with the arc they sweep, boxes, and walkers with their routes."""
    for door in movables.doors:
        _draw_door(door, axes)
    for box in movables.boxes:
        axes.add_patch(Polygon(box.corners, facecolor=PARTICLE, edgecolor=WALL, lw=0.8))
    for walker in movables.walkers:
        _draw_walker(walker, axes)


def _draw_door(door: Door, axes: Axes) -> None:
    tip = np.array(door.hinge) + door.width * np.array([np.cos(door.heading), np.sin(door.heading)])
    axes.plot(*np.stack((door.hinge, tip)).T, color=BELIEVED, lw=2.5)
    axes.plot(*np.array(door.sweep.exterior.coords).T, color=BELIEVED, lw=0.8, ls=":")


def _draw_walker(walker: Walker, axes: Axes) -> None:
    points = [*walker.route, walker.route[0]] if walker.closed else walker.route
    axes.plot(*np.array(points).T, color=PLACE, lw=1.0, ls="--")
    axes.add_patch(Circle(walker.route[0], walker.radius, color=PLACE))
