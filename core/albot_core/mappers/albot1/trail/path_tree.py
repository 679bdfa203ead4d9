"""The tree of shortest paths home over linked points, kept up to date link by link.

A new link never makes a path longer. The paths that it makes shorter are updated from its ends
outward (the relaxation of Bellman and Ford), so that each point's path home is always known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.kernels.compiled import kernel

HOME = 0
"""The root, where all paths end: the first point."""
MIN_LINK = 1e-3
"""Minimum length of a link (m): over links of length 0, paths could run in circles."""


class PathGraph(NamedTuple):
    """Points, links and the tree of paths home, in arrays that have room for more."""

    counts: np.ndarray
    """(2,) int64: the number of points and the number of links."""
    distances: np.ndarray
    """(points,) float64: length of the path home (m); infinite if there is none."""
    parents: np.ndarray
    """(points,) int64: the next point on the path home; -1 at home, and if there is no path."""
    heads: np.ndarray
    """(points,) int64: the latest link end at each point, -1 for none. The ends of link k have the
    numbers 2 k and 2 k + 1."""
    ends: np.ndarray
    """(links, 2) int64: the points that each link joins."""
    lengths: np.ndarray
    """(links,) float64: the length of each link (m)."""
    previous: np.ndarray
    """(links, 2) int64: for each end, the previous link end at the same point, as in `heads`."""


class ShortestPathTree:
    """The paths home from points that are numbered in the order in which they were added."""

    def __init__(self) -> None:
        self.graph = _empty_graph(32, 128)
        """The arrays, which are replaced by larger ones when they are full."""

    def add_point(self) -> None:
        """Add a point to which no path leads yet."""
        self.ensure_room()
        add_point(self.graph)

    def link(
        self, point: int, others: Bool[np.ndarray, "points"], lengths: Float64[np.ndarray, "points"]
    ) -> None:
        """Link a point with others at the given distances (m). Existing links stay as they are."""
        self.ensure_room(len(others))
        link_point(self.graph, point, others, lengths)

    def ensure_room(self, links: int = 0) -> bool:
        """Make room for a point and `links` links; return whether the arrays were replaced."""
        graph, (points, used) = self.graph, self.graph.counts.tolist()
        room = len(graph.distances), len(graph.lengths)
        wanted = (
            2 * points if points == room[0] else room[0],
            2 * (used + links) if used + links > room[1] else room[1],
        )
        if wanted == room:
            return False
        self.graph = _empty_graph(*wanted)
        for old, new in zip(graph, self.graph, strict=True):
            new[: len(old)] = old
        return True

    @property
    def distances(self) -> Float64[np.ndarray, "points"]:
        """The length of the path home from each point (m); infinite if there is none."""
        distances: Float64[np.ndarray, "points"] = self.graph.distances[: self.graph.counts[0]]
        return distances

    @property
    def parents(self) -> Int64[np.ndarray, "points"]:
        """The next point on the path home from each; -1 at home, and if there is no path."""
        parents: Int64[np.ndarray, "points"] = self.graph.parents[: self.graph.counts[0]]
        return parents

    @property
    def links(self) -> Float64[np.ndarray, "links 3"]:
        """The links in the order in which they were made: two points, and the length (m)."""
        graph, links = self.graph, self.graph.counts[1]
        return np.column_stack((graph.ends[:links], graph.lengths[:links]))


def rebuilt_path_tree(points: int, links: Float64[np.ndarray, "links 3"]) -> ShortestPathTree:
    """Return the tree over `points` points with these `links` (see `ShortestPathTree.links`)."""
    tree = ShortestPathTree()
    tree.graph = _empty_graph(max(2 * points, 32), max(2 * len(links), 128))
    _rebuild(tree.graph, points, links[:, :2].astype(np.int64), links[:, 2].copy())
    return tree


def _empty_graph(points: int, links: int) -> PathGraph:
    return PathGraph(
        counts=np.zeros(2, np.int64),
        distances=np.full(points, np.inf),
        parents=np.full(points, -1),
        heads=np.full(points, -1),
        ends=np.zeros((links, 2), np.int64),
        lengths=np.zeros(links),
        previous=np.full((links, 2), -1),
    )


@kernel()
def _rebuild(graph: PathGraph, points: int, pairs: np.ndarray, lengths: np.ndarray) -> None:
    for _ in range(points):
        add_point(graph)
    for k in range(pairs.shape[0]):
        _add_link(graph, pairs[k, 0], pairs[k, 1], lengths[k])


@kernel()
def add_point(graph: PathGraph) -> None:
    """Add a point to which no path leads yet. There must be room."""
    point = graph.counts[0]
    graph.distances[point] = 0.0 if point == HOME else np.inf
    graph.parents[point] = graph.heads[point] = -1
    graph.counts[0] += 1


@kernel(arrays=True)
def link_point(graph: PathGraph, point: int, others: np.ndarray, lengths: np.ndarray) -> None:
    """Link a point with the `others` (points,) that it is not linked with yet."""
    linked = np.zeros(others.shape[0], np.bool_)
    linked[point] = True
    end = graph.heads[point]
    while end >= 0:
        linked[graph.ends[end >> 1, 1 - (end & 1)]] = True
        end = graph.previous[end >> 1, end & 1]
    for other in range(others.shape[0]):
        if others[other] and not linked[other]:
            _add_link(graph, point, other, max(lengths[other], MIN_LINK))


@kernel()
def _add_link(graph: PathGraph, one: int, other: int, length: float) -> None:
    """Link two points, and shorten the paths home that lead over the link."""
    link = graph.counts[1]
    graph.counts[1] += 1
    graph.ends[link, 0], graph.ends[link, 1] = one, other
    graph.lengths[link] = length
    _file_ends(graph, link)
    # All other links are relaxed already: a change can spread only from an end of this link.
    if _relax(graph, one, other, length):
        _spread(graph, other)
    elif _relax(graph, other, one, length):
        _spread(graph, one)


@kernel()
def _file_ends(graph: PathGraph, link: int) -> None:
    """Put a link's ends first in the lists of their points."""
    for side in range(2):
        point = graph.ends[link, side]
        graph.previous[link, side] = graph.heads[point]
        graph.heads[point] = 2 * link + side


