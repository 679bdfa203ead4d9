"""Free space against a flood fill of a fine lattice, and on shapes with known answers."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from albot_maps.freespace import FreeSpace, wall_lines, widest_place

ROOM = np.array([[0.0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0]])


def with_gap(width: float) -> np.ndarray:
    """The room cut in two by a wall with a gap in its middle."""
    return np.concatenate((ROOM, [[2, 0, 2, 2 - width / 2], [2, 2 + width / 2, 2, 4]]))


@pytest.mark.parametrize(("gap", "passes"), [(0.49, False), (0.51, True)])
def test_a_gap_is_passable_where_it_is_wider_than_the_disc(gap, passes):
    space = FreeSpace(with_gap(gap), 0.25)
    region = space.region_at(np.array([1.0, 2.0]))
    assert space.disc_fits_inside(region, shapely.box(2, 0, 4, 4)) is passes
    assert space.disc_fits_inside(region, shapely.box(0, 0, 2, 4))


def test_the_free_part_of_a_room_is_its_inset():
    region = FreeSpace(ROOM, 0.25).region_at(np.array([1.0, 1.0]))
    assert region.area == pytest.approx(3.5**2)


@pytest.mark.parametrize(("walls", "enclosed"), [(ROOM, True), (ROOM[:3], False)])
def test_a_room_without_its_fourth_wall_is_open(walls, enclosed):
    assert FreeSpace(walls, 0.25).is_enclosed(np.array([2.0, 2.0])) is enclosed


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(*[st.floats(0.2, 5.8).map(lambda value: round(value, 1))] * 4).filter(
            lambda wall: wall[:2] != wall[2:]
        ),
        min_size=1,
        max_size=12,
    )
)
def test_two_points_hang_together_as_a_flood_fill_says(walls):
    """Where the fill with a slightly larger disc joins two points, so does the exact space;
    where it parts them with a slightly smaller one, so does the exact space."""
    frame = np.array([[0.0, 0, 6, 0], [6, 0, 6, 6], [6, 6, 0, 6], [0, 6, 0, 0]])
    segments = np.concatenate((frame, walls))
    space = FreeSpace(segments, 0.25)
    cell = 0.05
    x, y = np.meshgrid(np.arange(0, 6.01, cell), np.arange(0, 6.01, cell), indexing="ij")
    clearance = shapely.distance(
        shapely.points(x, y), shapely.multilinestrings(segments.reshape(-1, 2, 2))
    )
    narrow, _ = ndimage.label(clearance >= 0.25 + cell)
    wide, _ = ndimage.label(clearance >= 0.25 - cell, structure=np.ones((3, 3)))
    spots = np.argwhere(narrow > 0)[::97]
    regions = [space.region_at(np.array([x[tuple(spot)], y[tuple(spot)]])) for spot in spots]
    for spot, region in zip(spots, regions, strict=True):
        for other, other_region in zip(spots, regions, strict=True):
            if narrow[tuple(spot)] == narrow[tuple(other)]:
                assert region is other_region
            if wide[tuple(spot)] != wide[tuple(other)]:
                assert region is not other_region


@pytest.mark.parametrize("width", [2.0, 1.2345, 0.7531])
def test_the_widest_place_is_the_middle_in_whole_centimetres(width):
    x, y = widest_place(shapely.box(0.1234, -0.4321, 0.1234 + width, width - 0.4321))
    # The disc is within 5 cm of the largest, so its centre is, too.
    assert x == pytest.approx(0.1234 + width / 2, abs=0.055)
    assert y == pytest.approx(width / 2 - 0.4321, abs=0.055)
    assert (x, y) == (round(x, 2), round(y, 2))


def test_the_widest_place_of_a_sliver_lies_in_it():
    sliver = shapely.box(0.0031, 0.0, 0.0049, 2.0)
    assert sliver.contains(shapely.Point(widest_place(sliver)))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 20), st.integers(0, 20)), min_size=3, max_size=7))
def test_no_free_space_is_near_a_closed_wall_that_crosses_itself(corners):
    points = np.array(corners, float) / 10
    walls = np.concatenate((points, np.roll(points, -1, axis=0)), axis=1)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    if not len(walls):
        return
    lines = wall_lines(walls)
    for region in FreeSpace(walls, 0.25).regions:
        assert region.distance(lines) > 0.246
