"""The picture: all panels side by side in one PNG, for papers and reports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D

from albot_core.files import atomic_write
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import Panel, lay_out, scale_bar
from albot_env.rendering.shapes import Shape

PALETTE = {
    "wall": "#2b2f36",
    "thing": "#7b3fa0",
    "laser": "#e8927c",
    "path": "#2a6fbb",
    "surface": "#c77700",
    "believed": "#2e8b57",
    "corrected": "#0b7285",
    "link": "#8f79d6",
    "doorway": "#e64980",
    "place": "#5f3dc4",
    "particle": "#f59f00",
    "activity": "#d9480f",
    "grid": "#555555",
    "home": "#b5338a",
    "robot": "#111111",
}


def save_picture(frame: Frame, path: Path) -> None:
    """Draw a frame, panels from left to right, and save it as a PNG, completely or not at all.

    Raises:
        InputError: The file cannot be written.
    """
    scene = lay_out(frame)
    x0, y0, x1, y1 = scene.bounds
    height = float(np.clip(6.2 * (y1 - y0) / (x1 - x0), 2.2, 11.0))
    shares = [panel.share for panel in scene.panels]
    figure = Figure(figsize=(6.5 * sum(shares), height + 1.5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("\n".join((scene.heading, *scene.captions)), fontsize=10)
    grid = figure.subplots(1, len(shares), width_ratios=shares)
    for axes, panel in zip(grid, scene.panels, strict=True):
        _draw_panel(axes, panel)
    with atomic_write(path) as stream:
        figure.savefig(stream, format="png", dpi=110, metadata={"Software": "albot-env"})


def _draw_panel(axes: Axes, panel: Panel) -> None:
    x0, y0, x1, y1 = panel.bounds
    for depth, shape in enumerate(panel.shapes):
        _draw_shape(axes, shape, 2 + depth)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=[], yticks=[])
    axes.set_title(panel.title, fontsize=10, loc="left")
    axes.spines[:].set_color("#cccccc")
    length = scale_bar(x1 - x0)
    axes.annotate(
        f"{length:g} m",
        (1.0, 1.0),
        xycoords="axes fraction",
        xytext=(0, 6),
        textcoords="offset points",
        ha="right",
        fontsize=9,
        color="#555555",
    )
    axes.plot([x1 - length, x1], [y1, y1], color="#555555", linewidth=4, clip_on=False, zorder=9)
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
    colour = PALETTE[shape.style]
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
            lw=0.4 if shape.is_thin else 1.1,
            label=shape.label,
            zorder=zorder,
        )
    elif shape.kind in ("dots", "marks"):
        axes.scatter(
            shape.data[:, 0],
            shape.data[:, 1],
            s=5 if shape.kind == "dots" else 30,
            color=colour,
            label=shape.label,
            zorder=zorder,
            linewidths=0,
        )
        for place, name in zip(shape.data, shape.names, strict=False):
            axes.annotate(
                name,
                place,
                xytext=(4, 3),
                textcoords="offset points",
                fontsize=8,
                color=colour,
                zorder=9,
                path_effects=[withStroke(linewidth=2, foreground="white")],
            )
    elif shape.kind == "grid":
        _draw_grid(axes, shape)
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


def _draw_grid(axes: Axes, shape: Shape) -> None:
    """Draw occupied cells black and free ones white; unknown cells are not drawn."""
    grid = shape.placed_grid
    (rows, columns), side = grid.occupancy.shape, grid.resolution
    x, y, turn = grid.origin.tolist()
    axes.imshow(
        np.ma.masked_invalid(grid.occupancy),
        cmap="Greys",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=(0, columns * side, 0, rows * side),
        transform=Affine2D().rotate(turn).translate(x, y) + axes.transData,
        interpolation="nearest",
        zorder=1,
    )


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
