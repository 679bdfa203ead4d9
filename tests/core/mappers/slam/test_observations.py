"""The blocks in which DP-SLAM's map keeps the observations of a square."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.slam.ancestry import add_node, prune
from albot_core.mappers.slam.distributed_map import DistributedMap
from albot_core.mappers.slam.observations import MapArrays, add_observation, made_square_at
from albot_core.mappers.slam.tiles import NONE

PARTICLES = 10
"""All but the last one observe the square."""
LARGE, SMALL = 3, 0
"""Sizes of blocks that have room for 16 and for 2 observations."""


def resampled(
    survivors: int, *, free_places: int = 0, has_free_block: bool = True
) -> tuple[MapArrays, int, int]:
    """A map after some of the particles that observed a square have died.

    Args:
        survivors: How many of them live on: the first ones.
        free_places: The number of places after all blocks before.
        has_free_block: Whether there is a free block for 2 observations before.

    Returns:
        The map, the square and where its block was before.
    """
    whole = DistributedMap(PARTICLES, 0.1)
    whole.reserve_tiles(np.zeros(2, np.int64), np.ones(2, np.int64))
    whole.reserve_observations(256, 4 * PARTICLES)
    whole.tree.children[0] = PARTICLES
    nodes = np.array([add_node(whole.tree, np.int16(0)) for _ in range(PARTICLES)], np.int16)
    square = made_square_at(whole.arrays, 3, 5)
    for node in nodes[:-1]:
        add_observation(whole.arrays, whole.tree, square, node, 1.0, 0.5 + float(node))
    arrays = whole.arrays
    before = int(arrays.first[square])
    assert arrays.size[square] == LARGE
    if not has_free_block:
        arrays.free_blocks[SMALL], arrays.free_counts[SMALL] = NONE, 0
    places = int(arrays.used[0]) + free_places
    arrays = arrays._replace(owner=arrays.owner[:places], beams=arrays.beams[:places])
    counts = np.ones(PARTICLES, np.int64)
    counts[survivors:-1] = 0
    prune(arrays, whole.tree, nodes, counts, np.empty(2 * PARTICLES, np.uint8))
    assert arrays.counts[square] == arrays.used[1] == survivors
    kept = slice(arrays.first[square], arrays.first[square] + survivors)
    np.testing.assert_array_equal(arrays.owner[kept], nodes[:survivors])
    np.testing.assert_array_equal(arrays.beams[kept, 1], 0.5 + nodes[:survivors])
    return arrays, square, before


@pytest.mark.parametrize(
    ("free_places", "has_free_block", "size"),
    [(0, False, LARGE), (0, True, SMALL), (2, False, SMALL), (2, True, SMALL)],
)
def test_a_block_that_is_almost_empty_is_replaced_if_there_is_a_place_for_a_smaller_one(
    free_places, has_free_block, size
):
    arrays, square, _ = resampled(1, free_places=free_places, has_free_block=has_free_block)
    assert arrays.size[square] == size
    assert arrays.first[square] + (2 << size) <= arrays.used[0] <= len(arrays.owner)


@pytest.mark.parametrize(("survivors", "stays"), [(4, False), (5, True)])
def test_a_block_stays_if_more_than_a_quarter_of_it_is_used(survivors, stays):
    arrays, square, before = resampled(survivors, free_places=64)
    assert (arrays.size[square] == LARGE) == stays
    assert (arrays.first[square] == before) == stays


def test_the_block_of_a_square_without_observations_is_free():
    arrays, square, before = resampled(0)
    assert arrays.first[square] == NONE
    assert arrays.free_blocks[LARGE] == before
