"""Place graphs as GraphML, for programs that draw and analyse graphs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float64

from albot_core.files import atomic_write
from albot_core.maps.layers import PlaceGraph

_DIGITS = 4
"""Decimals of coordinates: a tenth of a millimetre."""
_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_KINDS: Mapping[type, str] = {bool: "boolean", int: "long", float: "double", str: "string"}
_FRAME = "metres; x forward and y left of where the robot set out"

Value = bool | int | float | str


class _Document:
    """A GraphML file in the making, of one undirected graph; two nodes may have several edges."""

    def __init__(self) -> None:
        self.root = ElementTree.Element("graphml", xmlns=_NAMESPACE)
        self.graph = ElementTree.Element("graph", edgedefault="undirected")
        self._keys: dict[tuple[str, str], str] = {}

    def add(self, kind: str, data: Mapping[str, Value], **attributes: str) -> None:
        """Add a `node` or an `edge` with its data."""
        self.describe(ElementTree.SubElement(self.graph, kind, attributes), data)

    def describe(self, element: ElementTree.Element, data: Mapping[str, Value]) -> None:
        """Add data to an element; declare what is new."""
        for name, value in data.items():
            key = self._keys.setdefault((element.tag, name), f"d{len(self._keys)}")
            if len(self.root) < len(self._keys):
                declared = {"id": key, "for": element.tag, "attr.name": name}
                declared["attr.type"] = _KINDS[type(value)]
                ElementTree.SubElement(self.root, "key", declared)
            text = str(value).lower() if isinstance(value, bool) else str(value)
            ElementTree.SubElement(element, "data", key=key).text = text

    def encoded(self) -> bytes:
        """Return the file, with the declarations first."""
        self.root.append(self.graph)
        ElementTree.indent(self.root)
        return bytes(ElementTree.tostring(self.root, encoding="utf-8", xml_declaration=True))


def write_graphml(graph: PlaceGraph, path: Path) -> None:
    """Write a place graph as an undirected graph in a GraphML file, atomically.

    Nodes are the ids of places, with `label`, `x` and `y` (the place's middle in the map's frame,
    m), `surfaces` and `exits` (their numbers), `current` and `home`. There may be several edges
    between two places; one that is known in both directions appears once. An edge has the motion
    `dx`, `dy` (m), `dtheta` (rad) from the frame of the place `of` to that of the other place, and
    the `line` of its doorway if it has one (x1 y1 x2 y2 in the map's frame, m), with `of` on its
    left, and the shortest `time` in which it was driven if that is known (s).
    """
    made, exits = _Document(), Counter(edge.source for edge in graph.edges)
    made.describe(made.graph, {"frame": _FRAME})
    for node in graph.nodes:
        x, y = (node.middle.round(_DIGITS) + 0.0).tolist()
        data: dict[str, Value] = {"label": node.label, "x": x, "y": y}
        data |= {"surfaces": len(node.segments), "exits": exits[node.id]}
        data |= {"current": node.id == graph.current, "home": node.id == graph.home}
        made.add("node", data, id=str(node.id))
    lines = iter(graph.doorways())
    for number, edge in enumerate(graph.edges):
        line = None if edge.doorway is None else next(lines)
        if edge.reverse is not None and edge.reverse < number:
            continue
        dx, dy, dtheta = (edge.motion.round(_DIGITS) + 0.0).tolist()
        data = {"of": edge.source, "dx": dx, "dy": dy, "dtheta": dtheta}
        if line is not None:
            data["line"] = _as_text(line)
        back = edge if edge.reverse is None else graph.edges[edge.reverse]
        times = [time for time in (edge.time, back.time) if time is not None]
        if times:
            data["time"] = round(min(times), _DIGITS)
        made.add("edge", data, id=str(number), source=str(edge.source), target=str(edge.target))
    with atomic_write(path) as stream:
        stream.write(made.encoded())


def _as_text(line: Float64[np.ndarray, "4"]) -> str:
    """Return a line as a text of four numbers, because GraphML has no lists."""
    return " ".join(f"{number:.{_DIGITS}f}" for number in line.round(_DIGITS) + 0.0)
