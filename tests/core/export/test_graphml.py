"""The network as other programs read it."""

from __future__ import annotations

import json

import networkx as nx
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import HOME, PLACE, rgb
from albot_core.export.geojson import write_geojson
from albot_core.export.graphml import write_graphml
from albot_core.export.picture import Panel, draw_layer, map_figure
from albot_core.mappers.albot1.places.network_view import Exit, Network, Place
from albot_core.maps.layers import MapSnapshot, PlaceEdge, PlaceGraph, PlaceNode, SegmentsLayer


def exit_at(x: float, leads_to: int, exit_there: int) -> Exit:
    return Exit(line=np.array([x, -0.5, x, 0.5]), leads_to=leads_to, exit_there=exit_there)


def place(number: int, frame: tuple[float, ...], *exits: Exit) -> Place:
    walls = np.array([[0.0, 0, 1, 0]] * (number + 1))
    return Place(id=number, frame=np.array(frame, float), surfaces=walls, exits=exits)


@pytest.fixture
def network() -> PlaceGraph:
    """P1 and P3 joined by two exits, P4 behind P3; P3's frame is turned by a quarter."""
    first = place(0, (0, 0, 0), exit_at(2, 2, 0), exit_at(4, 2, 1))
    second = place(2, (10, 0, np.pi / 2), exit_at(1, 0, 0), exit_at(3, 0, 1), exit_at(5, 3, 0))
    third = place(3, (20, 0, 0), exit_at(0, 2, 2))
    return Network(places=(first, second, third), current=2, home=0).place_graph


def test_a_transition_known_in_both_directions_has_its_shorter_time(tmp_path):
    nodes = tuple(
        PlaceNode(id=k, label=f"E{k}", pose=np.zeros(3), middle=np.zeros(2)) for k in range(3)
    )
    ways = ((0, 1, 1, 4.0), (1, 0, 0, 2.5), (1, 2, None, None))
    edges = tuple(
        PlaceEdge(source=one, target=other, motion=np.zeros(3), reverse=reverse, time=time)
        for one, other, reverse, time in ways
    )
    write_graphml(PlaceGraph(nodes=nodes, edges=edges), tmp_path / "a.graphml")
    graph = nx.read_graphml(tmp_path / "a.graphml", node_type=int)
    assert graph.edges[0, 1]["time"] == 2.5
    assert "time" not in graph.edges[1, 2]


def test_the_graph_has_places_and_exits(network, tmp_path):
    write_graphml(network, tmp_path / "a.graphml")
    graph = nx.read_graphml(tmp_path / "a.graphml", node_type=int, force_multigraph=True)
    assert graph.graph["frame"].startswith("metres; x forward")
    assert set(graph.nodes) == {0, 2, 3}
    assert graph.nodes[0]["home"] is True
    assert [graph.nodes[one]["exits"] for one in (0, 2, 3)] == [2, 3, 1]
    assert graph.nodes[2] == {
        "label": "P3",
        "x": 10.0,
        "y": 3.0,
        "surfaces": 3,
        "exits": 3,
        "current": True,
        "home": False,
    }
    assert graph.number_of_edges() == 3
    assert graph.number_of_edges(0, 2) == 2
    assert {frozenset(pair) for pair in graph.edges()} == {frozenset(p) for p in network.links}
    (last,) = graph.get_edge_data(2, 3).values()
    # P3's exit at x = 5 in a frame that is turned to the left at (10, 0).
    assert last["of"] == 2
    assert [float(word) for word in last["line"].split()] == [10.5, 5.0, 9.5, 5.0]


def test_the_same_network_is_the_same_bytes(network, tmp_path):
    for name in ("a", "b"):
        write_graphml(network, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_no_places_are_an_empty_graph(tmp_path):
    write_graphml(PlaceGraph(), tmp_path / "a.graphml")
    assert len(nx.read_graphml(tmp_path / "a.graphml")) == 0


def test_places_stand_beside_the_surfaces_in_geojson(network, tmp_path):
    path = tmp_path / "map.geojson"
    surfaces = SegmentsLayer(segments=np.array([[0.0, 0, 1, 0]]))
    write_geojson(MapSnapshot(layers=(surfaces, network)), path)
    features = json.loads(path.read_text())["features"]
    kinds = [feature["properties"].get("kind") for feature in features]
    assert kinds == [None, *3 * ["place"], *6 * ["exit"]]
    assert features[2]["geometry"] == {"type": "Point", "coordinates": [10, 3]}
    assert features[2]["properties"] == {"kind": "place", "id": 2, "label": "P3"}
    assert features[8]["geometry"]["coordinates"] == [[10.5, 5], [9.5, 5]]
    assert features[8]["properties"] == {"kind": "exit", "of": 2, "leads_to": 3}


def test_places_are_drawn_over_the_map(network, tmp_path):
    images = []
    surfaces = SegmentsLayer(segments=np.array([[0.0, 5, 20, 5]]))
    for given in (PlaceGraph(), network):
        path = tmp_path / "map.png"
        believed = np.array([[0.0, 0, 0], [20, 5, 0]])
        snapshot = MapSnapshot(layers=(surfaces, given))
        save_figure(map_figure(Panel(title="", snapshot=snapshot, believed=believed)), path)
        with Image.open(path) as picture:
            images.append(np.asarray(picture.convert("RGB")).astype(int))
    purple = [np.abs(image - rgb(PLACE)).max(axis=-1) < 25 for image in images]
    assert purple[0].sum() == 0
    # Three nodes of 6 points across, at 110 dots an inch.
    assert purple[1].sum() > 3 * 50


def test_the_legend_names_all_that_is_drawn_of_a_network(network):
    axes = Figure().add_subplot()
    draw_layer(network, axes)
    assert set(axes.get_legend_handles_labels()[1]) == {"places", "links", "exits"}


def test_the_picture_shows_home_on_top_of_the_place_that_is_there(tmp_path):
    node = PlaceNode(id=0, label="", pose=np.zeros(3), middle=np.zeros(2))
    snapshot = MapSnapshot(layers=(PlaceGraph(nodes=(node,), current=0, home=0),))
    believed = np.array([[0.0, 0, 0], [3, 0, 0]])
    save_figure(
        map_figure(Panel(title="", snapshot=snapshot, believed=believed)), tmp_path / "a.png"
    )
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture.convert("RGB"))
    home = (pixels == rgb(HOME)).all(axis=2)
    on_map, in_legend = home[:-60].sum(), home[-60:].sum()
    assert in_legend > 0
    assert on_map == pytest.approx(in_legend, rel=0.1)  # But for how the edges are blended.
