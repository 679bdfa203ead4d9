"""Pictures of maps: the layers and the estimated trajectory. One function per layer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float64

from albot_core.drawing.labels import Label, place_labels
from albot_core.drawing.palette import (
    BELIEVED,
    CORRECTED,
    EXIT,
    FREE,
    HOME,
    LIGHT,
    PARTICLE,
    PLACE,
    RULE,
    TEXT,
    TRUTH,
    WALL,
)
from albot_core.errors import InputError
from albot_core.geometry.types import Points, Poses
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
_MOST_NAMES = 60
"""Largest number of places that are named, and drawn as larger discs."""
_PARTICLE_LENGTH = 0.4
"""Length of the line by which a particle shows its heading (m)."""
_HOME_SIZE, _PLACE_SIZE, _DENSE_SIZE = 12.0, 6.0, 3.0
"""Diameters of marks (points): a place is seen within the ring of home."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A map to draw; everything in the map's frame (m)."""

    title: str
    snapshot: MapSnapshot | None
    """The map; None if there is none."""
    believed: Poses
    """The estimated trajectory."""
    reference: Float64[np.ndarray, "moments 3"] | None = None
    """The reference trajectory, aligned with `believed`, which may lack moments; None for none."""
    note: str = ""
    """Why the panel is empty, which is written into it."""


def map_figure(panel: Panel, network: tuple[Activity, Points] | None = None) -> Figure:
    """Return the figure of a map.

    Args:
        panel: The map.
        network: The activity of the mapper's attractor network, and the path of its packet in
            the network's plane (m), drawn to the left of the map; None for none.
    """
    return _figure([panel], 1, network)


def maps_figure(panels: Sequence[Panel]) -> Figure:
    """Return a figure of maps in one frame, side by side with the same limits (m).

    Raises:
        InputError: `panels` is empty.
    """
    if not panels:
        raise InputError("maps_figure", "at least one map to draw", "none")
    return _figure(panels, min(len(panels), _COLUMNS))


def _figure(
    panels: Sequence[Panel], columns: int, network: tuple[Activity, Points] | None = None
) -> Figure:
    # Imported here because it is slow to load and most runs draw nothing.
    from matplotlib.figure import Figure

    low, high = _bounds(np.concatenate([_drawn_points(panel) for panel in panels]))
    shape = np.clip((high[1] - low[1]) / (high[0] - low[0]), *_SHAPES)
    rows, width = -(-len(panels) // columns), _WIDTH * min(columns, _WIDEST) / columns
    beside = () if network is None else (_NETWORK,)
    widths = (*beside, *(1.0,) * columns)
    size = (width * sum(widths), rows * (0.9 * width * shape + 0.4) + (1.4 if beside else 0.6))
    figure = Figure(figsize=size, layout="constrained")
    places = figure.add_gridspec(rows, len(widths), width_ratios=widths)
    if network is not None:
        _draw_network(*network, figure.add_subplot(places[:, 0]))
    drawn = []
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        axes = figure.add_subplot(places[row, len(beside) + column])
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        # Below the last panel of a column stand the numbers of all above it.
        is_last = number + columns >= len(panels)
        axes.tick_params(labelbottom=is_last, labelleft=column == 0)
        axes.set(xlabel="x (m)" if is_last else "", ylabel="" if column else "y (m)")
        _draw_panel(panel, axes)
        drawn.append(axes)
    handles: dict[str, Any] = {}
    for axes in drawn:
        some, names = axes.get_legend_handles_labels()
        handles |= dict(zip(names, some, strict=True))
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=6, frameon=False
    )
    for panel, axes in zip(panels, drawn, strict=True):
        _label_places(panel, axes)
    return figure


def _draw_panel(panel: Panel, axes: Axes) -> None:
    axes.set_title(panel.title, fontsize=11)
    axes.set_aspect("equal")
    axes.grid(color=RULE, linewidth=0.6)
    axes.set_axisbelow(True)
    if panel.note:
        middle: dict[str, Any] = {
            "transform": axes.transAxes,
            "ha": "center",
            "va": "center",
            "wrap": True,
        }
        axes.text(0.5, 0.5, panel.note, color=TEXT, fontsize=10, **middle)
    if panel.reference is not None:
        x, y = panel.reference[:, 0], panel.reference[:, 1]
        axes.plot(x, y, color=TRUTH, linewidth=3.2, label="reference, aligned")
    if len(panel.believed):
        x, y = panel.believed[:, 0], panel.believed[:, 1]
        # Thinner than the reference, which shows on both sides where the two agree.
        axes.plot(x, y, color=BELIEVED, linewidth=1.6, label="believed path", zorder=2.1)
    if panel.snapshot is None:
        return
    for layer in panel.snapshot.layers:
        draw_layer(layer, axes)
    axes.plot(
        0,
        0,
        "o",
        color=HOME,
        markersize=_HOME_SIZE,
        fillstyle="none",
        markeredgewidth=2.0,
        linestyle="none",
        label="home",
        zorder=6,
    )


def _label_places(panel: Panel, axes: Axes) -> None:
    """Write the places' names beside their discs, off the surfaces and paths if there is room."""
    graph = None if panel.snapshot is None else panel.snapshot.place_graph
    if graph is None or _is_crowded(graph):
        return
    at_home = [np.hypot(*node.middle) < 1e-6 for node in graph.nodes]
    labels = [
        Label(
            text=node.label,
            at=(float(node.middle[0]), float(node.middle[1])),
            colour=PLACE,
            radius=(_HOME_SIZE if home else _PLACE_SIZE) / 2,
        )
        for node, home in zip(graph.nodes, at_home, strict=True)
    ]
    path = panel.believed[:, :2]
    assert panel.snapshot is not None
    walls = np.concatenate((panel.snapshot.segments, np.hstack((path[:-1], path[1:]))))
    place_labels(axes, labels, segments=walls, points=np.zeros((1, 2)))


