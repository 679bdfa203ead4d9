"""The world model: what it refuses, what it keeps, and that nobody can change it."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_maps import Exit, Room, World

SQUARE = np.array([[0.0, 0, 6, 0], [6, 0, 6, 4], [6, 4, 0, 4], [0, 4, 0, 0]])
DIVIDED = np.concatenate((SQUARE, [[3.0, 0, 3, 1.5], [3, 2.5, 3, 4]]))
SHUT = np.concatenate((SQUARE, [[3.0, 0, 3, 4]]))
WEST = Room(name="west", boundary=np.array([[0.0, 0], [3, 0], [3, 4], [0, 4]]))
EAST = Room(name="east", boundary=np.array([[3.0, 0], [6, 0], [6, 4], [3, 4]]))
DOOR = Exit(name="door", segment=np.array([3.0, 1.5, 3, 2.5]), rooms=("west", "east"))
START = np.array([[1.0, 1, 0]])


def make(**changes) -> World:
    parts = {"name": "two rooms", "walls": DIVIDED, "starts": START}
    parts |= {"rooms": (WEST, EAST), "exits": (DOOR,), "source": "test.yaml"}
    return World(**(parts | changes))


def with_wall(*wall: float) -> np.ndarray:
    return np.concatenate((DIVIDED, [wall]))


def test_the_example_is_valid():
    world = make()
    assert world.bounds == (0, 0, 6, 4)
    assert world.closed
    assert not make(walls=DIVIDED[1:]).closed


@pytest.mark.parametrize(
    ("x", "y", "name"),
    [
        (1.0, 1.0, "west"),
        (5.0, 3.0, "east"),
        (3.0, 2.0, "west"),
        (0.0, 0.0, "west"),
        (3.01, 2.0, "east"),
        (7.0, 1.0, None),
    ],
)
def test_room_at(x, y, name):
    assert make().room_at(x, y) == name


@pytest.mark.parametrize(
    ("changes", "place", "words"),
    [
        ({"name": " "}, "name", "a name"),
        ({"name": "two\nlines"}, "name", "one printable line"),
        ({"walls": np.empty((0, 4))}, "walls", "at least one wall"),
        ({"walls": with_wall(1, 1, 1, 1)}, "walls[6]", "longer than 0"),
        ({"walls": with_wall(1, 1, np.nan, 1)}, "walls[6]", "finite"),
        ({"walls": with_wall(1, 1, np.inf, 1)}, "walls[6]", "finite"),
        ({"walls": with_wall(1, 1, 12_000, 1)}, "walls[6]", "in metres"),
        ({"starts": np.empty((0, 3))}, "starts", "at least one start"),
        ({"starts": np.array([[1, 0.2, 0]])}, "starts[0]", "0.25 m, found a wall at 0.2 m"),
        ({"starts": np.array([[1.0, 1, 0], [3, 1, 0]])}, "starts[1]", "a wall at 0 m"),
        ({"starts": np.array([[-1.2, 1.0, 0]])}, "starts[0]", "1 m outside the rectangle"),
        ({"starts": np.array([[1.0, 1, 0], [3, 99, 0]])}, "starts[1]", "found (3, 99)"),
        ({"starts": np.array([[1, np.nan, 0]])}, "starts[0]", "finite"),
        ({"starts": np.array([[1, 1, np.inf]])}, "starts[0]", "finite"),
        ({"rooms": (WEST, EAST, WEST)}, "rooms[2]", "a unique name"),
        ({"exits": (DOOR, DOOR)}, "exits[1]", "a unique name"),
        ({"rooms": (WEST,)}, "exits[0]", "found east"),
        ({"walls": SHUT}, "rooms[1]", "no way into east"),
        ({"walls": SHUT, "starts": np.array([[5.0, 1, 0]])}, "rooms[0]", "no way into west"),
        (
            {"walls": SHUT, "rooms": (), "exits": (), "starts": np.array([[1.0, 1, 0], [5, 1, 0]])},
            "starts[1]",
            "a path blocked",
        ),
        ({"tours": {"t": np.array([[1.0, 1]])}}, "tours.t", "two waypoints"),
        ({"tours": {"t": np.array([[1.0, 1], [1, 2], [5, 0.5]])}}, "tours.t[1]", "0.25 m clear"),
        ({"tours": {"t": np.array([[1.0, 1], [1, np.nan]])}}, "tours.t[1]", "finite"),
        ({"tours": {"": np.array([[1.0, 1], [2, 2]])}}, "tours.", "a name"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(changes, place, words):
    with pytest.raises(InputError) as caught:
        make(**changes)
    assert caught.value.place == place
    assert words in str(caught.value)
    assert str(caught.value).startswith("test.yaml, ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("boundary", "words"),
    [
        ([[0, 0], [3, 0]], "3 corners"),
        ([[0, 0], [3, 4], [3, 0], [0, 4]], "cross itself"),
        ([[0, 0], [3, 0], [np.nan, 4]], "finite"),
    ],
)
def test_a_room_needs_a_simple_outline(boundary, words):
    room = Room(name="east", boundary=np.array(boundary, dtype=float))
    with pytest.raises(InputError, match=words) as caught:
        make(rooms=(WEST, room))
    assert caught.value.place == "rooms[1]"


@pytest.mark.parametrize(
    ("segment", "rooms", "words"),
    [
        ([3, 1, 3, 1], ("west", "east"), "wider than 0"),
        ([3, 1, 3, np.inf], ("west", "east"), "finite"),
        ([3, 1, 3, 2], ("west", "west"), "two different rooms"),
        ([1, 1, 1, 2], ("west", "east"), "found west on one side, west on the other"),
        ([3, 2, 4, 2], ("west", "east"), "found east on one side, east on the other"),
        ([9, 1, 9, 2], ("west", "east"), "found no room on one side, no room on the other"),
    ],
)
def test_an_exit_joins_two_rooms(segment, rooms, words):
    door = Exit(name="door", segment=np.array(segment, dtype=float), rooms=rooms)
    with pytest.raises(InputError, match=words) as caught:
        make(exits=(door,))
    assert caught.value.place == "exits[0]"


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("rooms", [("west", "east"), ("east", "west")])
@pytest.mark.parametrize("at", [3.0, 3.45, 3.9])
def test_an_exit_may_lie_anywhere_in_a_thick_wall(at, rooms, turn):
    """The rooms are 0.9 m apart, the line in the middle between them or at either."""
    cos, sin = np.cos(turn), np.sin(turn)
    turned = np.array([[cos, sin], [-sin, cos]])
    walls = np.concatenate((SQUARE, [[3, 0, 3, 1.5], [3, 2.5, 3, 4], [3.9, 0, 3.9, 1.5]]))
    far = EAST.boundary + np.where(EAST.boundary[:, :1] == 3, (0.9, 0), 0)
    world = make(
        walls=(walls.reshape(-1, 2) @ turned).reshape(-1, 4),
        starts=np.array([[*(START[0, :2] @ turned), 0]]),
        rooms=(
            Room(name="west", boundary=WEST.boundary @ turned),
            Room(name="east", boundary=far @ turned),
        ),
        exits=(
            Exit(
                name="door",
                segment=(np.array([[at, 1.5], [at, 2.5]]) @ turned).reshape(4),
                rooms=rooms,
            ),
        ),
    )
    assert [opening.rooms for opening in world.exits] == [rooms]


def test_a_room_is_reachable_only_where_the_robot_stands_wholly_inside():
    """A wall right behind the door leaves the robot in the doorway."""
    make(walls=with_wall(3.6, 0, 3.6, 4), rooms=(WEST,), exits=())
    with pytest.raises(InputError, match="no way into east"):
        make(walls=with_wall(3.45, 0, 3.45, 4))


def test_rooms_that_are_walled_off_are_not_among_the_reachable_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They would count as rooms that the robot has not entered, if a world could have them."""
    assert make().reachable_rooms == (WEST, EAST)
    monkeypatch.setattr(World, "_check_reachability", lambda _: None)
    assert make(walls=SHUT, exits=()).reachable_rooms == (WEST,)
    assert make(walls=SHUT, exits=(), starts=np.array([[5.0, 1, 0]])).reachable_rooms == (EAST,)
    # Nor those whose doorway is too narrow for the robot.
    narrow = np.concatenate((SQUARE, [[3.0, 0, 3, 1.9], [3, 2.1, 3, 4]]))
    assert make(walls=narrow, exits=()).reachable_rooms == (WEST,)


