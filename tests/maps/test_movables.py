"""Doors, boxes and walkers: what each may be, and what must hold of them in a world."""

from __future__ import annotations

import inspect
import pickle

import numpy as np
import pytest
import shapely

from albot_core.errors import InputError
from albot_maps import Box, Door, Movables, Walker, World

WALLS = np.array(
    [
        *([0.0, 0, 8, 0], [8, 0, 8, 5], [8, 5, 0, 5], [0, 5, 0, 0]),
        *([5.0, 0, 5, 2], [5, 3, 5, 5]),
    ]
)
DOOR = Door(hinge=(5.0, 2.0), heading=np.pi / 2, width=1.0)
WALKER = Walker(route=((1.0, 4.0), (4.0, 4.0), (4.0, 3.0)))


def make(starts=((1.5, 2.5, 0.0),), walls=WALLS, **movables) -> World:
    parts = {name: tuple(things) for name, things in movables.items()}
    return World(
        name="hall",
        walls=walls,
        starts=np.array(starts),
        movables=Movables(**parts),
        source="hall.yaml",
    )


def test_the_example_is_valid_and_can_be_copied():
    world = make(doors=[DOOR], boxes=[Box(at=(3.0, 1.0))], walkers=[WALKER])
    assert world.movables
    assert not make().movables
    assert pickle.loads(pickle.dumps(world)).movables == world.movables  # noqa: S301


def test_a_door_sweeps_the_sector_between_shut_and_open():
    """A quarter disc; to the right where the opening is negative."""
    assert DOOR.sweep.area == pytest.approx(np.pi / 4, rel=2e-3)
    assert DOOR.sweep.contains(shapely.Point(4.5, 2.5))
    right = Door(hinge=(5.0, 2.0), heading=np.pi / 2, width=1.0, opening=-np.pi / 2)
    assert right.sweep.contains(shapely.Point(5.5, 2.5))
    assert not right.sweep.contains(shapely.Point(4.5, 2.5))


def test_a_box_lies_along_its_heading():
    corners = Box(at=(1.0, 2.0), heading=np.pi / 2, length=2.0, width=1.0).corners
    assert corners == pytest.approx(np.array([[1.5, 1], [1.5, 3], [0.5, 3], [0.5, 1]]))


def test_a_closed_route_has_one_leg_more():
    square = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
    assert len(Walker(route=square).legs) == 3
    assert np.array_equal(Walker(route=square, closed=True).legs[3], [1, 2, 1, 1])


@pytest.mark.parametrize(
    ("kind", "fields", "place"),
    [
        (Door, {"hinge": (np.nan, 0.0)}, "hinge"),
        (Door, {"hinge": 0.0}, "hinge"),
        (Door, {"hinge": (0.0, 1.0, 2.0)}, "hinge"),
        (Door, {"open_for": 3.0}, "open_for"),
        (Door, {"heading": np.inf}, "heading"),
        (Door, {"heading": "1"}, "heading"),
        (Door, {"width": 0.1}, "width"),
        (Door, {"width": np.nan}, "width"),
        (Door, {"opening": 4.0}, "opening"),
        (Door, {"opening": 0.0}, "opening"),
        (Door, {"opening": np.nan}, "opening"),
        (Door, {"turn_rate": 10.0}, "turn_rate"),
        (Door, {"open_for": (5.0, 2.0)}, "open_for"),
        (Door, {"shut_for": (-1.0, 2.0)}, "shut_for"),
        (Box, {"at": (0.0, np.inf)}, "at"),
        (Box, {"length": 0.2}, "length"),
        (Box, {"width": np.nan}, "width"),
        (Box, {"mass": 0.0}, "mass"),
        (Walker, {"route": ((0.0, 0.0),)}, "route"),
        (Walker, {"route": (1.0, 2.0)}, "route"),
        (Walker, {"route": ((0.0, 0.0), (0.0, 0.01))}, "route"),
        (Walker, {"route": ((0.0, 0.0), (0.0, np.nan))}, "route"),
        (Walker, {"closed": True, "route": ((0.0, 0.0), (2.0, 0.0))}, "route"),
        (Walker, {"speed": (1.0, 5.0)}, "speed"),
        (Walker, {"radius": 0.9}, "radius"),
    ],
)
def test_a_thing_names_its_wrong_field(kind, fields, place):
    needed = {
        Door: {"hinge": (0.0, 0.0), "heading": 0.0, "width": 1.0},
        Box: {"at": (0.0, 0.0)},
        Walker: {"route": ((0.0, 0.0), (2.0, 0.0))},
    }
    # Users' types are not checked as those of the tests are.
    unchecked = inspect.unwrap(kind.__init__)
    with pytest.raises(InputError) as caught:
        unchecked(object.__new__(kind), **(needed[kind] | fields))
    assert caught.value.place == place
    assert "\n" not in str(caught.value)


def box(x: float, y: float, **fields) -> Box:
    return Box(at=(float(x), float(y)), **fields)


