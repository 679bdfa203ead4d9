"""The picture: all panels side by side in one figure, for papers and reports."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from albot_core.drawing.figure import round_length
from albot_core.drawing.labels import Label, place_labels
from albot_core.drawing.palette import FAINT, LIGHT, TEXT
from albot_core.export.picture import draw_grid
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import Panel, lay_out
from albot_env.rendering.shapes import Shape

_DOT, _MARK = 9, 30
"""Areas of small dots and of larger marks (square points)."""
_NOT_BENEATH = {"segments", "line"}
"""Kinds of shapes that labels do not cross if they can."""


def episode_figure(frame: Frame) -> Figure:
    """Return the picture of a frame, with the panels from left to right."""
    scene = lay_out(frame)
    x0, y0, x1, y1 = scene.bounds
    height = float(np.clip(6.2 * (y1 - y0) / (x1 - x0), 2.2, 11.0))
    shares = [panel.share for panel in scene.panels]
    figure = Figure(figsize=(6.5 * sum(shares), height + 1.5), layout="constrained")
    figure.suptitle("\n".join((scene.heading, *scene.captions)), fontsize=10)
    grid = figure.subplots(1, len(shares), width_ratios=shares)
    for axes, panel in zip(grid, scene.panels, strict=True):
        _draw_panel(axes, panel)
    for axes, panel in zip(grid, scene.panels, strict=True):
        _write_names(axes, panel)
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    x0, y0, x1, y1 = panel.bounds
    for depth, shape in enumerate(panel.shapes):
        _draw_shape(axes, shape, 2 + depth)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=[], yticks=[])
    axes.set_title(panel.title, fontsize=10, loc="left")
    axes.spines[:].set_color(FAINT)
    length = round_length(x1 - x0)
    axes.annotate(
        f"{length:g} m",
        (1.0, 1.0),
        xycoords="axes fraction",
        xytext=(0, 6),
        textcoords="offset points",
        ha="right",
        fontsize=9,
        color=TEXT,
    )
    axes.plot([x1 - length, x1], [y1, y1], color=TEXT, linewidth=4, clip_on=False, zorder=9)
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.01),
        ncols=min(len(panel.shapes), 8),
        fontsize=8,
        frameon=False,
        handletextpad=0.5,
        columnspacing=1.2,
    )


def _draw_shape(axes: Axes, shape: Shape, zorder: int) -> None:
    if not shape.data.size:
        return  # Nor is it named in the legend.
    colour = LIGHT[shape.style]
    if shape.kind == "segments":
        lines = LineCollection(
            list(shape.data.reshape(-1, 2, 2)),
            colors=colour,
            linewidths=3.0 if shape.style == "doorway" else 1.4,
            label=shape.label,
            zorder=zorder,
            capstyle="round",
        )
        axes.add_collection(lines)
    elif shape.kind == "line":
        axes.plot(
            shape.data[:, 0],
            shape.data[:, 1],
            color=colour,
            lw=0.4 if shape.is_thin else 1.5,
            label=shape.label,
            zorder=zorder,
        )
    elif shape.kind in ("dots", "marks"):
        axes.scatter(
            shape.data[:, 0],
            shape.data[:, 1],
            s=_DOT if shape.kind == "dots" else _MARK,
            color=colour,
            label=shape.label,
            zorder=zorder,
            linewidths=0,
        )
    elif shape.kind == "grid":
        draw_grid(shape.placed_grid, axes)
    elif shape.kind == "cells":
        _draw_cells(axes, shape, colour, zorder)
    elif shape.kind == "home":
        axes.scatter(
            shape.data[:1],
            shape.data[1:2],
            s=130,
            facecolors="none",
            edgecolors=colour,
            linewidths=1.8,
            label=shape.label,
            zorder=zorder,
        )
    else:
        _draw_robot(axes, shape, colour, zorder)


def _write_names(axes: Axes, panel: Panel) -> None:
    """Write the names of marks beside them."""
    lines = [
        shape.data if shape.kind == "segments" else np.hstack((shape.data[:-1], shape.data[1:]))
        for shape in panel.shapes
        if shape.kind in _NOT_BENEATH
    ]
    labels = [
        Label(text=name, at=(x, y), colour=LIGHT[shape.style], radius=math.sqrt(_MARK) / 2)
        for shape in panel.shapes
        for (x, y), name in zip(shape.data.tolist(), shape.names, strict=False)
    ]
    points = [shape.data[:2] for shape in panel.shapes if shape.kind in {"home", "robot"}]
    segments = np.concatenate((np.zeros((0, 4)), *lines))
    place_labels(axes, labels, segments=segments, points=np.array(points).reshape(-1, 2))


def _draw_cells(axes: Axes, shape: Shape, colour: str, zorder: int) -> None:
    """Draw squares: the stronger a square, the more opaque it is."""
    x, y, side, strength = shape.data[np.argsort(-shape.data[:, 3])].T  # The legend has the first.
    corners = np.array(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))
    squares = np.stack((x, y), axis=1)[:, None] + side[:, None, None] * corners
    axes.add_collection(
        PolyCollection(
            list(squares),
            facecolors=[to_rgba(colour, alpha) for alpha in strength],
            linewidths=0,
            label=shape.label,
            zorder=zorder,
        )
    )


def _draw_robot(axes: Axes, shape: Shape, colour: str, zorder: int) -> None:
    x, y, heading = shape.data
    axes.scatter(
        [x],
        [y],
        s=70,
        marker=(3, 0, np.degrees(heading) - 90),
        color=colour,
        label=shape.label,
        zorder=zorder,
    )
    if shape.radius:
        edge = Circle((x, y), shape.radius, fill=False, color=colour, linewidth=0.8, zorder=zorder)
        axes.add_patch(edge)
