"""Two submaps match where walls fall on walls, and bare corridors tell nothing."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import inverse, transform_points, transform_segments
from albot_core.matching.line_matching import MatchConfig, line_rows
from albot_core.matching.submap_kernels import CELLS, mark_free, mark_walls
from albot_core.matching.submaps import LocalSubmap, match_submaps

CONFIG = MatchConfig(max_shift=3.0, max_turn=np.pi)
ROOM = np.array(
    [[-3, -2, 4, -2], [4, -2, 4, 3], [4, 3, 1, 3], [1, 3, 1, 5], [-3, 5, -3, -2]], float
)
CORRIDOR = np.array([[-14, -1, 14, -1], [14, 1, -14, 1]], float)


def submap_of(walls: np.ndarray, pose: tuple[float, float, float]) -> LocalSubmap:
    """The submap of walls as a robot at `pose` has them."""
    seen = transform_segments(inverse(np.array(pose)), walls)
    along = np.linspace(0.0, 1.0, 120)[:, None, None]
    points = (seen[:, :2] + along * (seen[:, 2:] - seen[:, :2])).reshape(-1, 2)
    points = np.ascontiguousarray(points[np.hypot(*points.T) < 12.0])
    grid = np.zeros((CELLS, CELLS), np.uint8)
    mark_free(grid, np.zeros(2), points)
    mark_walls(grid, points)
    return LocalSubmap(reading=0, way=0.0, lines=line_rows(seen, CONFIG), points=points, grid=grid)


def matched(one: LocalSubmap, other: LocalSubmap) -> tuple[float, np.ndarray]:
    found = match_submaps(one, other, CONFIG)
    return found.score, found.pose


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (1.1, -0.7, 0.4), (0.5, 1.0, -2.8)])
def test_a_room_is_known_from_elsewhere_in_it(moved: tuple[float, float, float]) -> None:
    score, pose = matched(submap_of(ROOM, (0.0, 0.0, 0.0)), submap_of(ROOM, moved))
    assert score > 0.8
    corner = np.array([2.0, 1.0])
    np.testing.assert_allclose(
        transform_points(pose, corner), transform_points(np.array(moved), corner), atol=0.2
    )


def test_another_room_matches_less() -> None:
    here, other = ROOM.copy(), ROOM.copy()
    other[2:4, [0, 2]] = [[4, -1.5], [-1.5, -1.5]]
    same, _ = matched(submap_of(here, (0.0, 0.0, 0.0)), submap_of(here, (0.5, 0.3, 0.1)))
    changed, _ = matched(submap_of(here, (0.0, 0.0, 0.0)), submap_of(other, (0.5, 0.3, 0.1)))
    assert changed < same - 0.1


def test_a_bare_corridor_is_like_itself_everywhere_and_tells_little() -> None:
    corridor, _ = matched(
        submap_of(CORRIDOR, (0.0, 0.0, 0.0)), submap_of(CORRIDOR, (1.0, 0.0, 0.0))
    )
    room, _ = matched(submap_of(ROOM, (0.0, 0.0, 0.0)), submap_of(ROOM, (1.0, 0.0, 0.0)))
    assert corridor < 0.6 < room


def test_what_cannot_be_aligned_is_infinitely_far() -> None:
    nothing = LocalSubmap(
        reading=0,
        way=0.0,
        lines=np.empty((0, 8)),
        points=np.ones((1, 2)),
        grid=np.zeros((CELLS, CELLS), np.uint8),
    )
    score, pose = matched(submap_of(ROOM, (0.0, 0.0, 0.0)), nothing)
    assert score == 0.0
    assert np.isinf(pose).all()
