"""Layers that are not as their types say are found, by the name of what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from albot_core.maps.layer_checks import layer_fault
from albot_core.maps.layers import (
    Layer,
    OccupancyGridLayer,
    ParticlesLayer,
    PlaceEdge,
    PlaceGraph,
    PlaceNode,
    SegmentsLayer,
    TrajectoryLayer,
)

NAN = float("nan")


def node(**changed: Any) -> PlaceNode:
    """The place 3, with some fields changed; their types are checked in tests alone."""
    right = PlaceNode(id=3, label="P4", pose=np.zeros(3), middle=np.zeros(2))
    return changed_to(right, changed)


def edge(**changed: Any) -> PlaceEdge:
    """A way from the place 3 to itself, with some fields changed."""
    right = PlaceEdge(
        source=3,
        target=3,
        motion=np.zeros(3),
        doorway=np.zeros(4),
        reverse=0,
        information=np.eye(3),
        time=1.5,
    )
    return changed_to(right, changed)


def graph(**changed: Any) -> PlaceGraph:
    """A graph of both, with some fields changed."""
    return changed_to(PlaceGraph(nodes=(node(),), edges=(edge(),), current=3, home=3), changed)


def grid(**changed: Any) -> OccupancyGridLayer:
    """A grid of one occupied, one free and one unknown cell, with some fields changed."""
    cells = np.array([[1.0, 0.0, NAN]], np.float32)
    right = OccupancyGridLayer(origin=np.zeros(3), resolution=0.1, occupancy=cells)
    return changed_to(right, changed)


def changed_to(made: Any, changed: dict[str, Any]) -> Any:
    for name, value in changed.items():
        object.__setattr__(made, name, value)
    return made


SEGMENTS = SegmentsLayer(segments=np.zeros((2, 4)))
PARTICLES = ParticlesLayer(poses=np.zeros((2, 3)), weights=np.full(2, 0.5))
TRAJECTORY = TrajectoryLayer(poses=np.zeros((5, 3)))


@pytest.mark.parametrize("layer", [SEGMENTS, PARTICLES, TRAJECTORY, graph(), PlaceGraph(), grid()])
def test_a_right_layer_has_no_fault(layer: Layer) -> None:
    assert layer_fault(layer) is None


@pytest.mark.parametrize(
    ("layer", "place"),
    [
        (changed_to(SegmentsLayer(segments=np.zeros((0, 4))), {"segments": None}), "segments"),
        (SegmentsLayer(segments=np.full((1, 4), NAN)), "segments"),
        (changed_to(TrajectoryLayer(poses=np.zeros((1, 3))), {"poses": np.zeros(3)}), "poses"),
        (changed_to(ParticlesLayer(**vars(PARTICLES)), {"weights": np.zeros(3)}), "weights"),
        (changed_to(ParticlesLayer(**vars(PARTICLES)), {"poses": [[0.0] * 3]}), "poses"),
        (grid(origin=np.zeros(2)), "origin"),
        (grid(occupancy=np.full((1, 1), 2.0, np.float32)), "occupancy"),
        (grid(occupancy=np.zeros((1, 1))), "occupancy"),
        (grid(occupancy=np.zeros(3, np.float32)), "occupancy"),
        (graph(nodes=[node()]), "nodes"),
        (graph(edges=("way",)), "edges"),
        (graph(nodes=(node(), node())), "nodes[1].id"),
        (graph(nodes=(node(id="kitchen"),)), "nodes[0].id"),
        (graph(nodes=(node(label=4),)), "nodes[0].label"),
        (graph(nodes=(node(pose=np.array((0.0, NAN, NAN))),)), "nodes[0].pose"),
        (graph(nodes=(node(middle=np.zeros(3)),)), "nodes[0].middle"),
        (graph(nodes=(node(segments=np.zeros((1, 2))),)), "nodes[0].segments"),
        (graph(current=7), "current"),
        (graph(home=7), "home"),
        (graph(edges=(edge(), edge(target=9))), "edges[1].target"),
        (graph(edges=(edge(source=None),)), "edges[0].source"),
        (graph(edges=(edge(motion=np.full(3, NAN)),)), "edges[0].motion"),
        (graph(edges=(edge(doorway=np.zeros(2)),)), "edges[0].doorway"),
        (graph(edges=(edge(information=np.eye(2)),)), "edges[0].information"),
        (graph(edges=(edge(time=-1.0),)), "edges[0].time"),
        (graph(edges=(edge(time=NAN),)), "edges[0].time"),
        (graph(edges=(edge(reverse=1),)), "edges[0].reverse"),
    ],
)
def test_what_is_wrong_is_named(layer: Layer, place: str) -> None:
    fault = layer_fault(layer)
    assert fault is not None
    assert fault.place == place
