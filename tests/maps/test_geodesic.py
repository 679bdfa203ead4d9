"""Geodesic distances against closed forms, and against the ways they stand for."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_maps import ROBOT_RADIUS, load_world
from albot_maps.geodesic import DistanceField

ROOM = [[0, 0, 10, 0], [10, 0, 10, 10], [10, 10, 0, 10], [0, 10, 0, 0]]
SPLIT = np.array([*ROOM, [5, 0, 5, 7]], float)
"""A room of 10 m by 10 m, and a wall from below up to 7 m in its middle."""
INSIDE = st.floats(0.3, 9.7)


def _round_the_end(start: np.ndarray, goal: np.ndarray, radius: float) -> float:
    """Closed form: two tangents to a circle about the wall's end, and the arc between them."""
    a, b = start - (5, 7), goal - (5, 7)
    far, near = np.hypot(*a), np.hypot(*b)
    turn = 2 * math.pi - math.acos(a @ b / far / near)
    arc = turn - math.acos(radius / far) - math.acos(radius / near)
    return math.sqrt(far**2 - radius**2) + math.sqrt(near**2 - radius**2) + radius * arc


@given(INSIDE, INSIDE, INSIDE, INSIDE)
@settings(deadline=None, max_examples=20)
def test_what_is_in_sight_is_as_far_as_the_crow_flies(
    x: float, y: float, to_x: float, to_y: float
) -> None:
    place, goal = np.array((x, y)), np.array((to_x, to_y))
    field = DistanceField(np.array(ROOM, float), 0.25, goal)
    assert field.distance(place) == pytest.approx(np.hypot(*(goal - place)), abs=1e-9)


@pytest.mark.parametrize("start", [(8, 2), (6, 0.5), (9.5, 6), (5.5, 3)])
def test_round_a_wall_the_way_follows_its_end(start: tuple[float, float]) -> None:
    goal, place = np.array((2.0, 2.0)), np.array(start, float)
    exact = _round_the_end(place, goal, 0.25)
    length = DistanceField(SPLIT, 0.25, goal).distance(place)
    assert exact - 1e-9 <= length <= 1.02 * exact
    assert length > 1.2 * np.hypot(*(goal - place))


def test_where_no_way_leads_it_is_infinitely_far() -> None:
    shut = np.array([*ROOM, [5, 0, 5, 10]], float)
    field = DistanceField(shut, 0.25, np.array((2.0, 2.0)))
    assert field.distance(np.array((8.0, 2.0))) == math.inf
    assert len(field.path(np.array((8.0, 2.0)))) == 0


BAY = np.array([[0, 0, 10, 0], [0, 0, 0, 10], [0, 10, 10, 10]], float)
"""Three walls of 10 m by 10 m; the fourth side, to the right, is open."""


@given(st.floats(11, 60), INSIDE, st.floats(0.3, 9.7), INSIDE)
@settings(deadline=None, max_examples=20)
def test_off_the_lattice_what_is_in_sight_is_as_far_as_the_crow_flies(
    x: float, y: float, to_x: float, to_y: float
) -> None:
    place, goal = np.array((x, y)), np.array((to_x, to_y))
    straight = shapely.LineString((place, goal))
    if straight.distance(shapely.MultiPoint(((10, 0), (10, 10)))) > 0.4:
        exact = np.hypot(*(goal - place))
        length = DistanceField(BAY, 0.25, goal).distance(place)
        assert exact - 1e-9 <= length <= exact + 0.05


BELOW, ABOVE = [(0, 0), (10, 0)], [(10, 10)]


@pytest.mark.parametrize(
    ("place", "turns"),
    [
        ((-3, 4), BELOW),
        ((-40, 4), BELOW),
        ((5, 40), ABOVE),
        ((5, 10.6), ABOVE),
        ((-40, -40), BELOW[1:]),
    ],
)
def test_from_outside_the_way_leads_round_the_building(place, turns) -> None:
    goal, start = np.array((5.0, 4.0)), np.array(place, float)
    field = DistanceField(BAY, 0.25, goal)
    way = np.vstack((start, field.path(start)))
    walls = shapely.multilinestrings(shapely.linestrings(BAY.reshape(-1, 2, 2)))
    assert shapely.LineString(way).distance(walls) > 0.17
    assert np.hypot(*np.diff(way, axis=0).T).sum() == pytest.approx(field.distance(start))
    thread = np.hypot(*np.diff(np.array([start, *turns, goal]), axis=0).T).sum()
    # Round each end of a wall it is longer than the thread, by an arc with the robot's radius.
    assert thread <= field.distance(start) <= 1.02 * thread + 0.25 * math.pi * len(turns)


def test_a_goal_outside_is_found() -> None:
    room = np.array(ROOM, float)
    field = DistanceField(room, 0.25, np.array((10.8, 5.0)))
    assert field.distance(np.array((30.0, 5.0))) == pytest.approx(19.2, abs=0.05)
    assert field.distance(np.array((-30.0, 5.0))) > 45
    assert field.distance(np.array((5.0, 5.0))) == math.inf


def test_walls_that_enclose_the_goal_leave_its_lattice_alone() -> None:
    field = DistanceField(np.array(ROOM, float), 0.25, np.array((2.0, 2.0)))
    assert (field.columns, field.rows) == (101, 101)
    assert field.distance(np.array((20.0, 2.0))) == math.inf


def test_a_narrow_gap_is_passed_by_who_must_not_miss_any() -> None:
    gap = np.array([*ROOM, [5, 0, 5, 4.73], [5, 5.27, 5, 10]], float)
    goal, place = np.array((2.0, 2.0)), np.array((8.0, 2.0))
    tight = DistanceField(gap, 0.25, goal, tight=True).distance(place)
    assert tight == pytest.approx(np.hypot(3, 3) * 2, rel=0.01)
    shut = np.array([*ROOM, [5, 0, 5, 4.85], [5, 5.15, 5, 10]], float)
    assert DistanceField(shut, 0.25, goal, tight=True).distance(place) == math.inf


@pytest.mark.parametrize("spec", ["random:office:3", "random:apartment:3", "random:maze:3"])
def test_ways_are_as_long_as_they_say_and_keep_clear_of_walls(spec: str) -> None:
    world = load_world(spec)
    home = world.starts[0, :2]
    field = DistanceField(world.walls, ROBOT_RADIUS, home)
    walls = shapely.multilinestrings(shapely.linestrings(world.walls.reshape(-1, 2, 2)))
    for room in world.rooms[:8]:
        place = room.boundary.mean(axis=0)
        if not math.isfinite(field.distance(place)):
            continue
        way = np.vstack((place, field.path(place)))
        length = np.hypot(*np.diff(way, axis=0).T).sum()
        assert length == pytest.approx(field.distance(place), abs=1e-6)
        assert way[-1] == pytest.approx(home)
        # Between the lattice's points a way may pass corners by a little less.
        after_the_first = shapely.linestrings(way[1:]) if len(way) > 2 else shapely.Point(home)
        assert shapely.distance(after_the_first, walls) > ROBOT_RADIUS - 0.06