@kernel()
def _relax(graph: PathGraph, here: int, there: int, length: float) -> bool:
    """Lead the path home from `there` over `here` if that is shorter; return whether it is.

    Of two paths of equal length the one over the earlier point is kept, so that the tree does not
    depend on the order in which links were made.
    """
    distance = graph.distances[here] + length
    if distance == graph.distances[there] and here < graph.parents[there]:
        graph.parents[there] = here
    if distance >= graph.distances[there]:
        return False
    graph.distances[there], graph.parents[there] = distance, here
    return True


@kernel(arrays=True)
def _spread(graph: PathGraph, source: int) -> None:
    """Shorten the paths home that are shorter by way of a point, and then those by way of these."""
    queue = np.empty(graph.counts[0], np.int64)
    is_queued = np.zeros(graph.counts[0], np.bool_)
    queue[0], is_queued[source] = source, True
    first, count = 0, 1
    while count:
        here = queue[first]
        is_queued[here] = False
        first, count = (first + 1) % queue.shape[0], count - 1
        end = graph.heads[here]
        while end >= 0:
            link, there = end >> 1, graph.ends[end >> 1, 1 - (end & 1)]
            end = graph.previous[link, end & 1]
            if _relax(graph, here, there, graph.lengths[link]) and not is_queued[there]:
                queue[(first + count) % queue.shape[0]] = there
                is_queued[there] = True
                count += 1


@kernel()
def keep_points(graph: PathGraph, numbers: np.ndarray) -> None:
    """Forget points: `numbers` (points,) are the new numbers of those kept, -1 for others.

    The new numbers must have the same order. With each point its whole path home must be kept, so
    that no path becomes longer.
    """
    points, links = graph.counts[0], graph.counts[1]
    graph.counts[:] = 0
    for point in range(points):
        if numbers[point] >= 0:
            parent, distance = graph.parents[point], graph.distances[point]
            add_point(graph)
            graph.distances[numbers[point]] = distance
            graph.parents[numbers[point]] = numbers[parent] if parent >= 0 else -1
    for link in range(links):
        one, other = numbers[graph.ends[link, 0]], numbers[graph.ends[link, 1]]
        if one >= 0 and other >= 0:
            kept = graph.counts[1]
            graph.ends[kept, 0], graph.ends[kept, 1] = one, other
            graph.lengths[kept] = graph.lengths[link]
            _file_ends(graph, kept)
            graph.counts[1] += 1
