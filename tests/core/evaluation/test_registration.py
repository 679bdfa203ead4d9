"""Registration: a part of a floor is found where it is, and nothing is an error."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.evaluation.map_quality import sample_segments
from albot_core.evaluation.registration import register
from albot_core.geometry.poses import compose, inverse, transform_points

FLOOR = np.array(
    [
        *([0.0, 0, 9, 0], [9, 0, 9, 3], [9, 3, 4, 3], [4, 3, 4, 7], [4, 7, 2, 7]),
        *([2.0, 7, 2, 6], [2, 6, 0, 6], [0, 6, 0, 0], [6, 1, 7, 1]),
    ]
)


@pytest.mark.parametrize("frame", [[30.0, -12.0, 2.4], [-3.0, 5.0, -0.31]])
def test_a_part_of_the_floor_is_laid_where_it_belongs(frame: list[float]) -> None:
    true = np.array(frame)
    walls = transform_points(true, sample_segments(FLOOR, 0.05))
    rng = np.random.default_rng(0)
    points = sample_segments(FLOOR[[0, 1, 2, 3, 8]], 0.1)
    found = register(points + rng.normal(0, 0.02, points.shape), walls)
    x, y, turn = compose(inverse(true), found)
    assert np.hypot(x, y) < 0.08
    assert abs(turn) < 0.02


def test_nothing_cannot_be_laid() -> None:
    with pytest.raises(InputError, match="points and walls, found 0 and 1"):
        register(np.empty((0, 2)), np.zeros((1, 2)))
