"""The desert of Sahabot 2's experiments: open ground with posts for landmarks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points, Segments
from albot_maps.world import World

POST_RADIUS = 0.2
"""Radius of a post (m)."""
_CORNERS = 12
"""Number of sides of a post."""
_EDGE = 45.0
"""Distance from the nest, along an axis, to the edge of the ground (m): no laser sees so far."""


def posts(middles: Points) -> Segments:
    """Return the outlines of posts at some places (m)."""
    angles = 2 * np.pi * np.arange(_CORNERS + 1) / _CORNERS
    ring = POST_RADIUS * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    corners = middles[:, None] + ring
    return np.concatenate((corners[:, :-1], corners[:, 1:]), axis=-1).reshape(-1, 4)


def desert(middles: Points, edge: float = _EDGE) -> World:
    """Return open ground with posts at some places around the nest, which is at the origin.

    Args:
        middles: The places of the posts (m).
        edge: Distance along an axis to the edge of the ground (m).
    """
    corners = edge * np.array(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)))
    around = np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)
    walls = np.concatenate((around, posts(middles))) if len(middles) else around
    return World(name="desert", walls=walls, starts=np.zeros((1, 3)))


def drawn_posts(
    count: int, nearest: float, reach: float, spacing: float, rng: np.random.Generator
) -> Float64[np.ndarray, "posts 2"]:
    """Return places drawn uniformly from a ring around the nest, one after another (m).

    Args:
        count: Number of places.
        nearest: Inner radius of the ring (m).
        reach: Outer radius of the ring (m).
        spacing: Least distance between two places (m). It must leave room for all.
        rng: Draws the places.
    """
    places: list[np.ndarray] = []
    while len(places) < count:
        place = rng.uniform(-reach, reach, 2)
        is_in_ring = nearest <= np.hypot(*place) <= reach
        if is_in_ring and all(np.hypot(*(place - other)) >= spacing for other in places):
            places.append(place)
    return np.array(places)