def test_nothing_in_a_world_can_be_changed():
    walls = DIVIDED.copy()
    world = make(walls=walls, tours={"t": np.array([[1.0, 1], [2, 2]])})
    walls[0] = 7
    assert world.walls[0, 0] == 0
    for array in (world.walls, world.starts, world.rooms[0].boundary, world.tours["t"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(TypeError):
        world.tours["u"] = walls
    with pytest.raises(AttributeError):
        world.name = "another"


def test_glass_is_one_flag_for_each_wall():
    assert not make().glass.any() and len(make().glass) == len(DIVIDED)
    panes = np.arange(len(DIVIDED)) == 1
    world = deepcopy(make(glass=panes))
    assert np.array_equal(world.glass, panes)
    assert np.array_equal(world.opaque, DIVIDED[~panes])
    for array in (world.glass, world.opaque):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(InputError, match="glass: expected true or false for each"):
        make(glass=np.ones(2, np.bool_))


def test_a_world_can_be_copied_as_for_another_process():
    world = make(tours={"t": np.array([[1.0, 1], [2, 2]])})
    assert world.closed
    copy = deepcopy(world)
    assert np.array_equal(copy.walls, world.walls)
    assert np.array_equal(copy.tours["t"], world.tours["t"])
    assert copy.room_at(5.0, 1.0) == "east"
    assert not copy.walls.flags.writeable
    with pytest.raises(TypeError):
        copy.tours["u"] = world.walls


def test_a_world_is_checked_for_the_robot_that_drives_in_it():
    world = make()  # Its door is 1 m wide, its start 1 m from two walls.
    assert world.for_robot(world.robot_radius) is world
    larger = world.for_robot(0.45)
    assert larger.robot_radius == 0.45
    assert larger.free_space.radius == 0.45
    assert larger.reachable_area < world.reachable_area < world.for_robot(0.1).reachable_area
    for radius, message in (
        (0.55, r"test.yaml, rooms\[1\]: expected rooms that a robot of radius 0.55 m reaches"),
        (
            1.05,
            r"test.yaml, starts\[0\]: expected free space of radius 1.05 m, found a wall at 1 m",
        ),
        (-1.0, r"World.robot_radius: expected a positive number"),
    ):
        with pytest.raises(InputError, match=message):
            world.for_robot(radius)


def test_a_small_robot_may_go_where_the_usual_one_cannot():
    narrow = np.concatenate((SQUARE, [[3.0, 0, 3, 1.8], [3, 2.2, 3, 4]]))
    with pytest.raises(InputError, match="no way into east"):
        make(walls=narrow, exits=())
    assert make(walls=narrow, exits=(), robot_radius=0.15).reachable_rooms == (WEST, EAST)
