"""The shortest ways home over the points of a trail, kept up to date link by link.

A link never makes a way longer, so what it makes shorter spreads from its ends (the relaxation
of Bellman and Ford), and each point's way is there when it is asked for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.kernels.compiled import kernel

HOME = 0
"""The point where all ways end: the first."""
SHORTEST = 1e-3
"""A link is at least so long (m): ways of no length could run in circles."""


class Graph(NamedTuple):
    """Points and links, in arrays that have room for more."""

    counts: np.ndarray
    """(2,) int64: points and links that there are."""
    lengths: np.ndarray
    """(points,) float64: of the way home from each (m); infinite where there is none."""
    towards: np.ndarray
    """(points,) int64: the next point on it; -1 at home, and where there is none."""
    heads: np.ndarray
    """(points,) int64: the latest link of each, times two, plus one at its second end; -1."""
    ends: np.ndarray
    """(links, 2) int64: the points that each joins."""
    spans: np.ndarray
    """(links,) float64: how long each is (m)."""
    before: np.ndarray
    """(links, 2) int64: the link before it of each of its ends, as in `heads`."""


class Homewards:
    """The ways home from points that are numbered in the order in which they were added."""

    def __init__(self) -> None:
        self.graph = _made(32, 128)
        """The arrays, which are exchanged for larger ones when they are full."""

    def add_point(self) -> None:
        """One point more, to which no way leads yet."""
        self.make_room()
        add_point(self.graph)

    def link(
        self, point: int, others: Bool[np.ndarray, "points"], spans: Float64[np.ndarray, "points"]
    ) -> None:
        """Join a point with others that are so far away (m); links that there are stay."""
        self.make_room(len(others))
        link_all(self.graph, point, others, spans)

    def link_pairs(self, links: Float64[np.ndarray, "links 3"]) -> None:
        """Join pairs of points, each pair once, as in `links`."""
        self.make_room(len(links))
        join_pairs(self.graph, links[:, :2].astype(np.int64), links[:, 2].copy())

    def make_room(self, links: int = 0) -> bool:
        """See to it that there is room for a point and so many links; true for other arrays."""
        graph, (points, used) = self.graph, self.graph.counts.tolist()
        room = len(graph.lengths), len(graph.spans)
        wanted = (
            2 * points if points == room[0] else room[0],
            2 * (used + links) if used + links > room[1] else room[1],
        )
        if wanted == room:
            return False
        self.graph = _copied(graph, *wanted)
        return True

    @property
    def lengths(self) -> Float64[np.ndarray, "points"]:
        """The length of the way home from each point (m); infinite where there is none."""
        lengths: Float64[np.ndarray, "points"] = self.graph.lengths[: self.graph.counts[0]]
        return lengths

    @property
    def towards(self) -> Int64[np.ndarray, "points"]:
        """The next point on the way home from each; -1 at home, and where there is none."""
        towards: Int64[np.ndarray, "points"] = self.graph.towards[: self.graph.counts[0]]
        return towards

    @property
    def links(self) -> Float64[np.ndarray, "links 3"]:
        """The links in the order in which they were made: two points, and how long it is (m)."""
        graph, links = self.graph, self.graph.counts[1]
        return np.column_stack((graph.ends[:links], graph.spans[:links]))


def rebuilt_homewards(points: int, links: Float64[np.ndarray, "links 3"]) -> Homewards:
    """The ways home over so many points with these `links`."""
    ways = Homewards()
    ways.graph = _made(max(2 * points, 32), max(2 * len(links), 128))
    add_points(ways.graph, points)
    ways.link_pairs(links)
    return ways


def _made(points: int, links: int) -> Graph:
    """No points and no links, with room for so many."""
    return Graph(
        counts=np.zeros(2, np.int64),
        lengths=np.full(points, np.inf),
        towards=np.full(points, -1),
        heads=np.full(points, -1),
        ends=np.zeros((links, 2), np.int64),
        spans=np.zeros(links),
        before=np.full((links, 2), -1),
    )


def _copied(graph: Graph, points: int, links: int) -> Graph:
    """The same with room for so many points and links."""
    larger = _made(points, links)
    for old, new in zip(graph, larger, strict=True):
        new[: len(old)] = old
    return larger


@kernel()
def add_point(graph: Graph) -> None:
    """One point more, to which no way leads yet. There must be room."""
    point = graph.counts[0]
    graph.lengths[point] = 0.0 if point == HOME else np.inf
    graph.towards[point] = graph.heads[point] = -1
    graph.counts[0] += 1


@kernel()
def add_points(graph: Graph, count: int) -> None:
    """So many points more. There must be room."""
    for _ in range(count):
        add_point(graph)


@kernel(arrays=True)
def link_all(graph: Graph, point: int, others: np.ndarray, spans: np.ndarray) -> None:
    """Join a point with the `others` (points,) that are not joined with it yet."""
    joined = np.zeros(others.shape[0], np.bool_)
    joined[point] = True
    end = graph.heads[point]
    while end >= 0:
        joined[graph.ends[end >> 1, 1 - (end & 1)]] = True
        end = graph.before[end >> 1, end & 1]
    for other in range(others.shape[0]):
        if others[other] and not joined[other]:
            _join(graph, point, other, max(spans[other], SHORTEST))


@kernel()
def join_pairs(graph: Graph, pairs: np.ndarray, spans: np.ndarray) -> None:
    """Join pairs of points (links, 2) that are not joined yet."""
    for k in range(pairs.shape[0]):
        _join(graph, pairs[k, 0], pairs[k, 1], spans[k])


@kernel()
def _join(graph: Graph, one: int, other: int, span: float) -> None:
    """Join two points, and shorten the ways home that lead over the link."""
    link = graph.counts[1]
    graph.counts[1] += 1
    graph.ends[link, 0], graph.ends[link, 1] = one, other
    graph.spans[link] = span
    _file(graph, link)
    # No other link shortens a way as yet.
    if _relax(graph, one, other, span):
        _spread(graph, other)
    elif _relax(graph, other, one, span):
        _spread(graph, one)


@kernel()
def _file(graph: Graph, link: int) -> None:
    """Put a link before the others of its two ends."""
    for side in range(2):
        here = graph.ends[link, side]
        graph.before[link, side] = graph.heads[here]
        graph.heads[here] = 2 * link + side


@kernel()
def _relax(graph: Graph, here: int, there: int, span: float) -> bool:
    """Let the way home from a point lead over another if that is shorter; whether it is.

    Of ways of one length the one over the earlier point is kept, so that the ways do not go
    by the order in which links were made.
    """
    length = graph.lengths[here] + span
    if length == graph.lengths[there] and here < graph.towards[there]:
        graph.towards[there] = here
    if length >= graph.lengths[there]:
        return False
    graph.lengths[there], graph.towards[there] = length, here
    return True


@kernel(arrays=True)
def _spread(graph: Graph, source: int) -> None:
    """Shorten the ways home that are shorter by way of a point, and those by way of these."""
    waiting = np.empty(graph.counts[0], np.int64)
    queued = np.zeros(graph.counts[0], np.bool_)
    waiting[0], queued[source] = source, True
    first, count = 0, 1
    while count:
        here = waiting[first]
        queued[here] = False
        first, count = (first + 1) % waiting.shape[0], count - 1
        end = graph.heads[here]
        while end >= 0:
            link, there = end >> 1, graph.ends[end >> 1, 1 - (end & 1)]
            end = graph.before[link, end & 1]
            if _relax(graph, here, there, graph.spans[link]) and not queued[there]:
                waiting[(first + count) % waiting.shape[0]] = there
                queued[there] = True
                count += 1


@kernel()
def keep_points(graph: Graph, places: np.ndarray) -> None:
    """Forget points: `places` (points,) are the numbers of those that stay, -1 for others.

    They keep their order, and with each its way home, so that no way is longer than before.
    """
    points, links = graph.counts[0], graph.counts[1]
    graph.counts[:] = 0
    for point in range(points):
        if places[point] >= 0:
            towards, length = graph.towards[point], graph.lengths[point]
            add_point(graph)
            graph.lengths[places[point]] = length
            graph.towards[places[point]] = places[towards] if towards >= 0 else -1
    for link in range(links):
        one, other = places[graph.ends[link, 0]], places[graph.ends[link, 1]]
        if one >= 0 and other >= 0:
            kept = graph.counts[1]
            graph.ends[kept, 0], graph.ends[kept, 1] = one, other
            graph.spans[kept] = graph.spans[link]
            _file(graph, kept)
            graph.counts[1] += 1
