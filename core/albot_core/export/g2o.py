"""Place graphs as pose graphs in the g2o format, which g2o, GTSAM and Ceres optimise.

The file has a line `VERTEX_SE2 id x y theta` for every place, then for every edge
`EDGE_SE2 from to dx dy dtheta I11 I12 I13 I22 I23 I33`: the pose of the target's frame in the
source's, and the upper half of the information matrix (metres, radians; along the axes of the
target's frame). The last line is `FIX id` for the place where the robot started.
https://github.com/RainerKuemmerle/g2o/wiki/File-Format-SLAM-2D
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from albot_core.files import write_text
from albot_core.maps.layers import PlaceGraph

_UPPER = np.triu_indices(3)


def write_g2o(graph: PlaceGraph, path: Path) -> None:
    """Write a place graph, atomically."""
    lines = [f"VERTEX_SE2 {node.id} {_numbers(node.pose.tolist())}" for node in graph.nodes]
    for edge in graph.edges:
        motion = _numbers(edge.motion.tolist())
        # Without information all edges weigh the same.
        information = np.eye(3) if edge.information is None else edge.information
        upper = _numbers(information[_UPPER].tolist())
        lines.append(f"EDGE_SE2 {edge.source} {edge.target} {motion} {upper}")
    if graph.home is not None:
        lines.append(f"FIX {graph.home}")  # Last, because GTSAM reads no edges after it.
    write_text(path, "\n".join(lines) + "\n")


def _numbers(numbers: list[float]) -> str:
    """Return numbers as text with the fewest digits that read back exactly; -0 becomes 0."""
    return " ".join(repr(number + 0.0) for number in numbers)
