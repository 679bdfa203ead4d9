"""The scene: a frame laid out as two panels of shapes that every renderer draws alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_env.rendering.frame import Frame

Kind = Literal["segments", "line", "dots", "home", "robot"]

ROBOT_RADIUS = 0.25
"""Radius at which the robot is drawn (m): about a Pioneer's."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """Something to draw."""

    kind: Kind
    """How `data` is meant: segments `(n, 4)`, points `(n, 2)`, or one pose `(3,)`."""
    style: str
    """What it stands for; the renderer's palette gives it a colour."""
    label: str
    """Its name in a legend."""
    data: Float64[np.ndarray, "..."]
    """Coordinates in the world's frame (m)."""


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
    caption: str

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
        title="truth",
        shapes=(
            Shape(
                kind="dots",
                style="laser",
                label="laser",
                data=transform_points(frame.pose, frame.hits),
            ),
            Shape(kind="segments", style="wall", label="walls", data=frame.walls),
            *things,
            Shape(kind="line", style="path", label="path driven", data=frame.path),
            Shape(kind="home", style="home", label="home", data=start),
            Shape(kind="robot", style="robot", label="robot", data=frame.pose),
        ),
    )
    mapped = Panel(
        title=f"map ({frame.mapper})",
        shapes=(
            Shape(
                kind="segments",
                style="surface",
                label="surfaces remembered",
                data=transform_segments(start, frame.surfaces),
            ),
            Shape(
                kind="line",
                style="believed",
                label="path believed",
                data=transform_points(start, frame.believed_path),
            ),
            Shape(
                kind="home",
                style="home",
                label="home believed",
                data=compose(believed, frame.home),
            ),
            Shape(kind="robot", style="robot", label="robot believed", data=believed),
        ),
    )
    return Scene(truth=truth, map=mapped, bounds=_bounds(truth, mapped), caption=frame.caption)


def _corners(panel: Panel) -> Iterator[Float64[np.ndarray, "points 2"]]:
    for shape in panel.shapes:
        if shape.style != "laser":
            yield (
                shape.data[:2].reshape(1, 2) if shape.data.ndim == 1 else shape.data.reshape(-1, 2)
            )


def _bounds(*panels: Panel, margin: float = 0.8) -> tuple[float, float, float, float]:
    """The box around everything drawn but the laser's dots, `margin` (m) wider on each side."""
    points = np.concatenate([corners for panel in panels for corners in _corners(panel)])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def scale_bar(width: float) -> float:
    """A round length (m) of about a fifth of `width` (m), for a scale bar."""
    wanted = width / 5
    magnitude = 10.0 ** np.floor(np.log10(wanted))
    return float(max(f * magnitude for f in (1, 2, 5) if f * magnitude <= wanted * 1.001))
