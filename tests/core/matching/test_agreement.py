"""Two pieces of ground agree where walls fall on walls, and bare corridors tell nothing."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.structure import described
from albot_core.matching.agreement import CELLS, agreement, look_through, put_walls

ALIKE = PlacesConfig().alike._replace(shift=3.0, turn=np.pi)
ROOM = np.array(
    [[-3, -2, 4, -2], [4, -2, 4, 3], [4, 3, 1, 3], [1, 3, 1, 5], [-3, 5, -3, -2]], float
)
CORRIDOR = np.array([[-14, -1, 14, -1], [14, 1, -14, 1]], float)


def ground_of(walls: np.ndarray, pose: tuple[float, float, float]) -> tuple[np.ndarray, ...]:
    """Rows, points and cells of walls as a robot at `pose` has them."""
    seen = transform_segments(inverse(np.array(pose)), walls)
    along = np.linspace(0.0, 1.0, 120)[:, None, None]
    points = (seen[:, :2] + along * (seen[:, 2:] - seen[:, :2])).reshape(-1, 2)
    points = np.ascontiguousarray(points[np.hypot(*points.T) < 12.0])
    ground = np.zeros((CELLS, CELLS), np.uint8)
    look_through(ground, np.zeros(2), points)
    put_walls(ground, points)
    return described(seen, ALIKE), points, ground


def agreed(one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...]) -> tuple[float, np.ndarray]:
    pose = np.zeros(3)
    return agreement(*one, *other, ALIKE, pose), pose


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (1.1, -0.7, 0.4), (0.5, 1.0, -2.8)])
def test_a_room_is_known_from_elsewhere_in_it(moved: tuple[float, float, float]) -> None:
    score, pose = agreed(ground_of(ROOM, (0.0, 0.0, 0.0)), ground_of(ROOM, moved))
    assert score > 0.8
    corner = np.array([2.0, 1.0])
    np.testing.assert_allclose(
        transform_points(pose, corner), transform_points(np.array(moved), corner), atol=0.2
    )


def test_another_room_agrees_less() -> None:
    here, other = ROOM.copy(), ROOM.copy()
    other[2:4, [0, 2]] = [[4, -1.5], [-1.5, -1.5]]
    same, _ = agreed(ground_of(here, (0.0, 0.0, 0.0)), ground_of(here, (0.5, 0.3, 0.1)))
    changed, _ = agreed(ground_of(here, (0.0, 0.0, 0.0)), ground_of(other, (0.5, 0.3, 0.1)))
    assert changed < same - 0.1


def test_a_bare_corridor_is_like_itself_everywhere_and_tells_little() -> None:
    corridor, _ = agreed(ground_of(CORRIDOR, (0.0, 0.0, 0.0)), ground_of(CORRIDOR, (1.0, 0.0, 0.0)))
    room, _ = agreed(ground_of(ROOM, (0.0, 0.0, 0.0)), ground_of(ROOM, (1.0, 0.0, 0.0)))
    assert corridor < 0.6 < room


def test_what_cannot_be_aligned_is_infinitely_far() -> None:
    nothing = np.empty((0, 8)), np.ones((1, 2)), np.zeros((CELLS, CELLS), np.uint8)
    score, pose = agreed(ground_of(ROOM, (0.0, 0.0, 0.0)), nothing)
    assert score == 0.0
    assert np.isinf(pose).all()
