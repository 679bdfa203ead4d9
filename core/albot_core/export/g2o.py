"""Place graphs as pose graphs in the g2o format, which g2o, GTSAM and Ceres optimise.

The file has a line `VERTEX_SE2 id x y theta` for every place, `FIX id` for the place where the
robot started, and `EDGE_SE2 from to dx dy dtheta I11 I12 I13 I22 I23 I33` for every edge: the pose
of the target's frame in the source's, and the information matrix (metres, radians).
https://github.com/RainerKuemmerle/g2o/wiki/File-Format-SLAM-2D
"""

from __future__ import annotations

from pathlib import Path

from albot_core.files import write_text
from albot_core.maps.layers import PlaceGraph

_INFORMATION = "1 0 0 1 0 1"
"""Information matrix of every edge: mappers have no covariances, so all edges weigh the same."""


def write_g2o(graph: PlaceGraph, path: Path) -> None:
    """Write a place graph, atomically."""
    lines = [f"VERTEX_SE2 {node.id} {_numbers(node.pose.tolist())}" for node in graph.nodes]
    if graph.home is not None:
        lines.append(f"FIX {graph.home}")
    for edge in graph.edges:
        motion = _numbers(edge.motion.tolist())
        lines.append(f"EDGE_SE2 {edge.source} {edge.target} {motion} {_INFORMATION}")
    write_text(path, "\n".join(lines) + "\n")


def _numbers(numbers: list[float]) -> str:
    """Return numbers as text with the fewest digits that read back exactly; -0 becomes 0."""
    return " ".join(repr(number + 0.0) for number in numbers)
