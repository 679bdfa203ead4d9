"""Algorithm 3: what a view removes, cuts, extends and adds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.memory import Memory, add_surface, empty_memory, living
from albot_core.mappers.albot1.sight import NOT_RECOGNIZED, Sight, empty_sight
from albot_core.mappers.albot1.updating import is_covered, update_map
from albot_core.sensing.surfaces import CORNER, NO_EDGE

LIMITS = Albot1Config.thesis().limits
EDGES = np.full(2, CORNER, np.int8)
# Seen from the origin: three sides of a box 4 m deep and 4 m wide.
BOX = np.array([[0.0, -2.0, 4.0, -2.0], [4.0, -2.0, 4.0, 2.0], [4.0, 2.0, 0.0, 2.0]])


def view_of(surfaces: np.ndarray) -> Sight:
    sight = empty_sight(8)
    sight.surfaces[: len(surfaces)] = surfaces
    sight.edges[:] = CORNER
    sight.landmark[: len(surfaces)] = True
    sight.size[0] = len(surfaces)
    return sight


def after(old: list[list[float]]) -> tuple[Memory, Sight, list[list[float]]]:
    """The map after the box was laid over the old surfaces, and what is not of the box."""
    memory = empty_memory(32)
    for ends in old:
        add_surface(memory, np.array(ends), EDGES)
    sight = view_of(BOX)
    update_map(memory, sight, LIMITS)
    surfaces = memory.surfaces[np.flatnonzero(living(memory))]
    others = [s.tolist() for s in surfaces if not any(np.allclose(s, b) for b in BOX)]
    return memory, sight, others


def test_the_first_view_is_the_map() -> None:
    memory, sight, others = after([])
    assert others == []
    assert sorted(sight.slots[:3].tolist()) == np.flatnonzero(living(memory)).tolist()


def test_what_lies_inside_is_removed() -> None:
    assert after([[1.0, -1.0, 2.0, 1.0]])[2] == []


def test_what_lies_within_forty_centimetres_of_the_boundary_is_removed() -> None:
    assert after([[4.39, -1.0, 4.39, 1.0]])[2] == []
    assert len(after([[4.41, -1.0, 4.41, 1.0]])[2]) == 1


def test_what_lies_outside_stays() -> None:
    far = [6.0, -1.0, 6.0, 1.0]
    assert after([far])[2] == [far]


def test_a_surface_partly_inside_without_counterpart_is_cut_at_the_boundary() -> None:
    memory, _, others = after([[2.0, 0.5, 6.4, 0.5]])
    assert others == [pytest.approx([4.4, 0.5, 6.4, 0.5], abs=2e-3)]
    slot = int(np.flatnonzero(memory.ids[living(memory).nonzero()] == 0)[0])
    assert memory.edges[slot].tolist() == [NO_EDGE, CORNER]


def test_a_surface_partly_inside_is_extended_by_its_counterpart() -> None:
    # The left wall, remembered from x = 1 to behind the robot, a little beside itself.
    memory, sight, others = after([[1.0, 2.1, -3.0, 2.1]])
    assert others == [pytest.approx([4.0, 2.0, -3.0, 2.0])]
    # It keeps its id, the view's landmark is found in it, and only at the end in view.
    assert memory.ids[sight.slots[2]] == 0
    assert sight.edges[2].tolist() == [CORNER, NO_EDGE]


def test_the_robots_own_place_may_close_the_boundary() -> None:
    # Only a wall ahead is seen; something remembered stands between it and the robot.
    near, ahead = np.array([0.5, -0.2, 0.5, 0.2]), BOX[1:2]
    for eye, left in ((False, 2), (True, 1)):
        memory = empty_memory(32)
        add_surface(memory, near, EDGES)
        update_map(memory, view_of(ahead), LIMITS._replace(eye_in_boundary=eye))
        assert living(memory).sum() == left


def test_surfaces_that_are_no_landmarks_are_added_but_not_tracked() -> None:
    memory = empty_memory(32)
    sight = view_of(BOX)
    sight.landmark[1] = False
    update_map(memory, sight, LIMITS)
    assert living(memory).sum() == 3
    assert sight.slots[1] == NOT_RECOGNIZED


@settings(deadline=None, max_examples=200)
@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=4, max_size=12),
    st.tuples(st.floats(-6, 6), st.floats(-6, 6)),
)
def test_coverage_is_shapelys(corners: list[tuple[float, float]], at: tuple[float, float]) -> None:
    polygon = Polygon(corners)
    if not polygon.is_valid or polygon.area < 1e-3:
        return
    near = polygon.distance(Point(at))
    if abs(near - 0.4) < 1e-6:
        return
    ring = np.array(corners)
    box = np.array([*(ring.min(0) - 0.4), *(ring.max(0) + 0.4)])
    assert is_covered(ring, box, 0.4, *at) is (near < 0.4)


def test_a_surface_ending_inside_from_behind_is_extended_at_its_first_end() -> None:
    # The right wall runs from behind the robot into view.
    _, sight, others = after([[-3.0, -2.0, 1.0, -2.0]])
    assert others == [pytest.approx([-3.0, -2.0, 4.0, -2.0])]
    assert sight.edges[0].tolist() == [NO_EDGE, CORNER]
