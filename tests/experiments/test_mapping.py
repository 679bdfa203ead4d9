"""A map's shape: none of it hangs on the map's frame, all of it on what is bent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import inverse, relative, transform_segments
from albot_experiments.mapping import median_and_worst, shape_of

WALLS = np.array([[0.0, 0, 8, 0], [8, 0, 8, 5], [8, 5, 0, 5], [0, 5, 0, 0]])
TRUTH = np.array([[1.0, 1, 0], [7, 1, 1.5], [7, 4, 3], [1, 4, -1.5]])


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))
def test_a_true_map_has_no_error_in_whatever_frame(x: float, y: float, heading: float) -> None:
    frame = np.array([x, y, heading])
    surfaces = transform_segments(inverse(frame), WALLS)
    shape = shape_of(surfaces, relative(frame, TRUTH), TRUTH, WALLS)
    assert shape.surface_error == pytest.approx(0.0, abs=1e-9)
    assert shape.path_error == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(shape.frame[:2], frame[:2], atol=1e-8)


def test_surfaces_that_stand_aside_are_off_by_as_much() -> None:
    aside = WALLS[:1] + np.array([0.0, 0.3, 0.0, 0.3])
    shape = shape_of(aside, TRUTH, TRUTH, WALLS[:1])
    assert shape.surface_error == pytest.approx(0.3)


def test_a_path_bent_at_its_end_is_off_in_closed_form() -> None:
    bent = TRUTH.copy()
    bent[:2, 0] += 1.0
    bent[2:, 0] -= 1.0
    shape = shape_of(WALLS, bent, TRUTH, WALLS)
    assert 0.5 < shape.path_error < 1.0
    assert shape.surface_error > 0.1


def test_a_map_without_surfaces_keeps_no_shape() -> None:
    assert shape_of(np.empty((0, 4)), TRUTH, TRUTH, WALLS).surface_error == np.inf


def test_the_worst_is_the_largest() -> None:
    assert median_and_worst([0.1, 0.5, 0.2]) == {"median": 0.2, "worst": 0.5}
