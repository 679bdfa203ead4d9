"""The scene: a frame laid out as panels of shapes, which all renderers draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.geometry.poses import compose, transform_points
from albot_core.geometry.types import Points
from albot_core.maps.activity import Activity, packet_segments
from albot_env.rendering.frame import Frame
from albot_env.rendering.layers import layer_shapes
from albot_env.rendering.shapes import Shape

_SHARE = 0.6
"""Width of the network's panel relative to the truth's."""
_RIM = 0.5
"""Margin around the network's plane (m)."""
Bounds = tuple[float, float, float, float]
"""Smallest x, smallest y, largest x, largest y (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """One panel of a scene."""

    title: str
    shapes: tuple[Shape, ...]
    """Shapes from back to front."""
    bounds: Bounds
    """Visible area, in the panel's frame."""
    share: float = 1.0
    """Width relative to the first panel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """The truth on the left and the map beside it, at one scale and in the world frame.

    If the mapper has an attractor network, its activity is on the right, in the network's own
    frame.
    """

    truth: Panel
    map: Panel
    activity: Panel | None
    heading: str
    """Text that does not change during the episode."""
    captions: tuple[str, ...]
    """Numbers of the moment, one line each."""

    @property
    def bounds(self) -> Bounds:
        """Visible area of the truth and the map, world frame."""
        return self.truth.bounds

    @property
    def panels(self) -> tuple[Panel, ...]:
        """All panels from left to right."""
        return (self.truth, self.map, *(() if self.activity is None else (self.activity,)))


def lay_out(frame: Frame) -> Scene:
    """Lay a frame out as a scene. The map is drawn with its origin at the true start."""
    start, radius = frame.start, frame.robot_radius
    believed = compose(start, frame.belief)
    moving = frame.dynamic_obstacles
    obstacles = (
        (Shape(kind="segments", style="thing", label="dynamic obstacles", data=moving),)
        if len(moving)
        else ()
    )
    way_out = (
        (Shape(kind="line", style="path", label="way out", data=frame.way_out, is_thin=True),)
        if len(frame.way_out)
        else ()
    )
    hits = transform_points(frame.pose, frame.hits)
    truth = (
        Shape(kind="segments", style="wall", label="walls", data=frame.walls),
        *obstacles,
        Shape(kind="dots", style="laser", label="laser", data=hits),
        *way_out,
        _way("path", frame.path, frame),
        Shape(kind="home", style="home", label="home", data=start),
        Shape(kind="robot", style="robot", label="robot", data=frame.pose, radius=radius),
    )
    layers = [shape for layer in frame.snapshot.layers for shape in layer_shapes(layer, start)]
    mapped = (
        # On top: graph SLAM has a place at every pose of the path, which they would hide.
        *sorted(layers, key=lambda shape: shape.style == "corrected"),
        _way("believed", transform_points(start, frame.believed_path), frame),
        Shape(kind="home", style="home", label="home", data=compose(believed, frame.home)),
        Shape(kind="robot", style="robot", label="robot", data=believed, radius=radius),
    )
    bounds = _bounds(*truth, *mapped)
    title = f"what the robot believes ({frame.mapper})"
    return Scene(
        truth=Panel(title="the truth", shapes=truth, bounds=bounds),
        map=Panel(title=title, shapes=mapped, bounds=bounds),
        activity=None if frame.activity is None else _activity(frame.activity, frame.packets),
        heading=frame.heading,
        captions=(frame.figures, frame.rewards),
    )


def _way(style: str, points: Points, frame: Frame) -> Shape:
    """Return a path; on a guided tour, return the numbered stops, of which the first is home."""
    if not frame.is_led:
        return Shape(kind="line", style=style, label="path", data=points)
    if (points[-1] == points[-2]).all():  # The last answer leads to no further stop.
        points = points[:-1]
    names = tuple(str(number) for number in range(2, len(points) + 2))
    return Shape(kind="marks", style=style, label="stops", data=points, names=names)


def _activity(activity: Activity, packets: Points) -> Panel:
    """Return the panel of the network's plane: activity, and path of the largest packet."""
    values, cell, size = activity.values, activity.cell, np.array(activity.size)
    rows, columns = np.nonzero(values)
    strengths = np.sqrt(values[rows, columns] / values.max(initial=0.0))  # Small packets show, too.
    middles = (columns + 0.5) * cell, (rows + 0.5) * cell
    cells = np.column_stack((*middles, np.full(len(rows), cell), strengths)).astype(np.float64)
    edges = np.array(((0, 0, 1, 0), (1, 0, 1, 1), (1, 1, 0, 1), (0, 1, 0, 0))) * np.tile(size, 2)
    path = packet_segments(packets, activity.size)
    return Panel(
        title="the network's activity",
        shapes=(
            Shape(kind="segments", style="grid", label="where it wraps round", data=edges),
            Shape(kind="cells", style="activity", label="activity", data=cells),
            Shape(kind="segments", style="believed", label="packet's path", data=path),
            Shape(kind="robot", style="robot", label="packet", data=activity.packet),
        ),
        bounds=(-_RIM, -_RIM, size[0] + _RIM, size[1] + _RIM),
        share=_SHARE,
    )


def _bounds(*shapes: Shape, margin: float = 0.8) -> Bounds:
    """Return the box around all shapes but the laser's dots, with a `margin` (m) on each side."""
    points = np.concatenate([shape.points for shape in shapes if shape.style != "laser"])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
