"""Walls that are missing in view, and walls across ways that are known to be free."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.places.contradictions import count_across, share_missing

AHEAD = [2.0, -1.0, 2.0, 1.0]
"""A wall 2 m ahead of the origin, from right to left as it is seen from there."""
BEHIND_IT, BEFORE_IT = [4.0, -3.0, 4.0, 3.0], [1.0, -2.0, 1.0, 2.0]
SHORT = 0.4


def lines(*rows: list[float]) -> np.ndarray:
    return np.reshape(rows, (-1, 4)).astype(float)


@pytest.mark.parametrize(
    ("known", "view", "share"),
    [
        ([AHEAD], [AHEAD], 0.0),
        ([AHEAD], [BEHIND_IT], 1.0),  # The view sees past it.
        ([AHEAD], [BEFORE_IT], 0.0),  # It is hidden.
        ([AHEAD], [], 0.0),  # Nothing is seen there.
        ([AHEAD], [[-4.0, 3.0, -4.0, -3.0]], 0.0),
        ([AHEAD, BEHIND_IT], [BEHIND_IT], 8 / 32),  # In pieces of 25 cm.
        ([[2.0, -0.1, 2.0, 0.1]], [BEHIND_IT], 0.0),  # Too short.
        ([[8.0, -1.0, 8.0, 1.0]], [[10.0, -3.0, 10.0, 3.0]], 0.0),  # Too far away.
        ([[2.0, 1.0, 2.0, -1.0]], [AHEAD], 0.0),  # The other side of a wall hides as well.
    ],
)
def test_a_known_wall_is_missing_where_the_view_sees_past_it(known, view, share):
    for at in (np.zeros(2), np.array([3.0, -7.0])):
        moved = lines(*known) + np.tile(at, 2), lines(*view) + np.tile(at, 2)
        assert share_missing(*moved, at, SHORT) == pytest.approx(share)


@pytest.mark.parametrize(
    ("seen", "known", "ways", "count"),
    [
        ([AHEAD], [], [[0.0, 0.1, 4.0, 0.1]], 1),
        ([AHEAD], [], [[0.0, 0.1, 4.0, 0.1], [0.0, 0.1, 4.0, 0.1]], 1),
        ([AHEAD], [], [[0.0, 0.1, 4.0, 0.1], [0.0, -0.6, 4.0, -0.6]], 2),
        ([AHEAD], [AHEAD], [[0.0, 0.1, 4.0, 0.1]], 0),  # Known to be there.
        ([AHEAD], [], [[0.0, 1.5, 4.0, 1.5]], 0),  # Past its end.
        ([AHEAD], [], [[0.0, 0.1, 1.5, 0.1]], 0),  # It ends before.
        ([AHEAD], [], [], 0),
        ([[2.0, -0.1, 2.0, 0.1]], [], [[0.0, 0.0, 4.0, 0.0]], 0),  # Too short.
    ],
)
def test_a_wall_lies_across_a_way(seen, known, ways, count):
    assert count_across(lines(*seen), lines(*known), lines(*ways), SHORT) == count
