"""Drawing of maps beside and over the true floors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from albot_core.drawing.figure import draw_scale_bar, round_length
from albot_core.drawing.labels import Label, place_labels
from albot_core.drawing.palette import BELIEVED, FAINT, HOME, SERIES, WALL
from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Poses, Segments
from albot_core.maps.layers import PlaceGraph
from albot_maps.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOOR, SURFACE, PATH, MARK = FAINT, WALL, BELIEVED, HOME
"""Colours of true walls, of the map, of the robot's path, and of highlights."""


def draw_floor(
    axes: Axes,
    walls: Segments,
    colour: str = FLOOR,
    width: float = 0.8,
    label: str = "true walls",
) -> None:
    """Draw walls, in any one frame, and fit the axes to them."""
    from matplotlib.collections import LineCollection

    lines = list(walls.reshape(-1, 2, 2))
    axes.add_collection(LineCollection(lines, colors=colour, lw=width, label=label))
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()


def draw_route(axes: Axes, world: World, way: Points) -> None:
    """Draw a floor and a route over it, with a dot at its beginning and arrows along it."""
    draw_floor(axes, world.walls, SURFACE)
    axes.plot(way[:, 0], way[:, 1], color=PATH, lw=1.2, label="route")
    axes.plot(*way[0], "o", color=MARK, ms=6, ls="none", label="start")
    for index in range(6, len(way) - 1, max(8, len(way) // 12)):
        axes.annotate(
            "",
            tuple(way[index + 1]),
            tuple(way[index]),
            arrowprops={"arrowstyle": "-|>", "color": PATH, "lw": 1.2},
        )


def draw_map(axes: Axes, world: World, surfaces: Segments, poses: Poses, frame: Pose) -> None:
    """Draw a map and the estimated path, placed on the true walls.

    Args:
        axes: Where to draw.
        world: The floor.
        surfaces: The map's surfaces, in the map's frame.
        poses: (views, 3): the estimated poses, in the map's frame.
        frame: The map's frame as a pose in the world's.
    """
    draw_floor(axes, world.walls)
    draw_floor(axes, transform_segments(frame, surfaces), SURFACE, 1.2, "surfaces of the map")
    way = compose(frame, poses)
    axes.plot(way[:, 0], way[:, 1], color=PATH, lw=0.8, label="estimated path")


def draw_points(axes: Axes, world: World, points: Points, poses: Poses, frame: Pose) -> None:
    """Draw a map as `draw_map` does, for a map of points (n, 2) in its own frame (m)."""
    draw_floor(axes, world.walls)
    axes.plot(
        *transform_points(frame, points).T, ".", color=SURFACE, ms=1, label="cells of the map"
    )
    axes.plot(*compose(frame, poses)[:, :2].T, color=PATH, lw=0.8, label="estimated path")


def draw_place_graph(axes: Axes, world: World, graph: PlaceGraph, frame: Pose) -> None:
    """Draw places, each in its colour, their exits, and the links between them.

    Args:
        axes: Where to draw.
        world: The floor, drawn beneath.
        graph: The places, drawn at their positions in the map when they were learned.
        frame: The map's frame as a pose in the world's.
    """
    draw_floor(axes, world.walls)
    for one, other in graph.links:
        ends = [transform_points(frame, graph.node(place).middle) for place in (one, other)]
        axes.plot(*zip(*ends, strict=True), color=MARK, lw=1.2, ls=":", label="links")
    for node in graph.nodes:
        colour = SERIES[node.id % len(SERIES)]
        lay = compose(frame, node.pose)
        draw_floor(axes, transform_segments(lay, node.segments), colour, 1.4, "")
        for edge in graph.edges:
            if edge.source == node.id and edge.doorway is not None:
                x1, y1, x2, y2 = transform_segments(lay, edge.doorway[None])[0]
                axes.plot(
                    (x1, x2),
                    (y1, y2),
                    color=colour,
                    lw=3.0,
                    alpha=0.6,
                    label="exits, in their places' colours",
                )
    labels = [
        Label(
            text=node.label,
            at=tuple(transform_points(frame, node.middle).tolist()),
            colour=SERIES[node.id % len(SERIES)],
            size=11.0,
            weight="bold",
        )
        for node in graph.nodes
    ]
    place_labels(axes, labels, segments=world.walls)


def finish_maps(figure: Figure) -> None:
    """Give the maps of a figure scale bars of one length, and the figure a legend of all."""
    maps = [axes for axes in figure.axes if not len(axes.get_xticks())]
    length = round_length(min(float(np.ptp(axes.get_xlim())) for axes in maps))
    handles: dict[str, Any] = {}
    for axes in maps:
        draw_scale_bar(axes, length)
        some, names = axes.get_legend_handles_labels()
        handles |= dict(zip(names, some, strict=True))
    if handles:
        legend = figure.legend(
            handles.values(), handles.keys(), loc="outside lower center", ncols=6, frameon=False
        )
        for line in legend.get_lines():  # The dots of a cloud are too small to be seen alone.
            line.set_markersize(max(line.get_markersize(), 4.0))
