"""XML floor plans: where doors open, what is kept of awkward plans, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from albot_core.errors import InputError
from albot_maps import ROBOT_RADIUS, load_world
from albot_maps.formats.plan_xml import find_door
from albot_maps.freespace import wall_lines

LEFT = [(0, 0), (0, 200), (300, 200), (300, 0)]
RIGHT = [(300, 0), (300, 200), (500, 200), (500, 0)]


def points(corners: list[tuple[int, int]]) -> str:
    return "".join(f'<point x="{x}" y="{y}"/>' for x, y in corners)


def space(key: str, label: str, corners: list[tuple[int, int]], inner: str = "") -> str:
    return (
        f'<space id="{key}"><labels><type>R</type><label>{label}</label></labels>'
        f"<bounding_polygon>{points(corners)}</bounding_polygon>{inner}</space>"
    )


def portal(line: str, first: str, second: str, at: tuple[int, int] | None) -> str:
    drawn = f"{points([at, at])}<class>PORTAL</class>" if at else ""
    return (
        f'<space_representation><linesegment id="{line}">{drawn}</linesegment>'
        "</space_representation><portals><portal>"
        f"<linesegment>{line}</linesegment><target><id>{first}</id><id>{second}</id></target>"
        "</portal></portals>"
    )


DOOR = portal("p", "a", "b", (300, 150))


def plan(*spaces: str, real: str = "100", unit: str = "cm") -> str:
    return (
        "<building><scale><represented_distance><value>100</value><um>pixel</um>"
        f"</represented_distance><real_distance><value>{real}</value><um>{unit}</um>"
        f"</real_distance></scale><floor><spaces>{''.join(spaces)}</spaces></floor></building>"
    )


def load(folder: Path, text: str):
    path = folder / "plan.xml"
    path.write_text(text)
    return load_world(str(path))


def test_two_rooms_and_their_door(tmp_path):
    """1 px is 1 cm; the picture's y runs down, the world's up."""
    world = load(tmp_path, plan(space("a", "HALL", LEFT, DOOR), space("b", "OFFICE", RIGHT, DOOR)))
    assert world.bounds == (0, 0, 5, 2)
    assert [room.name for room in world.rooms] == ["HALL", "OFFICE"]
    assert world.room_at(1.0, 1.0) == "HALL"
    (door,) = world.exits
    assert set(door.rooms) == {"HALL", "OFFICE"}
    assert sorted(door.segment[[1, 3]]) == pytest.approx([0.05, 0.95])
    assert door.segment[[0, 2]] == pytest.approx([3, 3])
    walls = wall_lines(world.walls)
    assert walls.length == pytest.approx(14 + 2 - 0.9)
    assert walls.distance(shapely.Point(3, 0.5)) == pytest.approx(0.45)
    assert world.notes == ()
    assert world.starts[0] == pytest.approx([1.5, 1.0, 0], abs=0.6)


def test_the_door_of_a_room_inside_another_is_no_exit(tmp_path):
    """It lies in the outer wall, which both have: outside of it is neither."""
    inner = [(200, 50), (200, 150), (300, 150), (300, 50)]
    door = portal("p", "a", "b", (300, 100))
    world = load(tmp_path, plan(space("a", "HALL", LEFT, door), space("b", "BOOTH", inner, door)))
    assert world.exits == ()
    assert "no exit at the door D1: HALL and BOOTH overlap there" in world.notes


def test_equal_labels_are_numbered_and_unreachable_rooms_named(tmp_path):
    far = [(x + 700, y) for x, y in RIGHT]
    spaces = (space("a", "ROOM", LEFT, DOOR), space("b", "ROOM", RIGHT), space("c", "STORE", far))
    world = load(tmp_path, plan(*spaces))
    assert [room.name for room in world.rooms] == ["ROOM 1", "ROOM 2"]
    assert world.notes == ("walls only, because no robot fits in: STORE",)
    assert world.bounds == (0, 0, 12, 2)


def test_rooms_that_do_not_touch_get_no_door(tmp_path):
    far = [(x + 100, y) for x, y in RIGHT]
    world = load(tmp_path, plan(space("a", "A", LEFT, DOOR), space("b", "B", far)))
    assert world.notes[0] == "no door from A to B, which do not touch"
    assert world.exits == ()


def test_a_portal_without_a_place_opens_the_middle(tmp_path):
    nowhere = portal("p", "a", "b", None)
    world = load(tmp_path, plan(space("a", "A", LEFT, nowhere), space("b", "B", RIGHT)))
    assert sorted(world.exits[0].segment[[1, 3]]) == pytest.approx([0.55, 1.45])


def test_a_crossed_outline_is_cleaned_and_noted(tmp_path):
    crossed = [(0, 0), (0, 200), (300, 200), (300, 0), (20, 0), (20, -50), (40, 50)]
    world = load(tmp_path, plan(space("a", "A", crossed)))
    assert world.notes == ("the outline of A crossed itself and was cleaned",)


@pytest.mark.parametrize("outline", [[], LEFT[:2], [(0, 0), (200, 0), (100, 0)]])
def test_an_outline_that_encloses_nothing_is_left_out(tmp_path, outline):
    nook = space("c", "NOOK", outline, portal("q", "c", "a", (0, 100)))
    world = load(tmp_path, plan(space("a", "A", LEFT, DOOR), space("b", "B", RIGHT), nook))
    assert [room.name for room in world.rooms] == ["A", "B"]
    assert [door.name for door in world.exits] == ["D1"]
    assert world.notes == ("skipped: NOOK, whose outline encloses no area",)


@pytest.mark.parametrize(
    ("near", "middle"), [((3, 1), 1.0), ((3, 0.1), 0.45), ((3, 9), 1.55), ((2.8, 0.7), 0.7)]
)
def test_a_door_keeps_inside_the_shared_wall(near, middle):
    door = find_door(shapely.box(0, 0, 3, 2), shapely.box(3, 0, 5, 2), shapely.Point(near))
    assert sorted(door.segment[[1, 3]]) == pytest.approx([middle - 0.45, middle + 0.45])
    assert len(door.jambs) == 0


def test_a_door_through_a_thick_wall_has_jambs():
    door = find_door(shapely.box(0, 0, 3, 2), shapely.box(3.4, 0, 5, 2), shapely.Point(3, 1))
    assert door.segment[[0, 2]] == pytest.approx([3.2, 3.2])
    assert sorted(door.jambs[:, 1]) == pytest.approx([0.55, 1.45])
    assert door.jambs[:, 0] == pytest.approx([3, 3])
    assert door.jambs[:, 2] == pytest.approx([3.4, 3.4])


def test_a_narrow_shared_wall_is_opened_whole():
    door = find_door(shapely.box(0, 0, 3, 0.7), shapely.box(3, 0, 5, 2), shapely.Point(3, 1))
    assert sorted(door.segment[[1, 3]]) == pytest.approx([0, 0.7])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (plan(space("a", "A", LEFT))[:-30], "line 1: expected well-formed XML"),
        ("<building>\n<scale>\n", "line 3: expected well-formed XML"),
        ("", "expected well-formed XML"),
        ("<plan/>", "a floor plan <building>, found <plan>"),
        ("<building/>", "one floor, found 0"),
        (plan(), "at least one space, found none"),
        (plan(space("a", "A", LEFT), real="much"), "scale/real_distance: expected a number"),
        (plan(space("a", "A", LEFT), real="0"), "a positive length"),
        (plan(space("a", "A", LEFT), unit="inch"), "the unit cm, found inch"),
        (plan(space("a", "A", LEFT[:2])), "a space with an outline that encloses an area"),
        (plan(space("a", "A", LEFT), space("a", "B", RIGHT)), "space B: expected a unique id"),
        (plan(space("a", "A", LEFT, DOOR)), "portal p: expected the id of a space, found 'b'"),
        (plan(space("a", "A", LEFT)).replace('"300"', '"nan"'), "within ±1e+12, found 'nan'"),
        (plan(space("a", "A", LEFT)).replace('"300"', '"3oo"'), "a number, found '3oo'"),
        (
            plan(space("a", "A", [(x // 10, y // 10) for x, y in LEFT])),
            "a room with space for a robot",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        load(tmp_path, text)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


PLANS = {
    "Borchen4_updated": (10, 9),
    "FALAELEM1_updated": (44, 51),
    "Lamuniere1_updated": (8, 8),
    "Milano-1": (17, 16),
    "Neulengbach1_updated": (45, 48),
    "Off-2": (31, 33),
    "OfficePlan": (48, 52),
    "Sabadell1_updated": (18, 17),
    "UMTDSchoolFloorplan_updated": (31, 31),
    "Vipiteno1_updated": (47, 54),
    "bronxville_updated": (51, 49),
    "dentist": (25, 24),
    "herndon_updated": (33, 37),
    "putnamjuniorhigh_updated": (39, 50),
}
SHUT = {"OfficePlan": ["OFFICE 1"], "bronxville_updated": ["CLASSROOM 6"]}
"""Rooms that no portal leads to."""


@pytest.mark.parametrize("name", PLANS)
def test_real_plans_load_with_all_rooms_that_have_a_portal(data, name):
    (path,) = (data / "plans").glob(f"{name}*.xml")
    world = load_world(str(path))
    rooms, portals = PLANS[name]
    assert len(world.rooms) == rooms - len(SHUT.get(name, ()))
    assert portals - 1 <= len(world.exits) <= portals
    for shut in SHUT.get(name, ()):
        assert any(note.endswith(f"fits in: {shut}") for note in world.notes)
    assert world.closed
    walls = wall_lines(world.walls)
    middles = shapely.points([door.segment.reshape(2, 2).mean(axis=0) for door in world.exits])
    # One door stands where a third room's corner reaches into its wall.
    assert np.count_nonzero(shapely.distance(middles, walls) < ROBOT_RADIUS) <= 1
    assert world.room_at(*world.starts[0, :2]) is not None
    assert np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T).min() > 1e-6
