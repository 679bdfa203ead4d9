"""The quick proof never claims what the exact free space denies, and seldom misses it."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_maps import ROBOT_RADIUS, catalogue_names, load_world
from albot_maps.freespace import FreeSpace
from albot_maps.lattice import FloodFill, Lattice

FRAME = np.array([[0.0, 0, 6, 0], [6, 0, 6, 6], [6, 6, 0, 6], [0, 6, 0, 0]])
START = np.array([0.55, 0.5])
walls = st.lists(
    st.tuples(*[st.floats(0.2, 5.8).map(lambda value: round(value, 1))] * 4).filter(
        lambda wall: wall[:2] != wall[2:]
    ),
    min_size=1,
    max_size=12,
)
points = st.lists(st.tuples(st.floats(-1, 7), st.floats(-1, 7)), min_size=20, max_size=40)


@pytest.mark.parametrize("scale", [1.0, 0.99, 0.17, 1000.0])
@pytest.mark.parametrize("margin", [0.0, 1.03])
def test_the_points_cover_the_walls_with_their_margin_and_no_more(scale, margin):
    lattice = Lattice(scale * FRAME * (1.0, 0.7, 1.0, 0.7), margin)
    near, far = np.full(2, -margin), scale * np.array((6.0, 4.2)) + margin
    np.testing.assert_allclose(lattice.corner, near)
    last = lattice.corner + lattice.cell * (np.array(lattice.shape) - 1)
    assert (last > far - 1e-9 * scale).all()
    assert (last < far + lattice.cell + 1e-9 * scale).all()
    assert lattice.nearest(near) == (0, 0)
    assert lattice.nearest(far) is not None
    assert lattice.nearest(far + lattice.cell * 1.6) is None


@settings(max_examples=60, deadline=None)
@given(walls, points)
def test_what_is_reached_is_reached_in_the_exact_space(inner, spots):
    segments = np.concatenate((FRAME, inner))
    fill = FloodFill(segments, ROBOT_RADIUS, START)
    space = FreeSpace(segments, ROBOT_RADIUS)
    region = space.region_at(START)
    for spot in np.array(spots):
        if fill.reaches(spot):
            assert region.covers(shapely.Point(spot))
        outline = spot + np.array([[0, 0], [1, 0], [1, 0.8], [0, 0.8]])
        triangle = spot + np.array([[0, 0], [1.5, 0], [0, 1.5]])
        for room in (outline, triangle):
            if fill.disc_fits_inside(room):
                assert space.disc_fits_inside(region, shapely.Polygon(room))


@pytest.mark.parametrize(("gap", "passes"), [(0.49, False), (0.75, True)])
def test_a_gap_is_found_where_it_is_a_quarter_metre_wider_than_the_disc(gap, passes):
    for shift in np.linspace(0, 0.1, 11):
        middle = 3 + shift
        wall = [[3, 0, 3, middle - gap / 2], [3, middle + gap / 2, 3, 6]]
        fill = FloodFill(np.concatenate((FRAME, wall)), ROBOT_RADIUS, START)
        assert fill.reaches(np.array([5.0, 5])) is passes
        assert fill.disc_fits_inside(np.array([[3.0, 0], [6, 0], [6, 6], [3, 6]])) is passes
        assert not fill.reaches(np.array([-3.0, 5]))


@pytest.mark.parametrize("name", catalogue_names())
def test_the_proof_succeeds_on_the_catalogue(name):
    world = load_world(name)
    fill = FloodFill(world.walls, ROBOT_RADIUS, world.starts[0, :2])
    assert all(fill.reaches(start[:2]) for start in world.starts)
    assert all(fill.disc_fits_inside(room.boundary) for room in world.rooms)


def test_a_start_outside_the_walls_or_too_near_one_proves_nothing():
    for start in ((-2.0, 1.0), (0.1, 3.0)):
        fill = FloodFill(FRAME, ROBOT_RADIUS, np.array(start))
        assert not fill.reaches(np.array([3.0, 3]))


def test_a_floor_of_kilometres_takes_no_more_points():
    fill = FloodFill(1000 * FRAME, ROBOT_RADIUS, np.array([100.0, 100.0]))
    assert fill.reaches(np.array([5000.0, 5000.0]))
