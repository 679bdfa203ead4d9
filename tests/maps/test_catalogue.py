"""The hand-drawn worlds: closed, drivable, and long enough for the papers' stories."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely

from albot_maps import ROBOT_RADIUS, World, catalogue_names, load_world
from albot_maps.freespace import FreeSpace, wall_lines

E_ROOMS = {
    "E1": {"P1", "P2"},
    "E2": {"P2", "P3"},
    "E3": {"P3", "P4"},
    "E4": {"P4", "P5"},
    "E5": {"P5", "P6"},
    "E6": {"P6", "P1"},
}


def exits_of(world: World) -> dict[str, np.ndarray]:
    """The middle of each exit."""
    return {opening.name: opening.segment.reshape(2, 2).mean(axis=0) for opening in world.exits}


def visited(world: World, tour: np.ndarray) -> list[str]:
    """The rooms that a tour passes, one entry for each time it comes in."""
    steps = [
        start + share * (end - start)
        for start, end in pairwise(tour)
        for share in np.linspace(0, 1, 200)
    ]
    rooms = [world.room_at(*point) for point in steps]
    return [room for before, room in pairwise([None, *rooms]) if room and room != before]


@pytest.mark.parametrize("name", catalogue_names())
def test_world_is_closed_and_its_tours_keep_clear(name):
    world = load_world(name)
    assert world.name == name
    assert world.source == name
    assert world.closed
    assert world.tours
    for tour in world.tours.values():
        assert shapely.LineString(tour).distance(wall_lines(world.walls)) >= 0.35
        assert np.array_equal(tour[0], world.starts[0, :2])


@pytest.mark.parametrize("name", catalogue_names())
def test_every_room_is_named_where_the_robot_stands(name):
    world = load_world(name)
    for x, y, _ in world.starts:
        assert world.room_at(x, y) is not None


def test_the_square_loop_is_seven_metres_and_eighteen_once_round():
    world = load_world("square-loop")
    assert world.bounds == (0, 0, 7, 7)
    legs = np.hypot(*np.diff(world.tours["loop"], axis=0).T)
    assert legs.sum() == pytest.approx(18.0)


def test_the_floor_is_the_paper_s_size_and_its_tour_comes_everywhere():
    world = load_world("office-floor")
    assert world.bounds == (0, 0, 43, 13)
    tour = world.tours["floor"]
    assert set(visited(world, tour)) == {room.name for room in world.rooms}
    assert np.array_equal(tour[-1], tour[0])
    way = shapely.LineString(tour)
    for x, y in ((11.8, 6.5), (19.0, 6.5), (0.9, 6.5), (30.0, 4.4), (30.0, 8.6)):
        assert way.distance(shapely.Point(x, y)) < 0.5  # Links and corridors, all their length.


def test_the_open_plan_is_eighty_square_metres():
    world = load_world("open-plan")
    assert world.bounds == (0, 0, 10, 8)
    assert np.array_equal(world.tours["routes"][-1], world.starts[0, :2])


@pytest.mark.parametrize("name", ["office-ring", "office-double"])
def test_the_office_is_thirty_metres_and_its_ring_about_ninety(name, lattice):
    world = load_world(name)
    assert world.bounds == (0, 0, 30, 30)
    middle = exits_of(world)
    start = world.starts[0, :2]
    ring = [start, *(middle[f"E{number}"] for number in range(1, 7)), start]
    assert 85 <= lattice(world, ROBOT_RADIUS).way(ring) <= 95


def test_the_double_loop_is_about_a_hundred_and_fifty(lattice):
    world = load_world("office-double")
    middle = exits_of(world)
    start = world.starts[0, :2]
    unseen_part_of_p1, more_of_p6 = world.tours["double-loop"][[22, 29]]
    route = [
        start,
        *(middle[f"E{number}"] for number in range(1, 7)),
        unseen_part_of_p1,
        middle["E6"],
        more_of_p6,
        *(middle[name] for name in ("E7", "E8", "E1")),
        start,
    ]
    assert world.room_at(*unseen_part_of_p1) == "P1"
    assert world.room_at(*more_of_p6) == "P6"
    assert 130 <= lattice(world, ROBOT_RADIUS).way(route) <= 155
    driven = np.hypot(*np.diff(world.tours["double-loop"], axis=0).T).sum()
    assert 145 <= driven <= 155


def test_the_tours_pass_the_places_in_the_thesis_order():
    world = load_world("office-double")
    once_round = ["P1", "P2", "P3", "P4", "P5", "P6", "P1"]
    assert visited(world, world.tours["single-loop"]) == once_round
    assert visited(world, world.tours["double-loop"]) == [*once_round, "P6", "P8", "P2", "P1"]
    assert np.array_equal(world.tours["single-loop"][-1], world.starts[0, :2])


def test_the_tour_that_revisits_is_136_metres_and_ends_over_known_ground():
    world = load_world("office-ring")
    tour, ring = world.tours["revisit"], world.tours["single-loop"]
    assert np.hypot(*np.diff(tour, axis=0).T).sum() == pytest.approx(136.0, abs=0.5)
    assert np.array_equal(tour[: len(ring)], ring)
    driven = shapely.LineString(ring)
    assert shapely.LineString(tour[len(ring) - 1 :]).within(driven.buffer(1e-9))
    assert np.array_equal(tour[-1], tour[0])


@pytest.mark.parametrize("name", ["office-ring", "office-double"])
def test_places_meet_only_at_their_exits(name):
    world = load_world(name)
    exits = {opening.name: set(opening.rooms) for opening in world.exits}
    extra = {} if name == "office-ring" else {"E7": {"P6", "P8"}, "E8": {"P8", "P2"}}
    assert exits == E_ROOMS | extra
    barred = FreeSpace(
        np.concatenate([world.walls, [opening.segment for opening in world.exits]]), 0.05
    )
    everywhere = load_world("office-double").tours["double-loop"]
    for room in world.rooms:
        point = next(point for point in everywhere if world.room_at(*point) == room.name)
        outline = shapely.Polygon(room.boundary)
        assert barred.region_at(point).within(outline.buffer(1e-9))


@pytest.mark.parametrize("name", ["office-ring", "office-double"])
def test_exits_are_open_and_a_metre_wide(name):
    world = load_world(name)
    walls = wall_lines(world.walls)
    for opening in world.exits:
        line = shapely.LineString(opening.segment.reshape(2, 2))
        assert line.length == pytest.approx(1.0)
        assert line.centroid.distance(walls) == pytest.approx(0.5)


def test_the_double_office_is_the_ring_with_two_doors_opened():
    ring, double = (load_world(name) for name in ("office-ring", "office-double"))
    near_the_doors = shapely.union_all(
        [shapely.Point(exits_of(double)[name]).buffer(1.0) for name in ("E7", "E8")]
    )
    p8 = shapely.Polygon(next(room.boundary for room in double.rooms if room.name == "P8"))
    elsewhere = wall_lines(ring.walls).difference(near_the_doors)
    added = wall_lines(double.walls).difference(near_the_doors.union(p8))
    assert elsewhere.hausdorff_distance(added) < 1e-9
    assert np.array_equal(ring.starts, double.starts)


def test_p3_is_a_bare_corridor():
    world = load_world("office-ring")
    corridor = shapely.box(0.15, 14, 2.45, 27)
    sides = wall_lines(world.walls).intersection(corridor)
    assert sides.equals(shapely.MultiLineString([[(0.2, 14), (0.2, 27)], [(2.4, 14), (2.4, 27)]]))
