"""The network of places as GraphML, for programs that draw and count graphs."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_core.files import replacing
from albot_core.maps.place_graph import Network

if TYPE_CHECKING:
    import networkx as nx

_DIGITS = 4
"""Digits after the point: a tenth of a millimetre."""


def network_to_graph(network: Network) -> nx.MultiGraph:
    """The network as an undirected graph; two places may be joined by several exits.

    Nodes are the ids of places, with `x` and `y` (the place's middle in the map's frame, m),
    `surfaces` and `exits` (how many it has), and `current` and `home`. An edge is an exit,
    with `line` (x1 y1 x2 y2 in the map's frame, m) as the place `of` has it, to its left.
    """
    # Imported here, since it takes long and most runs write no graph.
    import networkx as nx

    graph = nx.MultiGraph(frame="metres; x forward and y left of where the robot set out")
    for place in network.places:
        x, y = (place.middle.round(_DIGITS) + 0.0).tolist()
        graph.add_node(
            place.id,
            label=place.label,
            x=x,
            y=y,
            surfaces=len(place.surfaces),
            exits=len(place.exits),
            current=place.id == network.current,
            home=place.id == network.home,
        )
    for place in network.places:
        lines = place.placed_exits
        for number, door in enumerate(place.exits):
            if (place.id, number) < (door.leads_to, door.exit_there):
                line = _as_text(lines[number])
                graph.add_edge(place.id, door.leads_to, line=line, of=place.id)
    return graph


def write_graphml(network: Network, path: Path) -> None:
    """Write the network as a GraphML file, whole or not at all."""
    import networkx as nx

    content = io.BytesIO()
    nx.write_graphml(network_to_graph(network), content)
    with replacing(path) as stream:
        stream.write(content.getvalue())


def _as_text(line: Float64[np.ndarray, "4"]) -> str:
    """A line as four numbers; GraphML knows no lists."""
    return " ".join(f"{number:.{_DIGITS}f}" for number in line.round(_DIGITS) + 0.0)
