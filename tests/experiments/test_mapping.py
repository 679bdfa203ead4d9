"""A map's shape: none of it hangs on the map's frame, all of it on what is bent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import inverse, relative, transform_segments
from albot_experiments.mapping import Walls, is_kept, median_and_worst, shape_of, surface_points

WALLS = np.array([[0.0, 0, 8, 0], [8, 0, 8, 5], [8, 5, 0, 5], [0, 5, 0, 0]])
ALL = Walls(all=surface_points(WALLS), seen=surface_points(WALLS))
TRUTH = np.array([[1.0, 1, 0], [7, 1, 1.5], [7, 4, 3], [1, 4, -1.5]])


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))
def test_a_true_map_has_no_error_in_whatever_frame(x: float, y: float, heading: float) -> None:
    frame = np.array([x, y, heading])
    surfaces = transform_segments(inverse(frame), WALLS)
    shape = shape_of(surface_points(surfaces), relative(frame, TRUTH), TRUTH, ALL)
    assert (shape.precision, shape.recall) == (1.0, 1.0)
    assert shape.surface_error == pytest.approx(0.0, abs=1e-9)
    assert shape.path_error == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(shape.frame[:2], frame[:2], atol=1e-8)
    assert is_kept([shape])


def test_surfaces_that_stand_aside_are_wrong_and_missed() -> None:
    wall = surface_points(WALLS[:1])
    walls = Walls(all=wall, seen=wall)
    for aside, share in ((0.15, 1.0), (0.3, 0.0)):
        shape = shape_of(wall + np.array([0.0, aside]), TRUTH, TRUTH, walls)
        assert shape.surface_error == pytest.approx(aside)
        assert shape.precision == shape.recall == share


def test_half_a_map_and_half_a_wrong_one_are_told_apart() -> None:
    half = surface_points(np.array([[0.0, 0, 4, 0]]))
    wall = surface_points(np.array([[0.0, 0, 8, 0]]))
    walls = Walls(all=wall, seen=wall)
    assert shape_of(half, TRUTH, TRUTH, walls).precision == 1.0
    assert shape_of(half, TRUTH, TRUTH, walls).recall == pytest.approx(0.5, abs=0.04)
    doubled = np.concatenate((wall, wall + np.array([0.0, 1.0])))
    shape = shape_of(doubled, TRUTH, TRUTH, walls)
    assert (shape.precision, shape.recall) == (0.5, 1.0)
    assert not is_kept([shape])


def test_a_path_bent_at_its_end_is_off_in_closed_form() -> None:
    bent = TRUTH.copy()
    bent[:2, 0] += 1.0
    bent[2:, 0] -= 1.0
    shape = shape_of(ALL.all, bent, TRUTH, ALL)
    assert 0.5 < shape.path_error < 1.0
    assert shape.precision < 0.8


def test_a_map_without_surfaces_keeps_no_shape() -> None:
    shape = shape_of(np.empty((0, 2)), TRUTH, TRUTH, ALL)
    assert shape.surface_error == np.inf
    assert shape.precision == shape.recall == 0.0


def test_the_worst_is_the_largest() -> None:
    assert median_and_worst([0.1, 0.5, 0.2]) == {"median": 0.2, "worst": 0.5}
