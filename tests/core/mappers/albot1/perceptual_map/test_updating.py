"""Algorithm 3: what a view removes, cuts, extends and adds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from albot_core.errors import InputError
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.mapping import update_map
from albot_core.mappers.albot1.perceptual_map.memory import (
    NOT_RECOGNIZED,
    OBSERVED,
    VISIT,
    LocatedView,
    PerceptualMap,
    add_surface,
    empty_map,
    empty_view,
    living,
)
from albot_core.mappers.albot1.perceptual_map.overlay import is_covered
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import CORNER, NO_EDGE
from tests.core.scenes import ROOM, scan_from

LIMITS = Albot1Config.thesis().limits
EDGES = np.full(2, CORNER, np.int8)
# Seen from the origin: three sides of a box 4 m deep and 4 m wide.
BOX = np.array([[0.0, -2.0, 4.0, -2.0], [4.0, -2.0, 4.0, 2.0], [4.0, 2.0, 0.0, 2.0]])


def view_of(surfaces: np.ndarray) -> LocatedView:
    view = empty_view(8)
    view.surfaces[: len(surfaces)] = surfaces
    view.edges[:] = CORNER
    view.landmark[: len(surfaces)] = True
    view.size[0] = len(surfaces)
    return view


def after(old: list[list[float]]) -> tuple[PerceptualMap, LocatedView, list[list[float]]]:
    """The map after the box was laid over the old surfaces, and what is not of the box."""
    pm = empty_map(32)
    for ends in old:
        add_surface(pm, np.array(ends), EDGES)
    view = view_of(BOX)
    update_map(pm, view, LIMITS)
    surfaces = pm.surfaces[np.flatnonzero(living(pm))]
    others = [s.tolist() for s in surfaces if not any(np.allclose(s, b) for b in BOX)]
    return pm, view, others


def test_the_first_view_is_the_map() -> None:
    pm, view, others = after([])
    assert others == []
    assert sorted(view.slots[:3].tolist()) == np.flatnonzero(living(pm)).tolist()


def test_what_lies_inside_is_removed() -> None:
    assert after([[1.0, -1.0, 2.0, 1.0]])[2] == []


def test_what_lies_within_forty_centimetres_of_the_boundary_is_removed() -> None:
    assert after([[4.39, -1.0, 4.39, 1.0]])[2] == []
    assert len(after([[4.41, -1.0, 4.41, 1.0]])[2]) == 1


def test_what_lies_outside_stays() -> None:
    far = [6.0, -1.0, 6.0, 1.0]
    assert after([far])[2] == [far]


def test_a_surface_partly_inside_without_counterpart_is_cut_at_the_boundary() -> None:
    pm, _, others = after([[2.0, 0.5, 6.4, 0.5]])
    assert others == [pytest.approx([4.4, 0.5, 6.4, 0.5], abs=2e-3)]
    slot = int(np.flatnonzero(pm.ids[living(pm).nonzero()] == 0)[0])
    assert pm.edges[slot].tolist() == [NO_EDGE, CORNER]


def test_a_surface_partly_inside_is_extended_by_its_counterpart() -> None:
    # The left wall, remembered from x = 1 to behind the robot, a little beside itself.
    pm, view, others = after([[1.0, 2.1, -3.0, 2.1]])
    # Its end outside the view stays where it was.
    assert others == [pytest.approx([4.0, 2.0, -3.0, 2.1])]
    # It keeps its id, the view's landmark is found in it, and only at the end in view.
    assert pm.ids[view.slots[2]] == 0
    assert view.edges[2].tolist() == [CORNER, NO_EDGE]


def test_ours_draws_the_new_surface_out_to_the_old_end() -> None:
    pm = empty_map(32)
    add_surface(pm, np.array([1.0, 2.1, -3.0, 2.1]), EDGES)
    update_map(pm, view_of(BOX), LIMITS._replace(keeps_outer_end=False))
    surfaces = pm.surfaces[np.flatnonzero(living(pm))]
    assert any(np.allclose(surface, [4.0, 2.0, -3.0, 2.0]) for surface in surfaces)


@pytest.mark.parametrize(("aside", "is_one"), [(0.06, True), (0.08, False)])
def test_walls_are_drawn_as_one_only_where_that_is_straight(aside: float, is_one: bool) -> None:
    # The left wall goes on behind the robot, somewhat aside: drawn as one it is bent at x = 0, by
    # 4 / 7 of that.
    pm = empty_map(32)
    add_surface(pm, np.array([1.0, 2.0 + aside, -3.0, 2.0 + aside]), EDGES)
    update_map(pm, view_of(BOX), LIMITS._replace(join_height=0.04))
    surfaces = pm.surfaces[np.flatnonzero(living(pm))]
    assert any(np.allclose(surface, BOX[2]) for surface in surfaces) is not is_one
    assert (
        any(np.allclose(surface, [4.0, 2.0, -3.0, 2.0 + aside]) for surface in surfaces) is is_one
    )
    # What is left of the old one begins where the view's boundary and the margin end.
    assert len(surfaces) == (3 if is_one else 4)


@pytest.mark.parametrize("height", [-0.01, np.nan])
def test_a_join_height_is_a_length(height: float) -> None:
    with pytest.raises(InputError, match=r"join_height: expected a number from 0, or infinity"):
        Albot1Config(join_height=height)


def test_a_wall_beside_which_the_views_own_runs_is_replaced() -> None:
    pm = empty_map(32)
    add_surface(pm, np.array([3.0, 2.3, 0.5, 2.42]), EDGES)
    update_map(pm, view_of(BOX), LIMITS._replace(margin=0.4, join_height=0.0))
    assert living(pm).sum() == 3


def reobserved(old: list[float], covered: bool) -> int:
    """How many surfaces of an earlier visit count as met again after the box was laid over."""
    pm = empty_map(32)
    add_surface(pm, np.array(old), EDGES)
    pm.counts[VISIT] = 2
    update_map(pm, view_of(BOX), LIMITS._replace(covered_is_reobserved=covered))
    return int(pm.reobserved[1, OBSERVED])


def test_to_the_letter_all_that_a_view_covers_is_met_again() -> None:
    same, other = [3.8, -1.5, 3.8, 1.5], [1.0, -1.0, 2.0, 1.0]
    assert [reobserved(same, covered) for covered in (True, False)] == [1, 1]
    assert [reobserved(other, covered) for covered in (True, False)] == [1, 0]
    # Neither what lies outside nor what is too short to be a landmark.
    assert reobserved([6.0, -1.0, 6.0, 1.0], True) == reobserved([1.0, 0.0, 1.3, 0.0], True) == 0


def test_the_robots_own_place_may_close_the_boundary() -> None:
    # Only a wall ahead is seen; something remembered stands between it and the robot.
    near, ahead = np.array([0.5, -0.2, 0.5, 0.2]), BOX[1:2]
    for eye, left in ((False, 2), (True, 1)):
        pm = empty_map(32)
        add_surface(pm, near, EDGES)
        update_map(pm, view_of(ahead), LIMITS._replace(robot_in_boundary=eye))
        assert living(pm).sum() == left


def test_surfaces_that_are_no_landmarks_are_added_but_not_tracked() -> None:
    pm = empty_map(32)
    view = view_of(BOX)
    view.landmark[1] = False
    update_map(pm, view, LIMITS)
    assert living(pm).sum() == 3
    assert view.slots[1] == NOT_RECOGNIZED


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
    _, view, others = after([[-3.0, -2.0, 1.0, -2.0]])
    assert others == [pytest.approx([-3.0, -2.0, 4.0, -2.0])]
    assert view.edges[0].tolist() == [NO_EDGE, CORNER]


@pytest.mark.parametrize("name", ["albot1-thesis", "albot1-tracked", "albot1"])
def test_the_first_view_is_laid_over_the_map_at_once(name):
    """It has no recognised landmark, so the limiting point is reached (algorithm 4, line 13)."""
    mapper = make_mapper(name)
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=scan_from(np.zeros(3), ROOM)))
    assert mapper.estimate.updates == 1
    assert len(mapper.snapshot().segments) >= 3
