"""A place graph as a pose graph."""

from __future__ import annotations

import numpy as np

from albot_core.export.g2o import write_g2o
from albot_core.maps.layers import PlaceEdge, PlaceGraph, PlaceNode


def test_vertices_edges_and_home(tmp_path):
    poses = np.array(((0, 0, 0), (1, -0.0, 0.5), (1 / 3, 2, -3)), float)
    nodes = tuple(
        PlaceNode(id=2 * k, label="", pose=pose, middle=pose[:2]) for k, pose in enumerate(poses)
    )
    information = np.array(((4, 0.5, 0.25), (0.5, 3, 0.125), (0.25, 0.125, 2)))
    edges = (
        PlaceEdge(source=0, target=2, motion=np.array((1, 0, 0.5)), reverse=1),
        PlaceEdge(source=2, target=0, motion=np.array((-0.9, 0.5, -0.5)), reverse=0),
        PlaceEdge(source=2, target=4, motion=np.array((0, 2, 0.1)), information=information),
    )
    write_g2o(PlaceGraph(nodes=nodes, edges=edges, home=0), tmp_path / "a.g2o")
    lines = (tmp_path / "a.g2o").read_text().splitlines()
    assert lines == [
        "VERTEX_SE2 0 0.0 0.0 0.0",
        "VERTEX_SE2 2 1.0 0.0 0.5",
        f"VERTEX_SE2 4 {1 / 3!r} 2.0 -3.0",
        "EDGE_SE2 0 2 1.0 0.0 0.5 1.0 0.0 0.0 1.0 0.0 1.0",
        "EDGE_SE2 2 0 -0.9 0.5 -0.5 1.0 0.0 0.0 1.0 0.0 1.0",
        "EDGE_SE2 2 4 0.0 2.0 0.1 4.0 0.5 0.25 3.0 0.125 2.0",
        "FIX 0",
    ]
    assert float(lines[2].split()[2]) == poses[2, 0]


def test_no_places_are_no_lines(tmp_path):
    write_g2o(PlaceGraph(), tmp_path / "a.g2o")
    assert (tmp_path / "a.g2o").read_text().strip() == ""
