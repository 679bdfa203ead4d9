"""Mazes: their cells, and the openings between these."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest

from albot_maps import World, load_world


def _cells(world: World) -> nx.Graph:
    """The cells (column, row), joined where there is an opening."""
    where = {room.name: tuple(map(int, room.name[5:].split("-"))) for room in world.rooms}
    cells = nx.Graph()
    cells.add_nodes_from(where.values())
    for opening in world.exits:
        one, other = opening.rooms
        cells.add_edge(where[one], where[other])
    assert len(cells.edges) == len(world.exits), "no two openings join the same cells"
    return cells


@pytest.mark.parametrize("size", [(2, 2), (9, 4)])
def test_without_loops_there_is_one_way_between_any_two_cells(size: tuple[int, int]) -> None:
    columns, rows = size
    for seed in range(5):
        cells = _cells(load_world(f"random:maze:{seed}?columns={columns}&rows={rows}&loops=0"))
        assert nx.is_tree(cells)
        assert set(cells) == {(x, y) for x in range(1, columns + 1) for y in range(1, rows + 1)}
        for one, other in cells.edges:
            assert np.abs(np.subtract(one, other)).sum() == 1


@pytest.mark.parametrize("symmetry", ["false", "true"])
def test_each_loop_is_one_opening_more(symmetry: str) -> None:
    cells = _cells(load_world(f"random:maze:3?columns=6&rows=5&loops=4&symmetry={symmetry}"))
    assert nx.is_connected(cells)
    assert len(cells.edges) == 6 * 5 - 1 + 4
    mirrored = nx.relabel_nodes(cells, {(x, y): (7 - x, y) for x, y in cells})
    assert nx.utils.edges_equal(cells.edges, mirrored.edges) == (symmetry == "true")


def test_ways_branch_and_turn() -> None:
    """A walk goes on from where it is, and back where it cannot: not all from one cell."""
    cells = _cells(load_world("random:maze:1?columns=20&rows=20&loops=0"))
    degrees = [degree for _, degree in cells.degree]
    assert {1, 2, 3} <= set(degrees)
    assert max(nx.eccentricity(cells).values()) > 60