@pytest.mark.parametrize(
    ("movables", "place", "words"),
    [
        (
            {"doors": [Door(hinge=(4.5, 1.0), heading=0.0, width=1.0)]},
            "doors[0]",
            "blocked by a wall",
        ),
        (
            {"doors": [Door(hinge=(4.5, 2.5), heading=-0.9, width=1.0)]},
            "doors[0]",
            "blocked by a wall",
        ),
        (
            {"doors": [DOOR, Door(hinge=(5.0, 3.0), heading=-np.pi / 2, width=1.0, opening=-1.5)]},
            "doors[1]",
            "",
        ),
        ({"doors": [Door(hinge=(1.5, 2.0), heading=0.0, width=1.0)]}, "doors[0]", "of the starts"),
        (
            {"doors": [Door(hinge=(50.0, 2.0), heading=0.0, width=1.0)]},
            "doors[0]",
            "inside the building",
        ),
        ({"boxes": [box(5, 1)]}, "boxes[0]", "a wall at 0 m"),
        ({"boxes": [box(0.2, 1)]}, "boxes[0]", "a wall at 0 m"),
        ({"boxes": [box(3, 1), box(3.5, 1)]}, "boxes[1]", "boxes[0] at 0 m"),
        ({"boxes": [box(3, 1), box(3, 1, length=0.3, width=0.3)]}, "boxes[1]", "boxes[0] at 0"),
        (
            {"boxes": [box(4.6, 2.5)], "doors": [DOOR]},
            "boxes[0]",
            "the swept area of doors[0] at 0",
        ),
        ({"boxes": [box(2, 2.5, length=0.6)]}, "boxes[0]", "clear of the starts"),
        ({"boxes": [box(20, 2)]}, "boxes[0]", "inside the building"),
        ({"walkers": [Walker(route=((1.0, 1.0), (7.0, 1.0)))]}, "walkers[0]", "one at 0 m"),
        ({"walkers": [WALKER], "boxes": [box(3, 3.6)]}, "walkers[0]", "one at 0.15 m"),
        ({"walkers": [Walker(route=((1.0, 1.0), (1.5, 1.0)))]}, "walkers[0]", "apart"),
        (
            {"walkers": [Walker(route=((1.0, 9.0), (9.0, 9.0)))]},
            "walkers[0]",
            "inside the building",
        ),
        (
            {"walkers": [Walker(route=((4.0, 1.0), (5.5, 2.5), (4.0, 4.0)), closed=True)]},
            "walkers[0]",
            "clear of walls",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_place(movables, place, words):
    with pytest.raises(InputError) as caught:
        make(**movables)
    assert caught.value.place.startswith(f"movables.{place}")
    assert words in str(caught.value)
    assert str(caught.value).startswith("hall.yaml, ")


@pytest.mark.parametrize("left", [1.0, 0.0], ids=["free-standing", "at a wall"])
def test_a_box_does_not_stand_inside_furniture(left):
    desk = np.array([[left, 4], [2.6, 4], [2.6, 4.8], [left, 4.8]])
    walls = np.concatenate((WALLS, np.concatenate((desk, np.roll(desk, -1, axis=0)), axis=1)))
    with pytest.raises(InputError, match=r"found one at \(1.8, 4.4\), inside furniture") as caught:
        make(walls=walls, boxes=[box(3.5, 1), box(1.8, 4.4)])
    assert caught.value.place == "movables.boxes[1]"
    make(walls=walls, boxes=[box(3.5, 1), box(6, 4.4)])
    make(walls=np.delete(walls, -3, axis=0), boxes=[box(3.5, 1), box(1.8, 4.4)])


def test_a_start_is_not_walled_in_by_boxes_alone():
    """Four long boxes around it; with one of them gone there is a way out."""
    around = [
        box(1.5, 1.9, length=1.2, width=0.3),
        box(1.5, 3.1, length=1.2, width=0.3),
        box(2.0, 2.5, length=0.3, width=0.8),
        box(1.0, 2.5, length=0.3, width=0.8),
    ]
    with pytest.raises(InputError, match="boxes on all sides") as caught:
        make(boxes=around)
    assert caught.value.place == "starts[0]"
    make(boxes=around[1:])


def test_a_double_door_is_two_leaves_that_meet():
    left = Door(hinge=(5.0, 2.0), heading=np.pi / 2, width=0.5)
    right = Door(hinge=(5.0, 3.0), heading=-np.pi / 2, width=0.5, opening=-np.pi / 2)
    assert len(make(doors=[left, right]).movables.doors) == 2


def test_no_robot_begins_in_the_swing_of_a_door_or_on_a_box():
    movables = make(doors=[DOOR], boxes=[box(3, 1)]).movables
    assert movables.gap(4.5, 2.5) == 0
    assert movables.gap(3.2, 1.2) == 0
    assert movables.gap(3.0, 0.5) == pytest.approx(0.25)
    assert movables.gap(1.5, 2.5) > 1
    assert Movables().gap(0.0, 0.0) == np.inf
