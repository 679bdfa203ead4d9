"""Pictures of maps: the layers and the estimated trajectory. One function per layer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.files import atomic_write
from albot_core.geometry.types import Points
from albot_core.maps.activity import Activity, packet_segments
from albot_core.maps.layers import (
    Layer,
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceGraph,
    SegmentsLayer,
    TrajectoryLayer,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 10.0
"""Width of the picture of one map (inches)."""
_COLUMNS = 3
"""Largest number of maps side by side."""
_WIDEST = 1.6
"""Width of a picture of several maps, relative to that of one."""
_NETWORK = 0.6
"""Width of a network's plane, relative to the map's."""

_SHAPES = (0.4, 1.4)
"""Least and largest height of the map's frame, relative to its width."""

_SURFACE, _PATH, _REFERENCE, _HOME = "#1f2933", "#d9480f", "#2b8a3e", "#1864ab"
_PLACE, _EXIT, _PARTICLE, _TRAJECTORY = "#5f3dc4", "#e64980", "#f59f00", "#0b7285"


def write_picture(
    path: Path,
    *,
    title: str,
    snapshot: MapSnapshot,
    believed: Float64[np.ndarray, "moments 3"],
    reference: Float64[np.ndarray, "others 3"] | None = None,
    network: tuple[Activity, Points] | None = None,
) -> None:
    """Draw a map to a PNG file, atomically; everything in the map's frame (m).

    Args:
        path: The file.
        title: The title above the map.
        snapshot: The map.
        believed: The estimated trajectory.
        reference: The reference trajectory, aligned with `believed`; None for none.
        network: The activity of the mapper's attractor network, and the path of its packet in
            the network's plane (m), drawn to the left of the map; None for none.
    """
    panel = Panel(title, snapshot, believed, reference)
    figure, (axes,) = _make_figure([panel], columns=1, network=network)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    _save(figure, path)


@dataclass(frozen=True, eq=False)
class Panel:
    """One of several maps in a picture: see `write_picture`."""

    title: str
    snapshot: MapSnapshot
    believed: Float64[np.ndarray, "moments 3"]
    reference: Float64[np.ndarray, "others 3"] | None = None


def write_pictures(path: Path, panels: Sequence[Panel]) -> None:
    """Draw maps side by side to one PNG file, atomically; each in its own frame (m).

    Raises:
        InputError: `panels` is empty.
    """
    if not panels:
        raise InputError(path, "at least one map to draw", "none")
    figure, _ = _make_figure(panels, columns=min(len(panels), _COLUMNS))
    _save(figure, path)


