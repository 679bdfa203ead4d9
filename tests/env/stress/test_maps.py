"""What is wrong with a map or a graph of places is found; nothing is where nothing is wrong."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.maps.layers import (
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
    TrajectoryLayer,
)
from albot_env.stress.maps import MOST_SURFACES, check_map, check_places

DOORWAY = np.array((1.0, 0.0, 1.0, 1.0))


def node(place: int) -> PlaceNode:
    return PlaceNode(id=place, label=str(place), pose=np.zeros(3), middle=np.zeros(2))


def edge(source: int, target: int, reverse: int | None = None) -> PlaceEdge:
    return PlaceEdge(
        source=source, target=target, motion=np.zeros(3), doorway=DOORWAY, reverse=reverse
    )


GRAPH = PlaceGraph(
    nodes=(node(0), node(1), node(4)),
    edges=(edge(0, 1, 1), edge(1, 0, 0), edge(1, 4)),
    current=4,
    home=0,
)


def test_a_sound_graph():
    assert check_places(GRAPH) == []
    assert check_places(PlaceGraph()) == []


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"current": 7}, "the current place 7 is none of 3 places"),
        ({"home": 2}, "the home place 2 is none of 3 places"),
        ({"nodes": (*GRAPH.nodes, node(4))}, "the place 4 is there twice"),
        ({"edges": GRAPH.edges[:2]}, "no way leads into the place 4"),
        ({"edges": (*GRAPH.edges, edge(4, 9))}, "there is no place 9"),
        ({"edges": (edge(0, 1, 2), *GRAPH.edges[1:])}, "its reverse leads from 1 to 4"),
        ({"edges": (edge(0, 1, 8), *GRAPH.edges[1:])}, "its reverse is number 8 of 3"),
        ({"edges": (edge(0, 1, 1), edge(1, 0), edge(1, 4))}, "the reverse of its reverse is None"),
    ],
)
def test_a_graph_with_something_wrong(changes: dict[str, object], found: str):
    assert any(found in line for line in check_places(dataclasses.replace(GRAPH, **changes)))


def test_a_lost_robot_begins_a_place_that_nobody_entered():
    carried = dataclasses.replace(GRAPH, edges=GRAPH.edges[:2])
    assert check_places(carried) == ["no way leads into the place 4"]
    assert check_places(carried, lost=True) == []


@pytest.mark.parametrize("field", ["motion", "doorway"])
def test_a_connection_that_is_not_finite(field: str):
    value = np.full(3 if field == "motion" else 4, np.nan)
    wrong = dataclasses.replace(GRAPH.edges[2], **{field: value})
    [line] = check_places(dataclasses.replace(GRAPH, edges=(*GRAPH.edges[:2], wrong)))
    assert line.startswith(f"the connection 2 from 1 to 4: its {field} is [nan")


GRID = OccupancyGridLayer(
    origin=np.zeros(3), resolution=0.1, occupancy=np.array(((0.5, np.nan), (0, 1)), np.float32)
)
LAYERS = {
    "surface": SegmentsLayer(segments=np.zeros((3, 4))),
    "grid": GRID,
    "particle": ParticlesLayer(poses=np.zeros((2, 3)), weights=np.array((0.25, 0.75))),
    "trajectory": TrajectoryLayer(poses=np.zeros((2, 3))),
    "place": GRAPH,
}


def test_sound_layers():
    assert check_map(MapSnapshot(layers=tuple(LAYERS.values()))) == []


@pytest.mark.parametrize(
    ("layer", "found"),
    [
        (SegmentsLayer(segments=np.array([[0, 0, 1, np.inf]])), "the surface (0 of 1) is [0.0"),
        (SegmentsLayer(segments=np.zeros((MOST_SURFACES + 1, 4))), "20001 surfaces"),
        (dataclasses.replace(GRID, origin=np.full(3, 1e9)), "the grid's origin"),
        (dataclasses.replace(GRID, occupancy=np.full((1, 1), 2, np.float32)), "no probability"),
        (ParticlesLayer(poses=np.zeros((2, 3)), weights=np.array((0.5, 0.7))), "add up to 1.2"),
        (TrajectoryLayer(poses=np.full((1, 3), np.nan)), "pose of the trajectory (0 of 1)"),
        (
            PlaceGraph(nodes=(dataclasses.replace(node(3), middle=np.full(2, np.nan)),)),
            "middle of place 3",
        ),
    ],
)
def test_a_layer_with_something_wrong(layer: object, found: str):
    [line] = check_map(MapSnapshot(layers=(layer,)))  # type: ignore[arg-type]
    assert found in line
