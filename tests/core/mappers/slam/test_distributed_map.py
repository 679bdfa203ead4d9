"""DP-SLAM's one map and its ancestry tree, against a map of each particle's own."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.slam.ancestry import (
    add_node,
    fill_particle_maps,
    make_particle_maps,
    order_nodes,
    prune,
)
from albot_core.mappers.slam.distributed_map import DistributedMap
from albot_core.mappers.slam.observations import (
    SIZES,
    TILE_SQUARES,
    add_observation,
    made_square_at,
    own_observation,
    release_empty_tiles,
)
from albot_core.mappers.slam.tiles import NONE

MOST = 6
"""Particles."""

Squares = dict[tuple[int, int], tuple[float, float]]
"""Beams stopped and distance by row and column: a map of a particle's own."""


class Filter:
    """The one map, and the maps that the particles would have of their own."""

    def __init__(self) -> None:
        self.map = DistributedMap(MOST, 0.1)
        self.nodes = np.zeros(1, np.int16)
        self.copies: list[Squares] = [{}]

    def resample(self, descendants: list[int]) -> None:
        parents = np.repeat(np.arange(len(descendants)), descendants)
        room = np.empty(2 * MOST, np.uint8)
        counts = np.array(descendants)
        prune(self.map.arrays, self.map.tree, self.nodes, counts, room)
        nodes = [add_node(self.map.tree, self.nodes[parent]) for parent in parents]
        self.nodes = np.array(nodes, np.int16)
        self.copies = [dict(self.copies[parent]) for parent in parents]

    def observe(self, particle: int, row: int, column: int, distance: float) -> None:
        self.map.reserve_tiles(np.array((-2, -2)), np.array((2, 2)))
        self.map.reserve_observations(64, 2)
        arrays, tree = self.map.arrays, self.map.tree
        square, node = made_square_at(arrays, row, column), self.nodes[particle]
        stopped, before = self.copies[particle].get((row, column), (0.0, 0.0))
        now = stopped + 1, float(np.float32(before + distance))
        self.copies[particle][row, column] = now
        own = own_observation(arrays, square, node)
        if own == NONE:
            add_observation(arrays, tree, square, node, *now)
        else:
            arrays.beams[own] = now

    def known_by(self, particle: int) -> Squares:
        beams, corner = self.map.known_by(int(self.nodes[particle]))
        known = np.argwhere(beams[:, :, 1] > 0)
        return {(r + corner[0], c + corner[1]): tuple(beams[r, c]) for r, c in known.tolist()}

    def check(self) -> None:
        """All that must hold of map and tree, and that the particles know what they would alone."""
        arrays, tree = self.map.arrays, self.map.tree
        for particle, copy in enumerate(self.copies):
            assert self.known_by(particle) == copy
        assert self.map.count_known(self.nodes) == sum(map(len, self.copies))
        # The tree is minimal: each node has two children or more, or is a particle's.
        children = Counter(tree.parent[tree.parent != NONE].tolist())
        is_node = tree.children != NONE
        for node in np.flatnonzero(is_node):
            assert tree.children[node] == children[node]
            assert children[node] >= 2 or (children[node] == 0 and node in self.nodes)
        assert is_node.sum() <= 2 * len(self.nodes) - 1
        assert order_nodes(tree) == is_node.sum()
        # Each node lists the squares that have an observation of its own, once.
        listed = [
            (node, square)
            for node in np.flatnonzero(is_node).tolist()
            for square in self.squares_of(node)
        ]
        held = []
        for square in np.flatnonzero(arrays.first != NONE).tolist():
            first, count = arrays.first[square], arrays.counts[square]
            assert 1 <= count <= 2 << arrays.size[square]
            held += [(node, square) for node in arrays.owner[first : first + count].tolist()]
        assert sorted(listed) == sorted(held)
        assert len(set(held)) == len(held) == self.map.observations
        # No square has more observations than the tree has nodes; no place is lost or used twice.
        places = np.zeros(arrays.used[0], np.int64)
        for square in np.flatnonzero(arrays.first != NONE).tolist():
            first = arrays.first[square]
            places[first : first + (2 << arrays.size[square])] += 1
        for size in range(SIZES):
            block, count = arrays.free_blocks[size], 0
            while block != NONE:
                places[block : block + (2 << size)] += 1
                block, count = arrays.chain[block // 2], count + 1
            assert count == arrays.free_counts[size]
        assert (places == 1).all()
        uses = (arrays.first.reshape(-1, TILE_SQUARES) != NONE).sum(axis=1)
        np.testing.assert_array_equal(arrays.tile_uses, uses)
        # Chunks are in a list or free.
        chunk, free = tree.free_chunk[0], 0
        while free < arrays.free_counts[SIZES + 1]:
            chunk, free = tree.chunks[chunk, 0], free + 1
        used = sum(1 for node in np.flatnonzero(is_node) for _ in self.chunks_of(node))
        assert used + free == len(tree.chunks)

    def chunks_of(self, node: int) -> list[int]:
        chunks, chunk = [], self.map.tree.chunk[node]
        while chunk != NONE:
            chunks.append(int(chunk))
            chunk = self.map.tree.chunks[chunk, 0]
        return chunks

    def squares_of(self, node: int) -> list[int]:
        chunks = self.map.tree.chunks
        return [s for c in self.chunks_of(node) for s in chunks[c, 2 : 2 + chunks[c, 1]].tolist()]


@st.composite
def generations(draw):
    """What happens in a run: how many descendants each particle has, and what each sees then."""
    count, knowledge = 1, []
    for _ in range(draw(st.integers(1, 12))):
        parents = draw(st.lists(st.integers(0, count - 1), min_size=1, max_size=MOST))
        descendants = np.bincount(parents, minlength=count).tolist()
        count = sum(descendants)
        square = st.tuples(st.integers(-3, 3), st.integers(-3, 3), st.floats(0.01, 1.0))
        seen = draw(st.lists(st.lists(square, max_size=4), min_size=count, max_size=count))
        knowledge.append((descendants, seen))
    return knowledge


def led(knowledge) -> Filter:
    filtered = Filter()
    for descendants, seen in knowledge:
        filtered.resample(descendants)
        for particle, squares in enumerate(seen):
            for row, column, distance in squares:
                filtered.observe(particle, row, column, distance)
        release_empty_tiles(filtered.map.arrays)
    return filtered


@settings(max_examples=150, deadline=None)
@given(generations())
def test_each_particle_knows_what_it_would_in_a_map_of_its_own(knowledge):
    led(knowledge).check()


def random_run(seed: int, rounds: int, squares: int) -> Filter:
    rng = np.random.default_rng(seed)
    filtered = Filter()
    for _ in range(rounds):
        count = len(filtered.nodes)
        descendants = rng.multinomial(rng.integers(1, MOST + 1), rng.dirichlet(np.ones(count)))
        filtered.resample(descendants.tolist())
        for particle in range(len(filtered.nodes)):
            for row, column in rng.integers(-40, 40, (squares, 2)).tolist():
                filtered.observe(particle, row, column, float(rng.uniform(0.01, 1)))
        release_empty_tiles(filtered.map.arrays)
    return filtered


def test_long_runs_with_long_lists_of_squares():
    for seed in range(3):
        filtered = random_run(seed, 40, 30)
        filtered.check()
        assert any(len(filtered.chunks_of(node)) > 1 for node in range(2 * MOST))


def test_one_survivor_leaves_one_node_and_one_observation_a_square():
    all_see_it = [[(0, 0, 0.5), (1, k, 0.5)] for k in range(3)]
    filtered = led([([3], all_see_it), ([1, 1, 2], [*all_see_it, [(2, 2, 0.1)]])])
    assert filtered.map.observations == 9
    assert filtered.map.squares == 5
    filtered.resample([0, 0, 0, 1])
    filtered.check()
    assert (filtered.map.tree.children != NONE).sum() == 1
    assert filtered.map.observations == filtered.map.squares == 3


def test_the_local_map_is_what_each_particle_knows():
    filtered = random_run(2, 15, 40)
    arrays, tree = filtered.map.arrays, filtered.map.tree
    maps = make_particle_maps(8000, MOST)
    maps.nodes[: len(filtered.nodes)] = filtered.nodes
    nodes = order_nodes(tree)
    squares = {s for copy in filtered.copies for s in copy}
    for row, column in squares:
        slot = fill_particle_maps(arrays, tree, maps, nodes, made_square_at(arrays, row, column))
        known = [copy.get((row, column), (0.0, 0.0)) for copy in filtered.copies]
        found = maps.beams[abs(slot), : len(known)]
        np.testing.assert_array_equal(found, np.array(known, np.float32))
        assert (slot < 0) == all(distance > 0 and stopped == 0 for stopped, distance in known)
    assert maps.rows[0] == 1 + len(squares)


def test_a_square_that_is_empty_for_all_is_marked():
    filtered = Filter()
    filtered.observe(0, 0, 0, 1.0)
    filtered.map.arrays.beams[filtered.map.arrays.first[0], 0] = 0.0
    maps = make_particle_maps(10, MOST)
    maps.nodes[0] = 0
    arrays, tree = filtered.map.arrays, filtered.map.tree
    square = made_square_at(arrays, 0, 0)
    assert fill_particle_maps(arrays, tree, maps, order_nodes(tree), square) == -1


def test_what_is_restored_is_the_same_map():
    filtered = random_run(4, 15, 20)
    state = filtered.map.state()
    twin = Filter()
    twin.map.restore(state)
    twin.nodes, twin.copies = filtered.nodes.copy(), [dict(copy) for copy in filtered.copies]
    twin.check()
    for key, array in twin.map.state().items():
        np.testing.assert_array_equal(array, state[key], err_msg=key)
    for one in (filtered, twin):
        one.resample([2] + [0] * (len(one.nodes) - 2) + [1])
        one.observe(1, 0, 0, 0.5)
    twin.check()
    for key, array in twin.map.state().items():
        np.testing.assert_array_equal(array, filtered.map.state()[key], err_msg=key)


def _changed(array: np.ndarray, place: int, value: float) -> np.ndarray:
    changed = array.copy()
    changed.flat[place] = value
    return changed


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("tree.parents", lambda a: a[:-1], "shape"),
        ("tree.parents", lambda a: a * 0 - 1, "tree.parents"),
        ("tree.parents", lambda a: np.roll(a, 1), "tree"),
        ("tree.parents", lambda a: _changed(a, 0, 99), "tree.parents"),
        ("map.places", lambda a: a * 0, "each once"),
        ("map.places", lambda a: a * 10**9, "tiles at most"),
        ("map.counts", lambda a: a + 1, "map.counts"),
        ("map.counts", lambda a: _changed(a, 0, -1), "map.counts"),
        ("map.owners", lambda a: a + 50, "map.owners"),
        ("map.owners", lambda a: a * 0 - 1, "map.owners"),
        ("map.beams", lambda a: a * np.nan, "finite"),
        ("map.beams", lambda a: -a, "numbers from 0"),
    ],
)
def test_damaged_arrays_are_refused(name, damage, message):
    filtered = random_run(5, 10, 20)
    state = filtered.map.state()
    state[name] = damage(state[name])
    with pytest.raises(InputError, match=message):
        Filter().map.restore(state)


def test_ground_beyond_all_buildings_is_refused_and_takes_no_memory():
    filtered = random_run(6, 5, 10)
    before = filtered.map.bytes
    far = np.array(((0.0, 0.0, 0.0), (1e5, 0.0, 0.0)))
    for reserve in (filtered.map.check_ground, filtered.map.reserve_ground):
        with pytest.raises(InputError, match=r"occupancy grid: expected ground that fits"):
            reserve(far, 50.0)
    assert filtered.map.bytes == before
    filtered.check()
