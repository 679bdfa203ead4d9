"""Routes keep clear of walls and are hardly longer than the shortest way there is."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely

from albot_core.errors import InputError
from albot_maps import ROBOT_RADIUS, World, load_world
from albot_maps.freespace import wall_lines
from albot_maps.routes import SPARE, Routes


def length(route):
    return float(np.hypot(*np.diff(route, axis=0).T).sum())


@pytest.fixture(scope="module")
def walled() -> World:
    """A 6 × 4 m room with a wall of 3 m up from the middle of its lower side."""
    corners = [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]
    sides = [[*start, *end] for start, end in pairwise(corners)]
    walls = np.array([*sides, [3, 0, 3, 3]], float)
    return World(name="walled", walls=walls, starts=np.array([[1.0, 1.0, 0.0]]), source="walled")


def test_the_way_round_a_wall_is_as_long_as_geometry_says(walled):
    route = Routes(walled, 0.05).through(np.array([[1.0, 1.0], [5.0, 1.0]]))
    assert np.array_equal(route[[0, -1]], [[1.0, 1.0], [5.0, 1.0]])
    # Two tangents of the circle of 0.3 m about the wall's end, and the arc between them.
    far = np.hypot(2.0, 2.0)
    tangent = np.sqrt(far**2 - 0.3**2)
    arc = 0.3 * (1.5 * np.pi - 2 * np.arctan2(tangent, 0.3))
    assert length(route) == pytest.approx(2 * tangent + arc, rel=0.03)
    assert length(route) > 2 * tangent


def test_a_free_line_is_taken_straight(walled):
    route = Routes(walled).through(np.array([[0.63, 3.41], [5.42, 3.55], [5.1, 0.77]]))
    assert np.allclose(route, [[0.63, 3.41], [5.42, 3.55], [5.1, 0.77]])


@pytest.mark.parametrize("middle", [2.05, 2.025])
def test_a_way_leads_through_a_door_between_two_rows_of_the_lattice(walled, middle):
    """Random offices have such doors: `random:office:3012?rooms=12` ended with "found none"."""
    half = (ROBOT_RADIUS + SPARE) + 0.01
    door = np.array([[3, 0, 3, middle - half], [3, middle + half, 3, 4]])
    walls = np.concatenate((walled.walls[:-1], door))
    world = World(name="door", walls=walls, starts=walled.starts, source="door")
    stops = np.array([[1.0, 0.8], [5.0, 3.0]])
    route = Routes(world).through(stops)
    assert np.array_equal(route[[0, -1]], stops)
    assert shapely.LineString(route).distance(wall_lines(walls)) >= 0.99 * (ROBOT_RADIUS + SPARE)
    assert length(route) <= 1.06 * np.hypot(4.0, 2.2)


@pytest.mark.parametrize("spec", ["random:apartment:1001", "random:office:1001?rooms=8"])
def test_routes_keep_clear_and_are_short(spec, lattice):
    world = load_world(spec)
    rooms = [world.rooms[index].name for index in (0, -1, 1)]
    route = Routes(world).through_rooms(rooms)
    clearance = shapely.LineString(route).distance(wall_lines(world.walls))
    # The floor's round corners are inscribed polygons.
    assert clearance >= 0.99 * (ROBOT_RADIUS + SPARE)
    assert [world.room_at(*route[end]) for end in (0, -1)] == [rooms[0], rooms[-1]]
    there = Routes(world).through(route[[0, -1]])
    assert length(there) <= 1.06 * lattice(world, (ROBOT_RADIUS + SPARE)).way(route[[0, -1]])


@pytest.mark.parametrize(
    ("stops", "message"),
    [
        ([[1.0, 1.0]], "two stops or more"),
        ([[1.0, 1.0], [3.1, 1.0]], r"stops 0.35 m from walls .* \(3.1, 1\)"),
        ([[1.0, 1.0], [9.0, 1.0]], r"found \(9, 1\)"),
    ],
)
def test_stops_that_cannot_be_driven_to_are_refused(walled, stops, message):
    with pytest.raises(InputError, match=message):
        Routes(walled).through(np.array(stops))


def test_a_room_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="a room of this world, found 'attic'"):
        Routes(load_world("office-ring")).through_rooms(["P1", "attic"])
