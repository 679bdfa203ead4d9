"""The way home over the places and paths of a map."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.mappers.hssh.topological_map import OPEN, Gateway


class Routes(NamedTuple):
    """The shortest ways from all gateways to home, which lies in place 0."""

    lengths: Mapping[Gateway, float]
    """Length of the way from each gateway (m); gateways without a way are missing."""
    onward: Mapping[Gateway, Gateway]
    """The next gateway on the way; `OPEN` where home is next."""


def routes_home(
    travelled: Sequence[tuple[Gateway, Gateway]],
    middles: Sequence[Float64[np.ndarray, "gateways 2"]],
    home: Float64[np.ndarray, "2"],
) -> Routes:
    """Return the shortest ways home (Dijkstra, 1959).

    Through a place, and along a path from one place to the next, the way is straight.

    Args:
        travelled: Pairs of gateways between which the robot has travelled.
        middles: The middles of the gateways of each place, in its order (m, map's frame).
        home: The robot's start (m, map's frame).
    """
    across: dict[Gateway, set[Gateway]] = {}
    for one, other in travelled:
        across.setdefault(one, set()).add(other)
        across.setdefault(other, set()).add(one)
    lengths: dict[Gateway, float] = {}
    onward: dict[Gateway, Gateway] = {}
    queue: list[tuple[float, Gateway, Gateway]] = [
        (float(np.hypot(*(middle - home))), (0, k), OPEN) for k, middle in enumerate(middles[0])
    ]
    heapq.heapify(queue)
    while queue:
        length, here, following = heapq.heappop(queue)
        if here in lengths:
            continue
        lengths[here], onward[here] = length, following
        place, number = here
        at = middles[place][number]
        beside = [(place, k) for k in range(len(middles[place])) if k != number]
        for there in (*beside, *sorted(across.get(here, ()))):
            if there not in lengths:
                step = float(np.hypot(*(middles[there[0]][there[1]] - at)))
                heapq.heappush(queue, (length + step, there, here))
    return Routes(lengths, onward)