def _make_figure(
    panels: Sequence[Panel], columns: int, network: tuple[Activity, Points] | None = None
) -> tuple[Figure, list[Axes]]:
    """Return a figure of maps in equal frames, with a network on their left, and the maps' axes."""
    # Imported here because it is slow to load and most runs draw nothing.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    bounds = [_bounds(_drawn_points(panel)) for panel in panels]
    heights = [(high[1] - low[1]) / (high[0] - low[0]) for low, high in bounds]
    shape = np.clip(max(heights), *_SHAPES)
    rows, width = -(-len(panels) // columns), _WIDTH * min(columns, _WIDEST) / columns
    beside = () if network is None else (_NETWORK,)
    widths = (*beside, *(1.0,) * columns)
    size = (width * sum(widths), rows * 0.9 * width * shape + (1.8 if beside else 1.0))
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    places = figure.add_gridspec(rows, len(widths), width_ratios=widths)
    if network is not None:
        _draw_network(*network, figure.add_subplot(places[:, 0]))
    drawn = []
    for number, (panel, (low, high)) in enumerate(zip(panels, bounds, strict=True)):
        axes = figure.add_subplot(places[number // columns, len(beside) + number % columns])
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        _draw_panel(panel, axes)
        drawn.append(axes)
    handles: dict[str, Any] = {}
    for axes in drawn:
        some, names = axes.get_legend_handles_labels()
        handles |= dict(zip(names, some, strict=True))
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=6, frameon=False
    )
    return figure, drawn


def _draw_panel(panel: Panel, axes: Axes) -> None:
    axes.set_title(panel.title)
    axes.set_aspect("equal")
    axes.grid(color="#e4e7eb", linewidth=0.6)
    axes.set_axisbelow(True)
    if panel.reference is not None:
        x, y = panel.reference[:, 0], panel.reference[:, 1]
        axes.plot(x, y, color=_REFERENCE, linewidth=1.2, alpha=0.8, label="reference, aligned")
    x, y = panel.believed[:, 0], panel.believed[:, 1]
    axes.plot(x, y, color=_PATH, linewidth=1.2, alpha=0.8, label="believed path")
    for layer in panel.snapshot.layers:
        draw_layer(layer, axes)
    # On top of the place that is there, below its label.
    axes.plot(0, 0, "*", color=_HOME, markersize=14, linestyle="none", label="home", zorder=5.5)


def _save(figure: Figure, path: Path) -> None:
    with atomic_write(path) as stream:
        # The layout makes no room for titles above maps of different shapes.
        figure.savefig(stream, format="png", bbox_inches="tight")


def _drawn_points(panel: Panel) -> Float64[np.ndarray, "points 2"]:
    """Return points that span everything in a panel (m)."""
    drawn = [np.zeros((1, 2)), panel.believed[:, :2], *map(layer_points, panel.snapshot.layers)]
    if panel.reference is not None:
        drawn.append(panel.reference[:, :2])
    return np.concatenate(drawn)


def _draw_network(activity: Activity, packets: Points, axes: Axes) -> None:
    """Draw the network's plane: the packet's path, and the activity at the end."""
    from matplotlib.collections import LineCollection

    width, height = activity.size
    path = packet_segments(packets, activity.size).reshape(-1, 2, 2)
    axes.add_collection(LineCollection(list(path), colors=_PATH, linewidths=0.6))
    axes.imshow(
        np.ma.masked_equal(activity.values, 0),
        cmap="Oranges",
        vmin=0,
        origin="lower",
        extent=(0, width, 0, height),
        interpolation="nearest",
    )
    axes.set(xlim=(0, width), ylim=(0, height), xlabel="x' (m)", ylabel="y' (m)", aspect="equal")
    axes.set_title("path of the packet, and activity at the end")


def _bounds(
    points: Float64[np.ndarray, "points 2"],
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
    """Return the lower and upper corner of a rectangle around the points, with a margin (m)."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.5 + 0.03 * (high - low).max()
    return low - margin, high + margin


@singledispatch
def layer_points(layer: Layer) -> Float64[np.ndarray, "points 2"]:
    """Return points that span a layer, for the bounds of the picture (m)."""
    raise NotImplementedError(type(layer).__name__)


@singledispatch
def draw_layer(layer: Layer, axes: Axes) -> None:
    """Draw a layer into axes of the map's frame."""
    raise NotImplementedError(type(layer).__name__)


@layer_points.register
def _points_of_segments(layer: SegmentsLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.segments.reshape(-1, 2)


@draw_layer.register(SegmentsLayer)
def _draw_segments(layer: SegmentsLayer, axes: Axes) -> None:
    from matplotlib.collections import LineCollection

    lines = list(layer.segments.reshape(-1, 2, 2))
    drawn = LineCollection(lines, colors=_SURFACE, linewidths=1.1, label="surfaces")
    axes.add_collection(drawn, autolim=False)


@layer_points.register
def _points_of_grid(layer: OccupancyGridLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.corners


@draw_layer.register(OccupancyGridLayer)
def _draw_grid(layer: OccupancyGridLayer, axes: Axes) -> None:
    """Draw occupied cells black, free cells white and unknown cells transparent."""
    from matplotlib.transforms import Affine2D

    rows, columns = layer.occupancy.shape
    x, y, turn = layer.origin.tolist()
    axes.imshow(
        np.ma.masked_invalid(layer.occupancy),
        cmap="Greys",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=(0, columns * layer.resolution, 0, rows * layer.resolution),
        transform=Affine2D().rotate(turn).translate(x, y) + axes.transData,
        interpolation="nearest",
        zorder=0.6,
    )


@layer_points.register
def _points_of_graph(layer: PlaceGraph) -> Float64[np.ndarray, "points 2"]:
    return np.reshape([node.middle for node in layer.nodes], (-1, 2)).astype(np.float64)


@draw_layer.register(PlaceGraph)
def _draw_graph(layer: PlaceGraph, axes: Axes) -> None:
    from matplotlib.collections import LineCollection

    if not layer.nodes:
        return
    middles = {node.id: node.middle for node in layer.nodes}
    links = [(middles[one], middles[other]) for one, other in layer.links]
    doorways = list(layer.doorways().reshape(-1, 2, 2))
    for lines, style in (
        (links, {"colors": _PLACE, "linewidths": 1.4, "alpha": 0.6, "label": "links"}),
        (doorways, {"colors": _EXIT, "linewidths": 3.0, "label": "exits"}),
    ):
        if lines:
            axes.add_collection(LineCollection(lines, zorder=4, **style), autolim=False)
    x, y = np.array(list(middles.values())).T
    axes.plot(
        x,
        y,
        "o",
        color=_PLACE,
        markersize=4 if layer.is_dense else 15,
        alpha=0.85,
        linestyle="none",
        label="places",
        zorder=5,
    )
    if layer.is_dense:
        return
    for node, across, up in zip(layer.nodes, x, y, strict=True):
        axes.text(across, up, node.label, color="white", size=7, ha="center", va="center", zorder=6)


@layer_points.register
def _points_of_particles(layer: ParticlesLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.poses[:, :2]


@draw_layer.register(ParticlesLayer)
def _draw_particles(layer: ParticlesLayer, axes: Axes) -> None:
    x, y, heading = layer.poses.T
    axes.quiver(
        x,
        y,
        np.cos(heading),
        np.sin(heading),
        color=_PARTICLE,
        angles="xy",
        width=0.002,
        scale=60,
        label="particles",
        zorder=3,
    )


@layer_points.register
def _points_of_trajectory(layer: TrajectoryLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.poses[:, :2]


@draw_layer.register(TrajectoryLayer)
def _draw_trajectory(layer: TrajectoryLayer, axes: Axes) -> None:
    x, y, _ = layer.poses.T
    axes.plot(x, y, color=_TRAJECTORY, linewidth=1.2, label="corrected path", zorder=2.5)
