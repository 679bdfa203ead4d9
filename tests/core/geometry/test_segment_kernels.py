"""Segments in compiled code, against shapely and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import transform_segments
from albot_core.geometry.segment_kernels import (
    crosses,
    crosses_line,
    distance_left_of,
    distance_to_segment,
    heading_of,
    left_of,
    nearest_on_segment,
    nearest_share,
    transform_segment,
)

PLACES = st.floats(-10, 10).map(lambda x: round(x, 2))
SEGMENTS = st.tuples(PLACES, PLACES, PLACES, PLACES).filter(lambda s: s[:2] != s[2:])


def line(segment: tuple[float, ...]) -> shapely.LineString:
    return shapely.LineString([segment[:2], segment[2:]])


@given(SEGMENTS, PLACES, PLACES)
def test_the_nearest_point_is_shapelys(segment, x, y):
    ours = shapely.Point(nearest_on_segment(x, y, *segment))
    point = shapely.Point(x, y)
    assert ours.distance(line(segment)) < 1e-9
    distance = distance_to_segment(x, y, *segment)
    assert distance == pytest.approx(point.distance(line(segment)), abs=1e-9)
    assert distance == pytest.approx(ours.distance(point), abs=1e-9)


def test_a_segment_without_length_is_a_point():
    assert nearest_share(3.0, 4.0, 0.0, 0.0, 0.0, 0.0) == 0.0
    assert distance_to_segment(3.0, 4.0, 0.0, 0.0, 0.0, 0.0) == 5.0


def test_left_is_where_the_heading_turns_counter_clockwise():
    assert left_of(0, 0, 2, 0, 1, 1) == 2.0
    assert left_of(2, 0, 0, 0, 1, 1) == -2.0
    assert left_of(0, 0, 2, 0, 7, 0) == 0.0
    assert distance_left_of(0.0, 0.0, 3.0, 4.0, -4.0, 3.0) == 5.0
    assert heading_of(np.array((1.0, 1.0, 1.0, 3.0))) == pytest.approx(math.pi / 2)
    assert heading_of((1.0, 1.0, -1.0, 1.0)) == pytest.approx(math.pi)


@given(SEGMENTS, SEGMENTS)
def test_segments_cross_where_shapely_says_so(one, other):
    assert crosses(one, other) == crosses(other, one) == line(one).crosses(line(other))
    if crosses(one, other):
        assert crosses_line(one, *other)
    elif line(one).disjoint(line(other)):
        assert not crosses_line(one, *other)


def test_a_way_in_pieces_passes_a_line_once():
    door = (0.0, 0.0, 0.0, 1.0)
    ways = (((-1.0, 0.5), (0.0, 0.5)), ((0.0, 0.5), (1.0, 0.5)))
    assert sum(crosses_line(door, *a, *b) for a, b in ways) == 1
    assert not crosses(door, (-1.0, 0.5, 0.0, 0.5))  # It ends on the line, not beyond.
    assert not crosses_line(door, -1.0, 1.5, 1.0, 1.5)


@given(SEGMENTS, st.tuples(PLACES, PLACES, st.floats(-7, 7)))
def test_a_transformed_segment_is_that_of_the_arrays_function(segment, frame):
    out = np.empty(4)
    transform_segment(np.array(frame), np.array(segment), out)
    expected = transform_segments(np.array(frame), np.array([segment]))[0]
    np.testing.assert_array_equal(out, expected)
