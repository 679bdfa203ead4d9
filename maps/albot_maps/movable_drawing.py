"""Drawing the movable things of a world. Imported only where a picture is wanted."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from albot_maps.movables import Door, Movables, Walker

_DOOR, _BOX, _WALKER = "#8a5a2b", "#c9a36b", "#7b3fa0"


def draw_movables(movables: Movables, axes: Axes) -> None:
    """Draw doors shut with the way they swing, boxes, and walkers on their routes."""
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
