"""Drawing of maps beside and over the true floors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Poses, Segments
from albot_core.maps.layers import PlaceGraph
from albot_maps.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FLOOR, SURFACE, PATH, MARK = "#c9ccd1", "#22262b", "#d1603d", "#0a8a5f"
"""Colours of true walls, of the map, of the robot's path, and of highlights."""
PLACES = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f")
"""Colours of places, by their ids; they repeat after the eighth."""


def draw_floor(axes: Axes, walls: Segments, colour: str = FLOOR, width: float = 0.8) -> None:
    """Draw walls, in any one frame, and fit the axes to them."""
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(list(walls.reshape(-1, 2, 2)), colors=colour, lw=width))
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()


def draw_route(axes: Axes, world: World, way: Points) -> None:
    """Draw a floor and a route over it, with a dot at its beginning and arrows along it."""
    draw_floor(axes, world.walls, SURFACE)
    axes.plot(way[:, 0], way[:, 1], color=PATH, lw=1.2)
    axes.plot(*way[0], "o", color=MARK, ms=6)
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
    draw_floor(axes, transform_segments(frame, surfaces), SURFACE, 1.2)
    way = compose(frame, poses)
    axes.plot(way[:, 0], way[:, 1], color=PATH, lw=0.8)


def draw_points(axes: Axes, world: World, points: Points, poses: Poses, frame: Pose) -> None:
    """Draw a map as `draw_map` does, for a map of points (n, 2) in its own frame (m)."""
    draw_floor(axes, world.walls)
    axes.plot(*transform_points(frame, points).T, ",", color=SURFACE)
    axes.plot(*compose(frame, poses)[:, :2].T, color=PATH, lw=0.8)


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
        axes.plot(*zip(*ends, strict=True), color=MARK, lw=1.2, ls=":")
    for node in graph.nodes:
        colour = PLACES[node.id % len(PLACES)]
        lay = compose(frame, node.pose)
        draw_floor(axes, transform_segments(lay, node.segments), colour, 1.4)
        for edge in graph.edges:
            if edge.source == node.id and edge.doorway is not None:
                x1, y1, x2, y2 = transform_segments(lay, edge.doorway[None])[0]
                axes.plot((x1, x2), (y1, y2), color=colour, lw=3.0, alpha=0.6)
        axes.annotate(
            node.label,
            tuple(transform_points(frame, node.middle)),
            color=colour,
            fontsize=12,
            weight="bold",
            ha="center",
            bbox={"boxstyle": "round", "fc": "white", "ec": colour},
        )
