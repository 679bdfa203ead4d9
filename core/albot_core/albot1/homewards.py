"""The shortest ways home over the points of a trail, kept up to date link by link.

A link never makes a way longer, so what it makes shorter spreads from its ends (the relaxation
of Bellman and Ford), and each point's way is there when it is asked for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numba import njit

HOME = 0
"""The point where all ways end: the first."""
SHORTEST = 1e-3
"""A link is at least so long (m): ways of no length could run in circles."""


class _Graph(NamedTuple):
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
        self._graph = _made(32, 128)

    def add_point(self) -> None:
        """One point more, to which no way leads yet."""
        graph = self._graph
        points, _ = graph.counts
        if points == len(graph.lengths):
            self._graph = graph = _copied(graph, 2 * points, len(graph.spans))
        graph.lengths[points] = 0.0 if points == HOME else np.inf
        graph.towards[points] = graph.heads[points] = -1
        graph.counts[0] += 1

    def link(
        self, point: int, others: Bool[np.ndarray, "points"], spans: Float64[np.ndarray, "points"]
    ) -> None:
        """Join a point with others that are so far away (m); links that there are stay."""
        graph = self._graph
        needed = int(graph.counts[1]) + len(others)
        if needed > len(graph.spans):
            self._graph = graph = _copied(graph, len(graph.lengths), 2 * needed)
        link_all(graph, point, others, spans)

    def link_pairs(self, links: Float64[np.ndarray, "links 3"]) -> None:
        """Join pairs of points, each pair once, as in `links`."""
        graph = self._graph
        needed = int(graph.counts[1]) + len(links)
        if needed > len(graph.spans):
            self._graph = graph = _copied(graph, len(graph.lengths), 2 * needed)
        join_pairs(graph, links[:, :2].astype(np.int64), links[:, 2].copy())

    @property
    def lengths(self) -> Float64[np.ndarray, "points"]:
        """The length of the way home from each point (m); infinite where there is none."""
        lengths: Float64[np.ndarray, "points"] = self._graph.lengths[: self._graph.counts[0]]
        return lengths

    @property
    def towards(self) -> Int64[np.ndarray, "points"]:
        """The next point on the way home from each; -1 at home, and where there is none."""
        towards: Int64[np.ndarray, "points"] = self._graph.towards[: self._graph.counts[0]]
        return towards

    @property
    def links(self) -> Float64[np.ndarray, "links 3"]:
        """The links in the order in which they were made: two points, and how long it is (m)."""
        graph, links = self._graph, self._graph.counts[1]
        return np.column_stack((graph.ends[:links], graph.spans[:links]))


def rebuilt_homewards(points: int, links: Float64[np.ndarray, "links 3"]) -> Homewards:
    """The ways home over so many points with these `links`."""
    ways = Homewards()
    for _ in range(points):
        ways.add_point()
    ways.link_pairs(links)
    return ways


def _made(points: int, links: int) -> _Graph:
    """No points and no links, with room for so many."""
    return _Graph(
        counts=np.zeros(2, np.int64),
        lengths=np.full(points, np.inf),
        towards=np.full(points, -1),
        heads=np.full(points, -1),
        ends=np.zeros((links, 2), np.int64),
        spans=np.zeros(links),
        before=np.full((links, 2), -1),
    )


def _copied(graph: _Graph, points: int, links: int) -> _Graph:
    """The same with room for so many points and links."""
    larger = _made(points, links)
    for old, new in zip(graph, larger, strict=True):
        new[: len(old)] = old
    return larger


@njit(cache=True, error_model="numpy")
def link_all(graph: _Graph, point: int, others: np.ndarray, spans: np.ndarray) -> None:
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


@njit(cache=True, error_model="numpy")
def join_pairs(graph: _Graph, pairs: np.ndarray, spans: np.ndarray) -> None:
    """Join pairs of points (links, 2) that are not joined yet."""
    for k in range(pairs.shape[0]):
        _join(graph, pairs[k, 0], pairs[k, 1], spans[k])


@njit(cache=True, error_model="numpy")
def _join(graph: _Graph, one: int, other: int, span: float) -> None:
    """Join two points, and shorten the ways home that lead over the link."""
    link = graph.counts[1]
    graph.counts[1] += 1
    graph.ends[link, 0], graph.ends[link, 1] = one, other
    graph.spans[link] = span
    for side in range(2):
        here = graph.ends[link, side]
        graph.before[link, side] = graph.heads[here]
        graph.heads[here] = 2 * link + side
    _spread(graph, one)
    _spread(graph, other)


@njit(cache=True, error_model="numpy")
def _spread(graph: _Graph, source: int) -> None:
    """Shorten the ways home that are shorter by way of a point, and those by way of these.

    Of ways of one length the one over the earlier point is kept, so that the ways do not go
    by the order in which links were made.
    """
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
            there = graph.ends[end >> 1, 1 - (end & 1)]
            length = graph.lengths[here] + graph.spans[end >> 1]
            end = graph.before[end >> 1, end & 1]
            if length == graph.lengths[there] and here < graph.towards[there]:
                graph.towards[there] = here
            if length < graph.lengths[there]:
                graph.lengths[there], graph.towards[there] = length, here
                if not queued[there]:
                    waiting[(first + count) % waiting.shape[0]] = there
                    queued[there] = True
                    count += 1
