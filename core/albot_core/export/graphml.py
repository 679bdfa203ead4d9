"""Place graphs as GraphML, for programs that draw and analyse graphs."""

from __future__ import annotations

import io
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_core.files import atomic_write
from albot_core.maps.layers import PlaceGraph

if TYPE_CHECKING:
    import networkx as nx

_DIGITS = 4
"""Decimals of coordinates: a tenth of a millimetre."""


def place_graph_to_networkx(graph: PlaceGraph) -> nx.MultiGraph:
    """Return a place graph as an undirected graph, with possibly several edges between two places.

    Nodes are the ids of places, with `x` and `y` (the place's middle in the map's frame, m),
    `surfaces` and `exits` (their numbers), `current` and `home`. An edge that is known in both
    directions appears once. It has the motion `dx`, `dy` (m), `dtheta` (rad) from the frame of
    the place `of` to that of the other place, and the `line` of its doorway if it has one (x1 y1
    x2 y2 in the map's frame, m), with `of` on its left.
    """
    # Imported here because it is slow to load and most runs write no graph.
    import networkx as nx

    made = nx.MultiGraph(frame="metres; x forward and y left of where the robot set out")
    exits = Counter(edge.source for edge in graph.edges)
    for node in graph.nodes:
        x, y = (node.middle.round(_DIGITS) + 0.0).tolist()
        made.add_node(
            node.id,
            label=node.label,
            x=x,
            y=y,
            surfaces=len(node.segments),
            exits=exits[node.id],
            current=node.id == graph.current,
            home=node.id == graph.home,
        )
    lines = iter(graph.doorways())
    for number, edge in enumerate(graph.edges):
        line = None if edge.doorway is None else next(lines)
        if edge.reverse is not None and edge.reverse < number:
            continue
        dx, dy, dtheta = (edge.motion.round(_DIGITS) + 0.0).tolist()
        attributes = {"of": edge.source, "dx": dx, "dy": dy, "dtheta": dtheta}
        if line is not None:
            attributes["line"] = _as_text(line)
        made.add_edge(edge.source, edge.target, **attributes)
    return made


def write_graphml(graph: PlaceGraph, path: Path) -> None:
    """Write a place graph as a GraphML file, atomically."""
    import networkx as nx

    content = io.BytesIO()
    nx.write_graphml(place_graph_to_networkx(graph), content)
    with atomic_write(path) as stream:
        stream.write(content.getvalue())


def _as_text(line: Float64[np.ndarray, "4"]) -> str:
    """Return a line as a text of four numbers, because GraphML has no lists."""
    return " ".join(f"{number:.{_DIGITS}f}" for number in line.round(_DIGITS) + 0.0)
