"""The scene: a frame laid out as two panels of shapes that every renderer draws alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.geometry.poses import compose, transform_points
from albot_core.geometry.types import Points
from albot_env.rendering.frame import Frame
from albot_env.rendering.layers import layer_shapes
from albot_env.rendering.shapes import Shape


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """One half of a scene."""

    title: str
    shapes: tuple[Shape, ...]
    """From back to front."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """The truth on the left and the map on the right, at one scale and in one frame."""

    truth: Panel
    map: Panel
    bounds: tuple[float, float, float, float]
    """Smallest x, smallest y, largest x, largest y of what both panels show (m)."""
    heading: str
    """What does not change in the episode."""
    captions: tuple[str, ...]
    """The figures of the moment, a line each."""

    @property
    def panels(self) -> tuple[Panel, Panel]:
        """Both panels from left to right."""
        return self.truth, self.map


def lay_out(frame: Frame) -> Scene:
    """Lay a frame out as a scene. The map is drawn as if laid down at the true start."""
    start = frame.start
    believed = compose(start, frame.belief)
    things = (
        (Shape(kind="segments", style="thing", label="what moves", data=frame.things),)
        if len(frame.things)
        else ()
    )
    truth = Panel(
        title="the truth",
        shapes=(
            Shape(
                kind="dots",
                style="laser",
                label="laser",
                data=transform_points(frame.pose, frame.hits),
            ),
            Shape(kind="segments", style="wall", label="walls", data=frame.walls),
            *things,
            _way("path", frame.path, frame),
            Shape(kind="home", style="home", label="home", data=start),
            Shape(kind="robot", style="robot", label="robot", data=frame.pose),
        ),
    )
    mapped = Panel(
        title=f"what the robot believes ({frame.mapper})",
        shapes=(
            *(shape for layer in frame.snapshot.layers for shape in layer_shapes(layer, start)),
            _way("believed", transform_points(start, frame.believed_path), frame),
            Shape(kind="home", style="home", label="home", data=compose(believed, frame.home)),
            Shape(kind="robot", style="robot", label="robot", data=believed),
        ),
    )
    return Scene(
        truth=truth,
        map=mapped,
        bounds=_bounds(truth, mapped),
        heading=frame.heading,
        captions=(frame.figures, frame.rewards),
    )


def _way(style: str, points: Points, frame: Frame) -> Shape:
    """A path; or the stops of a robot that is led, numbered, of which the first is home."""
    if not frame.is_led:
        return Shape(kind="line", style=style, label="path", data=points)
    if (points[-1] == points[-2]).all():  # The last answer leads nowhere else.
        points = points[:-1]
    names = tuple(str(number) for number in range(2, len(points) + 2))
    return Shape(kind="marks", style=style, label="stops", data=points, names=names)


def _bounds(*panels: Panel, margin: float = 0.8) -> tuple[float, float, float, float]:
    """The box around everything drawn but the laser's dots, `margin` (m) wider on each side."""
    shapes = [shape for panel in panels for shape in panel.shapes if shape.style != "laser"]
    points = np.concatenate([shape.points for shape in shapes])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def scale_bar(width: float) -> float:
    """A round length (m) of about a fifth of `width` (m), for a scale bar."""
    wanted = width / 5
    magnitude = 10.0 ** np.floor(np.log10(wanted))
    return float(max(f * magnitude for f in (1, 2, 5) if f * magnitude <= wanted * 1.001))
