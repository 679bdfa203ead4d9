"""Shortest paths home kept up to date link by link, against Dijkstra's over all links."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from albot_core.mappers.albot1.trail.path_tree import (
    MIN_LINK,
    ShortestPathTree,
    keep_points,
    rebuilt_path_tree,
)

POINTS = 12
_ENDS = st.integers(0, POINTS - 1)


@settings(deadline=None)
@given(st.lists(st.tuples(_ENDS, _ENDS, st.sampled_from((0.0, 0.5, 1.0, 1.5, 2.0))), max_size=40))
def test_the_paths_are_the_shortest_in_whatever_order_links_come(
    links: list[tuple[int, int, float]],
) -> None:
    tree = ShortestPathTree()
    for _ in range(POINTS):
        tree.add_point()
    lengths: dict[tuple[int, int], float] = {}
    for one, other, length in links:
        others = np.arange(POINTS) == other
        tree.link(one, others, np.full(POINTS, length))
        if one != other:
            lengths.setdefault((min(one, other), max(one, other)), max(length, MIN_LINK))
    assert len(tree.links) == len(lengths)
    pairs = np.array(list(lengths), np.int64).reshape(-1, 2)
    graph = csr_array((list(lengths.values()), (pairs[:, 0], pairs[:, 1])), shape=(POINTS, POINTS))
    expected = dijkstra(graph, directed=False, indices=0)
    np.testing.assert_allclose(tree.distances, expected, atol=1e-12)
    for point in range(1, POINTS):
        following = int(tree.parents[point])
        assert (following < 0) == np.isinf(expected[point])
        if following >= 0:
            length = lengths[min(point, following), max(point, following)]
            assert tree.distances[point] == tree.distances[following] + length

    again = rebuilt_path_tree(POINTS, tree.links)
    backwards = rebuilt_path_tree(POINTS, tree.links[::-1].copy())
    for rebuilt in (again, backwards):
        np.testing.assert_array_equal(rebuilt.distances, tree.distances)
        np.testing.assert_array_equal(rebuilt.parents, tree.parents)


def test_there_is_always_room_for_more() -> None:
    tree = ShortestPathTree()
    for point in range(200):
        tree.add_point()
        tree.link(point, np.ones(point + 1, np.bool_), np.full(point + 1, 1.0 + point))
    assert len(tree.links) == 200 * 199 // 2
    assert tree.distances[-1] == 200.0


@settings(deadline=None)
@given(
    st.lists(st.tuples(_ENDS, _ENDS, st.floats(0.1, 2.0)), max_size=40),
    st.sets(_ENDS),
)
def test_points_forgotten_leave_the_others_paths_home_as_they_were(
    links: list[tuple[int, int, float]], wanted: set[int]
) -> None:
    tree = ShortestPathTree()
    for _ in range(POINTS):
        tree.add_point()
    for one, other, length in links:
        tree.link(one, np.arange(POINTS) == other, np.full(POINTS, length))
    kept = {0, *wanted}
    for point in wanted:
        while point > 0:
            kept.add(point)
            point = int(tree.parents[point])
    staying = sorted(kept)
    distances, before = tree.distances[staying], tree.links
    numbers = np.full(POINTS, -1)
    numbers[staying] = np.arange(len(staying))
    keep_points(tree.graph, numbers)
    np.testing.assert_array_equal(tree.distances, distances)
    both = np.isin(before[:, :2], staying).all(axis=1)
    ends = numbers[before[both, :2].astype(np.int64)]
    np.testing.assert_array_equal(tree.links, np.column_stack((ends, before[both, 2])))
    # They are what they would be if the others had never been.
    again = rebuilt_path_tree(len(staying), tree.links)
    np.testing.assert_array_equal(tree.distances, again.distances)
    np.testing.assert_array_equal(tree.parents, again.parents)
