"""Place graphs as pose graphs in the g2o format, for g2o, GTSAM and Ceres to optimise.

A line `VERTEX_SE2 id x y theta` for every place, `FIX id` for the place that the robot set out
from, and `EDGE_SE2 from to dx dy dtheta I11 I12 I13 I22 I23 I33` for every edge: the target's frame
in the source's, and the information matrix (metres, radians).
https://github.com/RainerKuemmerle/g2o/wiki/File-Format-SLAM-2D
"""

from __future__ import annotations

from pathlib import Path

from albot_core.files import write_text
from albot_core.maps.layers import PlaceGraph

_INFORMATION = "1 0 0 1 0 1"
"""Mappers give no covariances: all edges count the same."""


def write_g2o(graph: PlaceGraph, path: Path) -> None:
    """Write a place graph, whole or not at all."""
    lines = [f"VERTEX_SE2 {node.id} {_numbers(node.pose.tolist())}" for node in graph.nodes]
    if graph.home is not None:
        lines.append(f"FIX {graph.home}")
    for edge in graph.edges:
        motion = _numbers(edge.motion.tolist())
        lines.append(f"EDGE_SE2 {edge.source} {edge.target} {motion} {_INFORMATION}")
    write_text(path, "\n".join(lines) + "\n")


def _numbers(numbers: list[float]) -> str:
    """The fewest digits that give these numbers back; 0 without its sign."""
    return " ".join(repr(number + 0.0) for number in numbers)
