"""Ways home kept up to date link by link, against Dijkstra's over all of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from albot_core.mappers.albot1.homewards import SHORTEST, Homewards, keep_points, rebuilt_homewards

POINTS = 12
_ENDS = st.integers(0, POINTS - 1)


@settings(deadline=None)
@given(st.lists(st.tuples(_ENDS, _ENDS, st.sampled_from((0.0, 0.5, 1.0, 1.5, 2.0))), max_size=40))
def test_the_ways_are_the_shortest_in_whatever_order_links_come(
    links: list[tuple[int, int, float]],
) -> None:
    ways = Homewards()
    for _ in range(POINTS):
        ways.add_point()
    spans: dict[tuple[int, int], float] = {}
    for one, other, span in links:
        others = np.arange(POINTS) == other
        ways.link(one, others, np.full(POINTS, span))
        if one != other:
            spans.setdefault((min(one, other), max(one, other)), max(span, SHORTEST))
    assert len(ways.links) == len(spans)
    pairs = np.array(list(spans), np.int64).reshape(-1, 2)
    graph = csr_array((list(spans.values()), (pairs[:, 0], pairs[:, 1])), shape=(POINTS, POINTS))
    expected = dijkstra(graph, directed=False, indices=0)
    np.testing.assert_allclose(ways.lengths, expected, atol=1e-12)
    for point in range(1, POINTS):
        following = int(ways.towards[point])
        assert (following < 0) == np.isinf(expected[point])
        if following >= 0:
            span = spans[min(point, following), max(point, following)]
            assert ways.lengths[point] == ways.lengths[following] + span

    again = rebuilt_homewards(POINTS, ways.links)
    backwards = rebuilt_homewards(POINTS, ways.links[::-1].copy())
    for other_ways in (again, backwards):
        np.testing.assert_array_equal(other_ways.lengths, ways.lengths)
        np.testing.assert_array_equal(other_ways.towards, ways.towards)


def test_there_is_always_room_for_more() -> None:
    ways = Homewards()
    for point in range(200):
        ways.add_point()
        ways.link(point, np.ones(point + 1, np.bool_), np.full(point + 1, 1.0 + point))
    assert len(ways.links) == 200 * 199 // 2
    assert ways.lengths[-1] == 200.0


@settings(deadline=None)
@given(
    st.lists(st.tuples(_ENDS, _ENDS, st.floats(0.1, 2.0)), max_size=40),
    st.sets(_ENDS),
)
def test_points_forgotten_leave_the_others_ways_home_as_they_were(
    links: list[tuple[int, int, float]], wanted: set[int]
) -> None:
    ways = Homewards()
    for _ in range(POINTS):
        ways.add_point()
    for one, other, span in links:
        ways.link(one, np.arange(POINTS) == other, np.full(POINTS, span))
    kept = {0, *wanted}
    for point in wanted:
        while point > 0:
            kept.add(point)
            point = int(ways.towards[point])
    staying = sorted(kept)
    lengths, before = ways.lengths[staying], ways.links
    places = np.full(POINTS, -1)
    places[staying] = np.arange(len(staying))
    keep_points(ways.graph, places)
    np.testing.assert_array_equal(ways.lengths, lengths)
    both = np.isin(before[:, :2], staying).all(axis=1)
    ends = places[before[both, :2].astype(np.int64)]
    np.testing.assert_array_equal(ways.links, np.column_stack((ends, before[both, 2])))
    # They are what they would be if the others had never been.
    again = rebuilt_homewards(len(staying), ways.links)
    np.testing.assert_array_equal(ways.lengths, again.lengths)
    np.testing.assert_array_equal(ways.towards, again.towards)
