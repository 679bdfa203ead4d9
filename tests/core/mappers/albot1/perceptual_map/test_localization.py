"""Algorithm 2: equations 3.5 to 3.7, and which landmark is trusted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import inverse, transform_segments
from albot_core.mappers.albot1.perceptual_map.mapping import LANDMARK_PAIR, localize
from albot_core.mappers.albot1.perceptual_map.memory import (
    LocatedView,
    PerceptualMap,
    add_surface,
    empty_map,
    empty_view,
)

EDGES = np.zeros(2, np.int8)
WALLS = np.array(
    [[3.0, -2.0, 3.0, -0.5], [4.0, 1.0, 2.0, 2.0], [-1.0, 3.0, -2.0, 1.0], [0.0, 5.0, -1.0, 5.0]]
)


def scene(
    pose: np.ndarray, walls: np.ndarray = WALLS
) -> tuple[PerceptualMap, LocatedView, np.ndarray]:
    """A map of the walls, the view of them from a pose, and evidence of equal weight."""
    pm = empty_map(8)
    view = empty_view(8)
    for wall in walls:
        add_surface(pm, wall, EDGES)
    view.surfaces[: len(walls)] = transform_segments(inverse(pose), walls)
    view.slots[: len(walls)] = np.arange(len(walls))
    view.size[0] = len(walls)
    pairs = np.full(8, np.array((0, 0.1, 0.01, 2.0), LANDMARK_PAIR))
    return pm, view, pairs


@settings(deadline=None, max_examples=50)
@given(
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1)).map(np.array),
    st.integers(0, 1),
)
def test_a_single_landmark_gives_the_pose_exactly(pose: np.ndarray, end: int) -> None:
    pm, view, pairs = scene(pose, WALLS[:1])
    pairs["end"] = end
    localize(pm, view, pairs)
    assert np.allclose(view.pose, pose, atol=1e-9)


def literal_equations(wall: np.ndarray, seen: np.ndarray) -> tuple[float, float]:
    """Equations 3.6 and 3.7 as printed, for the first point of the surface."""
    x1, y1, x2, y2 = wall
    length = np.hypot(x2 - x1, y2 - y1)
    distance = np.hypot(seen[0], seen[1])
    run, back = seen[2:] - seen[:2], -seen[:2]
    theta = np.arctan2(run[0] * back[1] - run[1] * back[0], run @ back)
    x = x1 + distance * ((x2 - x1) / length * np.cos(theta) - (y2 - y1) / length * np.sin(theta))
    y = y1 + distance * ((x2 - x1) / length * np.sin(theta) + (y2 - y1) / length * np.cos(theta))
    return x, y


def test_the_rigid_motion_is_equations_3_6_and_3_7() -> None:
    pose = np.array([1.0, -0.5, 0.7])
    pm, view, pairs = scene(pose, WALLS[1:2])
    localize(pm, view, pairs)
    assert literal_equations(WALLS[1], view.surfaces[0]) == pytest.approx(view.pose[:2])


def test_the_point_out_of_line_is_discarded() -> None:
    pose = np.array([0.2, 0.1, 0.3])
    pm, view, pairs = scene(pose)
    view.surfaces[0] += 3.0  # seen where it is not, and praised most
    pairs[0] = (0, 1e-4, 1e-4, 0.5)
    localize(pm, view, pairs)
    assert np.allclose(view.pose, pose, atol=1e-9)


def test_the_highest_goodness_localises() -> None:
    pose = np.array([0.2, 0.1, 0.3])
    pm, view, pairs = scene(pose)
    shifts = np.array([0.10, 0.12, 0.12, 0.10])
    view.surfaces[:4, 0] -= shifts
    view.surfaces[:4, 2] -= shifts
    pairs[2]["gap"] = 0.01  # ten times smaller a gap: ten times the goodness
    localize(pm, view, pairs)
    ahead = (view.pose[:2] - pose[:2]) @ [np.cos(0.3), np.sin(0.3)]
    assert ahead == pytest.approx(0.12, abs=1e-9)


def test_perfect_agreement_divides_by_nothing() -> None:
    pm, view, pairs = scene(np.zeros(3))
    pairs[:] = 0
    localize(pm, view, pairs)
    assert np.allclose(view.pose, 0.0)
