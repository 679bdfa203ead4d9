"""Surfaces compared and lengthened: closed forms, and shapely as the oracle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString

from albot_core.mappers.association import surfaces as compiled

ANGLE = np.radians(10.0)
NUMBERS = st.integers(-400, 400).map(lambda hundredths: hundredths / 100)
SURFACES = (
    st.lists(NUMBERS, min_size=4, max_size=4)
    .map(np.array)
    .filter(lambda ends: np.hypot(*(ends[2:] - ends[:2])) >= 0.5)
)


def line_of(surface: np.ndarray) -> LineString:
    return LineString(surface.reshape(2, 2))


def length_of(surface: np.ndarray) -> float:
    return float(np.hypot(*(surface[2:] - surface[:2])))


@given(SURFACES, SURFACES)
def test_distances_and_crossings_are_those_of_shapely(one, other):
    ours = compiled.distance_between(one, other)
    np.testing.assert_allclose(ours, line_of(one).distance(line_of(other)), atol=1e-9)
    assert compiled.crosses(one, other) == line_of(one).crosses(line_of(other))
    if ours <= 0.3:
        assert compiled.may_be_close(one, other, 0.3)


@given(SURFACES, SURFACES)
def test_a_surface_lengthened_by_an_overhang_reaches_as_far_as_the_other(one, other):
    longer = one.copy()
    compiled.lengthen(longer, *compiled.overhang(one, other))
    np.testing.assert_allclose(compiled.overhang(longer, other), 0.0, atol=1e-9)
    assert length_of(longer) >= length_of(one) - 1e-9


@given(SURFACES, st.floats(-1, 1), st.floats(-ANGLE, ANGLE), st.floats(0.5, 8))
def test_what_is_missing_makes_a_surface_as_long_as_the_known_one(one, aside, turn, length):
    heading = np.arctan2(one[3] - one[1], one[2] - one[0]) + turn
    along = np.array((np.cos(heading), np.sin(heading)))
    first = one[:2] + aside * along[::-1]
    other = np.concatenate((first, first + length * along))
    compiled.lengthen(other, *compiled.overhang(other, one))
    compiled.lengthen(one, *compiled.missing(one, other))
    assert length_of(one) == pytest.approx(length_of(other), abs=1e-9)
    middle, length = compiled.along(one, *(other[:2] + other[2:]) / 2)
    assert middle == pytest.approx(length / 2, abs=1e-9)
