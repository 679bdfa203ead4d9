"""HouseExpo's houses: their outline, their rooms, and what is no such file."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely

from albot_core.errors import InputError
from albot_maps import load_world

# An L of two rooms; a wall folded in leaves a door of 1 m at the top.
HOUSE = {
    "id": "0a1b",
    "room_num": 2,
    "bbox": {"min": [0, 0], "max": [8, 4]},
    "verts": [[0, 0], [4, 0], [4, 3], [4.2, 3], [4.2, 0], [8, 0], [8, 4], [0, 4], [0, 4]],
    "room_category": {"Kitchen": [[0, 0, 4.1, 4]], "Bedroom": [[4.1, 0, 8, 2], [4.1, 2, 8, 4]]},
}


@pytest.fixture
def read(tmp_path):
    def write_and_load(house):
        path = tmp_path / "house.json"
        path.write_text(house if isinstance(house, str) else json.dumps(house))
        return load_world(str(path))

    return write_and_load


def test_a_house(read):
    world = read(HOUSE)
    assert world.name == "0a1b"
    assert world.closed
    assert len(world.walls) == 8
    assert world.bounds == (0, 0, 8, 4)
    assert [room.name for room in world.rooms] == ["Bedroom 1", "Bedroom 2", "Kitchen"]
    assert world.room_at(1.0, 1.0) == "Kitchen"
    assert world.room_at(7.0, 1.0) == "Bedroom 1"
    assert world.room_at(7.0, 3.0) == "Bedroom 2"
    assert world.room_at(4.15, 1.0) is None, "inside the wall"


def test_where_boxes_overlap_the_smallest_counts(read):
    world = read(HOUSE | {"room_category": {"Hall": [[0, 0, 8, 4]], "Bath": [[5, 0, 8, 2]]}})
    assert world.room_at(6.0, 1.0) == "Bath"
    assert world.room_at(6.0, 3.0) == "Hall"


def test_a_room_that_is_shut_is_named(read):
    boxes = {"Kitchen": [[0, 0, 3, 4]], "Duct": [[7.9, 0, 8.3, 0.3]], "Far": [[20, 20, 30, 30]]}
    world = read(HOUSE | {"room_category": boxes})
    assert [room.name for room in world.rooms] == ["Kitchen"]
    assert any("Duct" in note for note in world.notes)


def test_a_house_without_labels_is_one_room(read):
    world = read({"verts": HOUSE["verts"]})
    assert world.name == "house"
    assert [room.name for room in world.rooms] == ["house"]
    assert np.array_equal(world.walls[0], [0, 0, 4, 0])


@pytest.mark.parametrize(
    ("house", "words"),
    [
        ("{", "line 1: expected valid JSON"),
        ("[1, 2]", "expected a HouseExpo house with verts"),
        ({"id": "x"}, "expected a HouseExpo house with verts"),
        (HOUSE | {"verts": [[0, 0], [1, 1]]}, "verts: expected an outline of 3 corners or more"),
        (HOUSE | {"verts": [[0, 0], [1, 1, 1]]}, "verts[1]: expected 2 numbers, found [1, 1, 1]"),
        (HOUSE | {"verts": [[0, 0], [1, "a"]]}, "verts[1]: expected 2 numbers"),
        (HOUSE | {"verts": [[0, 0], [1, True]]}, "verts[1]: expected 2 numbers"),
        (HOUSE | {"verts": [[0, 0], [1, float("nan")]]}, "expected finite numbers of 40 digits"),
        (HOUSE | {"verts": [[0, 0], [1, 10**400]]}, "40 digits at most, found one of 401 digits"),
        (HOUSE | {"verts": [[0, 0], [1, 10**39], [2, 1]]}, "expected finite numbers in metres"),
        (HOUSE | {"verts": 3}, "verts: expected a list, found int"),
        (HOUSE | {"room_category": [1]}, "room_category: expected boxes by label, found list"),
        (HOUSE | {"room_category": {"a": [[1]]}}, "room_category.a[0]: expected 4 numbers"),
        (HOUSE | {"verts": [[0, 0], [0.2, 0], [0, 0.2]]}, "a room with space for a robot"),
    ],
)
def test_what_is_wrong_is_named(read, house, words):
    with pytest.raises(InputError) as caught:
        read(house)
    assert words in str(caught.value)
    assert "house.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_house_without_labels_whose_outline_crosses_itself(read):
    """A bow tie of 6 m by 4 m and its knot at (4.8, 3.2): its larger wing is the room."""
    world = read({"verts": [[0, 0], [8, 0], [4, 4], [6, 4]]})
    (room,) = world.rooms
    assert shapely.Polygon(room.boundary).is_valid
    assert world.reaches(world.starts[0, :2])
    assert len(world.walls) == 4
    assert world.notes == (
        "the outline crosses or touches itself; the room house is its largest part",
    )


def test_an_outline_that_encloses_nothing_is_an_error(read):
    with pytest.raises(InputError, match="verts: expected an outline that encloses an area"):
        read({"verts": [[0, 0], [8, 0], [4, 0]]})


def test_a_house_in_which_a_robot_just_does_not_fit_is_refused_for_that(read):
    """Free space is a little too large at corners: a robot seems to fit where it does not."""
    with pytest.raises(InputError, match="a room with space for a robot"):
        read(
            {
                "verts": [[1, 4.874], [0.194, 1.71], [7.09, 0.2], [1, 0.8]],
                "room_category": {
                    "A": [[2.9, 3.7, 1.42, 1.2]],
                    "B": [[1.5, 1.5, 0.2, 1.588], [1.25, 1, 1.26, 7.15]],
                },
            }
        )
