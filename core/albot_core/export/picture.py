"""A picture of a map: what was remembered, and where the robot believed to go."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_core.files import replacing
from albot_core.geometry.types import Segments
from albot_core.maps.place_graph import NOWHERE, Network

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH = 10.0
"""Width of the picture (inch)."""

_SHAPES = (0.4, 1.4)
"""Least and largest height of the map's frame, to its width."""

_SURFACE, _PATH, _REFERENCE, _HOME = "#1f2933", "#d9480f", "#2b8a3e", "#1864ab"
_PLACE, _EXIT = "#5f3dc4", "#e64980"


def write_picture(
    path: Path,
    *,
    title: str,
    surfaces: Segments,
    believed: Float64[np.ndarray, "moments 3"],
    reference: Float64[np.ndarray, "others 3"] | None = None,
    network: Network = NOWHERE,
) -> None:
    """Draw a map as a PNG file, whole or not at all; all in the map's frame (m).

    Args:
        path: Where to write it.
        title: What stands above it.
        surfaces: The surfaces remembered.
        believed: Where the robot believed to be.
        reference: Where it was, laid on `believed`; not drawn where there is none.
        network: The places remembered, which are drawn as nodes with their links and exits.
    """
    # Imported here, since it takes long and most runs draw nothing.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = [np.zeros((1, 2)), surfaces.reshape(-1, 2), believed[:, :2]]
    drawn += [place.middle[None] for place in network.places]
    if reference is not None:
        drawn.append(reference[:, :2])
    low, high = _bounds(np.concatenate(drawn))
    shape = np.clip((high[1] - low[1]) / (high[0] - low[0]), *_SHAPES)
    figure = Figure(figsize=(_WIDTH, 0.9 * _WIDTH * shape + 1.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(
        xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x (m)", ylabel="y (m)"
    )
    axes.set_title(title)
    axes.set_aspect("equal")
    axes.grid(color="#e4e7eb", linewidth=0.6)
    axes.set_axisbelow(True)
    _draw(axes, surfaces, believed, reference)
    if network.places:
        _draw_network(axes, network)
    figure.legend(loc="outside lower center", ncols=6, frameon=False)
    with replacing(path) as stream:
        figure.savefig(stream, format="png")


def _bounds(
    points: Float64[np.ndarray, "points 2"],
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
    """The corners of a rectangle around the points, with a margin (m)."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.5 + 0.03 * (high - low).max()
    return low - margin, high + margin


def _draw(
    axes: Axes,
    surfaces: Segments,
    believed: Float64[np.ndarray, "moments 3"],
    reference: Float64[np.ndarray, "others 3"] | None,
) -> None:
    from matplotlib.collections import LineCollection

    if reference is not None:
        x, y = reference[:, 0], reference[:, 1]
        axes.plot(x, y, color=_REFERENCE, linewidth=1.2, alpha=0.8, label="reference, aligned")
    axes.plot(
        believed[:, 0], believed[:, 1], color=_PATH, linewidth=1.2, alpha=0.8, label="believed path"
    )
    lines = list(surfaces.reshape(-1, 2, 2))
    axes.add_collection(
        LineCollection(lines, colors=_SURFACE, linewidths=1.1, label="surfaces"), autolim=False
    )
    axes.plot(0, 0, "*", color=_HOME, markersize=14, linestyle="none", label="home", zorder=3)


def _draw_network(axes: Axes, network: Network) -> None:
    from matplotlib.collections import LineCollection

    places = network.places
    exits = np.concatenate([place.placed_exits for place in places]).reshape(-1, 2, 2)
    middles = {place.id: place.middle for place in places}
    links = [(middles[one], middles[other]) for one, other in network.links]
    for lines, style in (
        (links, {"colors": _PLACE, "linewidths": 1.4, "alpha": 0.6}),
        (list(exits), {"colors": _EXIT, "linewidths": 3.0, "label": "exits"}),
    ):
        axes.add_collection(LineCollection(lines, zorder=4, **style), autolim=False)
    x, y = np.array(list(middles.values())).T
    axes.plot(
        x,
        y,
        "o",
        color=_PLACE,
        markersize=15,
        alpha=0.85,
        linestyle="none",
        label="places",
        zorder=5,
    )
    for place, across, up in zip(places, x, y, strict=True):
        axes.text(
            across, up, place.label, color="white", size=7, ha="center", va="center", zorder=6
        )