def _drawn_points(panel: Panel) -> Float64[np.ndarray, "points 2"]:
    """Return points that span everything in a panel (m)."""
    layers = () if panel.snapshot is None else panel.snapshot.layers
    drawn = [np.zeros((1, 2)), panel.believed[:, :2], *map(layer_points, layers)]
    if panel.reference is not None:
        drawn.append(panel.reference[:, :2])
    return np.concatenate(drawn)


def _draw_network(activity: Activity, packets: Points, axes: Axes) -> None:
    """Draw the network's plane: the packet's path, and the activity at the end."""
    from matplotlib.collections import LineCollection

    width, height = activity.size
    path = packet_segments(packets, activity.size).reshape(-1, 2, 2)
    axes.add_collection(LineCollection(list(path), colors=BELIEVED, linewidths=0.6))
    axes.imshow(
        np.ma.masked_equal(activity.values, 0),
        cmap="Oranges",
        vmin=0,
        origin="lower",
        extent=(0, width, 0, height),
        interpolation="nearest",
    )
    axes.set(xlim=(0, width), ylim=(0, height), xlabel="x' (m)", ylabel="y' (m)", aspect="equal")
    axes.set_title("path of the packet, and activity at the end", fontsize=11)


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
    drawn = LineCollection(lines, colors=WALL, linewidths=1.1, label="surfaces")
    axes.add_collection(drawn, autolim=False)


@layer_points.register
def _points_of_grid(layer: OccupancyGridLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.corners


@draw_layer.register(OccupancyGridLayer)
def draw_grid(layer: OccupancyGridLayer, axes: Axes) -> None:
    """Draw occupied cells dark and free cells pale; unknown cells are the paper."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.transforms import Affine2D

    if not layer.occupancy.size:
        return
    rows, columns = layer.occupancy.shape
    x, y, turn = layer.origin.tolist()
    axes.imshow(
        np.ma.masked_invalid(layer.occupancy),
        cmap=LinearSegmentedColormap.from_list("occupancy", (FREE, WALL)),
        vmin=0,
        vmax=1,
        origin="lower",
        extent=(0, columns * layer.resolution, 0, rows * layer.resolution),
        transform=Affine2D().rotate(turn).translate(x, y) + axes.transData,
        interpolation="nearest",
        zorder=0.6,
    )
    for name, colour in (("occupied", WALL), ("free", FREE)):
        axes.plot([], [], "s", color=colour, markersize=8, linestyle="none", label=name)


def _is_crowded(graph: PlaceGraph) -> bool:
    """Return whether the places are too many to be named."""
    return graph.is_dense or len(graph.nodes) > _MOST_NAMES


@layer_points.register
def _points_of_graph(layer: PlaceGraph) -> Float64[np.ndarray, "points 2"]:
    return np.reshape([node.middle for node in layer.nodes], (-1, 2)).astype(np.float64)


@draw_layer.register(PlaceGraph)
def _draw_graph(layer: PlaceGraph, axes: Axes) -> None:
    from matplotlib.collections import LineCollection

    if not layer.nodes:
        return
    # A corrected path is not to vanish under as many places and links.
    order, size = (2.2, _DENSE_SIZE) if _is_crowded(layer) else (4, _PLACE_SIZE)
    middles = {node.id: node.middle for node in layer.nodes}
    links = [(middles[one], middles[other]) for one, other in layer.links]
    doorways = list(layer.doorways().reshape(-1, 2, 2))
    for lines, style in (
        (links, {"colors": LIGHT["link"], "linewidths": 1.4, "label": "links"}),
        (doorways, {"colors": EXIT, "linewidths": 3.0, "label": "exits"}),
    ):
        if lines:
            axes.add_collection(LineCollection(lines, zorder=order, **style), autolim=False)
    x, y = np.array(list(middles.values())).T
    axes.plot(
        x,
        y,
        "o",
        color=PLACE,
        markersize=size,
        linestyle="none",
        label="places",
        zorder=order + 0.1,
    )


@layer_points.register
def _points_of_particles(layer: ParticlesLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.poses[:, :2]


@draw_layer.register(ParticlesLayer)
def _draw_particles(layer: ParticlesLayer, axes: Axes) -> None:
    from matplotlib.collections import LineCollection

    x, y, heading = layer.poses.T
    ahead = _PARTICLE_LENGTH * np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    lines = np.stack((layer.poses[:, :2], layer.poses[:, :2] + ahead), axis=1)
    axes.add_collection(
        LineCollection(list(lines), colors=PARTICLE, linewidths=0.8, zorder=3), autolim=False
    )
    style: dict[str, Any] = {
        "color": PARTICLE,
        "markersize": 4,
        "linestyle": "none",
        "label": "particles",
    }
    axes.plot(x, y, ".", zorder=3, **style)


@layer_points.register
def _points_of_trajectory(layer: TrajectoryLayer) -> Float64[np.ndarray, "points 2"]:
    return layer.poses[:, :2]


@draw_layer.register(TrajectoryLayer)
def _draw_trajectory(layer: TrajectoryLayer, axes: Axes) -> None:
    x, y, _ = layer.poses.T
    axes.plot(x, y, color=CORRECTED, linewidth=0.9, label="corrected path", zorder=2.5)
