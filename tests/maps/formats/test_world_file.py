"""Our own world file: what it means, that it comes back exactly, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_maps import Box, Door, Exit, Movables, Room, Walker, World, catalogue_names, load_world
from albot_maps.formats.world_file import parse_world, world_text

SMALL = """\
albot-world: 1
name: small
walls:
  - [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
boxes:
  - [0, 3, 1, 4]
polygons:
  - [[3, 3], [4, 3], [4, 4]]
rooms:
  only: [[0, 0], [4, 0], [4, 4], [0, 4]]
starts:
  - {at: [1, 1], heading: 90}
"""

MOVING = """\
movables:
  doors:
    - {hinge: [3, 1], heading: 90, width: 0.5, opening: -90}
  boxes:
    - {at: [2, 2], length: 0.4, width: 0.3}
  walkers:
    - {route: [[0.5, 0.5], [0.5, 2.5]]}
"""

ZEROS = """\
albot-world: 1
name: zeros
walls:
  - [[-2, -2], [2, -2], [2, 2], [-2, 2], [-2, -2]]
  - [[-0.0, -2], [-0.0, -1.5]]
rooms:
  all: [[-2, -2], [2, -2], [2, 2], [-0.0, 2], [-2, 2]]
starts:
  - {at: [-0.0, -0.0], heading: -0.0}
tours:
  short: [[-0.0, 0.5], [1, -0.0]]
movables:
  doors:
    - {hinge: [-0.0, 1.9], heading: -0.0, width: 0.5, opening: -90, open_for: [-0.0, 5]}
  boxes:
    - {at: [-1, -0.0], heading_rad: -0.0, length: 0.4, width: 0.3}
  walkers:
    - {route: [[-0.0, -0.9], [1.5, -0.9]]}
"""


FAR_WALLS = 700.0 * np.array([[-1, -1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1], [-1, 1, -1, -1]])


def same(first: World, second: World) -> bool:
    """Whether two worlds are equal to the last bit, but for where they came from."""
    arrays = [
        (first.walls, second.walls),
        (first.starts, second.starts),
        (first.glass, second.glass),
        *((a.boundary, b.boundary) for a, b in zip(first.rooms, second.rooms, strict=True)),
        *((a.segment, b.segment) for a, b in zip(first.exits, second.exits, strict=True)),
        *((first.tours[name], second.tours[name]) for name in first.tours),
    ]
    return all(np.array_equal(a, b) for a, b in arrays) and (
        [room.name for room in first.rooms] == [room.name for room in second.rooms]
        and [(e.name, e.rooms) for e in first.exits] == [(e.name, e.rooms) for e in second.exits]
        and list(first.tours) == list(second.tours)
        and (first.name, first.notes) == (second.name, second.notes)
        and first.movables == second.movables
    )


def test_glass_is_wall_that_is_not_opaque():
    text = SMALL.replace("rooms:", "glass:\n  - [[1, 0], [2, 0.5], [3, 0]]\nrooms:")
    plain, world = parse_world(SMALL, source="small.yaml"), parse_world(text, source="small.yaml")
    assert not plain.glass.any()
    assert np.array_equal(plain.opaque, plain.walls)
    assert np.array_equal(world.opaque, plain.walls)
    assert world.walls[world.glass].tolist() == [[1, 0, 2, 0.5], [2, 0.5, 3, 0]]
    assert same(world, parse_world(world_text(world), source="again"))


def test_a_pane_without_length_is_refused_with_its_line():
    text = SMALL.replace("rooms:", "glass:\n  - [[1, 0], [1, 0]]\nrooms:")
    with pytest.raises(InputError, match=r"line 10, .*a wall longer than 0"):
        parse_world(text, source="small.yaml")


def test_polylines_boxes_and_polygons_become_walls_in_order():
    world = parse_world(SMALL, source="small.yaml")
    outline = [[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0]]
    box = [[0, 3, 1, 3], [1, 3, 1, 4], [1, 4, 0, 4], [0, 4, 0, 3]]
    triangle = [[3, 3, 4, 3], [4, 3, 4, 4], [4, 4, 3, 3]]
    assert np.array_equal(world.walls, [*outline, *box, *triangle])
    assert np.array_equal(world.starts, [[1, 1, np.pi / 2]])
    assert world.source == "small.yaml"


def test_no_world_holds_a_negative_zero():
    world = parse_world(ZEROS, source="zeros")
    made = replace(world, walls=-world.walls, starts=np.array([[-0.0, 0.0, -0.0]]))
    for each in (world, made):
        room, tour = each.rooms[0].boundary, each.tours["short"]
        for array in (each.walls, each.starts, room, tour):
            assert not (np.signbit(array) & (array == 0)).any()
        assert "-0.0" not in repr(each.movables)
        assert "-0," not in world_text(each)
        assert "-0]" not in world_text(each)
        assert world_text(parse_world(world_text(each), source="again")) == world_text(each)


@pytest.mark.parametrize("name", catalogue_names())
def test_the_catalogue_comes_back_exactly(name):
    world = load_world(name)
    assert same(parse_world(world_text(world), source="again"), world)


metres = st.floats(-100, 100)
characters = st.characters(exclude_categories=["Cs"])
names = st.text(characters, min_size=1, max_size=12).filter(
    lambda name: name.isprintable() and bool(name.strip())
)


@settings(max_examples=75, deadline=None)
@given(
    name=names,
    walls=st.lists(
        st.tuples(metres, metres, metres, metres).filter(
            lambda wall: np.hypot(wall[2] - wall[0], wall[3] - wall[1]) > 1e-5
        ),
        min_size=1,
        max_size=5,
    ),
    heading=st.floats(-10, 10),
    corners=st.lists(metres, min_size=3, max_size=3, unique=True),
    labels=st.lists(names, min_size=3, max_size=3, unique=True),
    note=st.text(st.characters(exclude_categories=["C"]), max_size=30),
)
def test_any_world_comes_back_exactly(name, walls, heading, corners, labels, note):
    low, middle, high = sorted(corners)
    outlines = (
        [[440, 0], [440, 200], [300 + low, 100]],
        [[440, 0], [540 + high, 100], [440, 200]],
    )
    first, second, label = labels
    world = World(
        name=name,
        walls=np.concatenate((FAR_WALLS, walls)),
        starts=np.array([[220.0 + low, high, heading]]),
        rooms=tuple(
            Room(name=each, boundary=np.array(outline))
            for each, outline in zip((first, second), outlines, strict=True)
        )
        if middle - low > 1
        else (),
        exits=(
            Exit(
                name=label,
                segment=np.array([440, 100 + low, 440, 100 + high]),
                rooms=(first, second),
            ),
        )
        if middle - low > 1
        else (),
        tours={label: np.array([[220.0 + low, high], [221.0 + low, middle]])},
        notes=(note,),
    )
    assert same(parse_world(world_text(world), source="again"), world)


angles = st.floats(-3.1, 3.1)
spans = st.tuples(st.floats(0.1, 2), st.floats(0.1, 2)).map(lambda span: (min(span), max(span)))
doors = st.fixed_dictionaries(
    {
        "hinge": st.tuples(metres, metres),
        "heading": angles,
        "width": st.floats(0.3, 3),
        "opening": angles.filter(lambda angle: abs(angle) > 0.1),
        "turn_rate": st.floats(0.1, 3),
        "open_for": spans,
        "shut_for": spans,
    }
)
boxes = st.fixed_dictionaries(
    {
        "at": st.tuples(st.floats(200, 300), metres),
        "heading": st.floats(-10, 10),
        "length": st.floats(0.3, 3),
        "width": st.floats(0.3, 3),
        "mass": st.floats(0.5, 1000),
    }
)
walkers = st.fixed_dictionaries(
    {
        "route": st.tuples(*(st.tuples(st.floats(x, x + 9), metres) for x in (400, 420, 440))),
        "closed": st.booleans(),
        "speed": spans,
        "radius": st.floats(0.15, 0.5),
    }
)


@settings(max_examples=60, deadline=None)
@given(doors, boxes, walkers)
def test_any_movable_things_come_back_exactly(door, box, walker):
    world = World(
        name="moving",
        walls=FAR_WALLS,
        starts=np.array([[600.0, 0, 0]]),
        movables=Movables(doors=(Door(**door),), boxes=(Box(**box),), walkers=(Walker(**walker),)),
    )
    assert same(parse_world(world_text(world), source="again"), world)


def test_things_have_defaults_and_angles_in_degrees():
    world = parse_world(SMALL + MOVING, source="small.yaml")
    (door,), (box,), (walker,) = (
        world.movables.doors,
        world.movables.boxes,
        world.movables.walkers,
    )
    assert door == Door(hinge=(3.0, 1.0), heading=np.pi / 2, width=0.5, opening=-np.pi / 2)
    assert box == Box(at=(2.0, 2.0), length=0.4, width=0.3)
    assert walker == Walker(route=((0.5, 0.5), (0.5, 2.5)))


def replaced(old: str, new: str) -> str:
    assert old in SMALL
    return SMALL.replace(old, new)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("", "line 1", "found nothing"),
        ("# only a comment\n", "line 1", "found nothing"),
        ("- 1\n- 2\n", "line 1", "expected a YAML mapping with the key albot-world, found [1, 2]"),
        ("just text", "line 1", "found just text"),
        ("name: x\nwalls: []\n", "line 1", "expected the key albot-world, found the keys name, wa"),
        (replaced("albot-world: 1", "albot-world: 2"), "line 1, albot-world", "version 1"),
        ("albot-world: 2\nplan: x\n", "line 1, albot-world", "version 1 of the format, found 2"),
        ("albot-world: true\n", "line 1, albot-world", "version 1 of the format, found true"),
        (replaced("walls:", "wals:"), "line 3, wals", "did you mean walls?"),
        (replaced("heading", "heeding"), "line 12, starts[0].heeding", "did you mean heading?"),
        (replaced("heading: 90", "heading_rad: 1, heading: 90"), "line 12, starts[0]", "degrees"),
        (replaced(", heading: 90", ""), "line 12, starts[0]", "found {at: [1, 1]}"),
        (replaced("  - {at: [1, 1], heading: 90}", "  []"), "line 11, starts", "one start or more"),
        (replaced("name: small\n", ""), "line 1", "the key name"),
        (replaced("name: small", "name: 3"), "line 2, name", "a name, found 3"),
        (replaced("[4, 4], [0, 4], [0, 0]]\nb", "[4, 4], [4, 4]]\nb"), "line 4, walls[0][2]", "0"),
        (replaced("[4, 0], [4, 4]", "[.nan, 0], [4, 4]"), "line 4, walls[0][1]", "finite"),
        (replaced("[4, 0], [4, 4]", "[-.inf, 0], [4, 4]"), "line 4, walls[0][1]", "finite"),
        (replaced("[4, 0], [4, 4]", "[4e4, 0], [4, 4]"), "line 4, walls[0][1]", "±10000"),
        (replaced("[4, 0], [4, 4]", "[4, 0], [4, 1e-9], [4, 4]"), "line 4, walls[0][1]", "longer"),
        (replaced("[4, 0], [4, 4]", "[4], [4, 4]"), "line 4, walls[0][1]", "a point [x, y]"),
        (replaced("[4, 0], [4, 4]", "[4, four], [4, 4]"), "line 4, walls[0][1][1]", "found four"),
        (replaced("[4, 0], [4, 4]", "[4, true], [4, 4]"), "line 4, walls[0][1][1]", "found true"),
        (replaced("[0, 3, 1, 4]", "[0, 3, 1, 3]"), "line 6, boxes[0]", "with x_min < x_max"),
        (replaced("[0, 3, 1, 4]", "[1, 3, 0, 4]"), "line 6, boxes[0]", "with x_min < x_max"),
        (replaced("[4, 3], [4, 4]]", "[4, 4], [4, 3], [3, 4]]"), "line 8, polygons[0]", "cross"),
        (replaced("[4, 3], [4, 4]]", "[3.5, 3], [4, 3]]"), "line 8, polygons[0]", "cross or touch"),
        (replaced("[0, 3, 1, 4]", "[0, 3, 1]"), "line 6, boxes[0]", "a box [x_min"),
        (replaced("at: [1, 1]", "at: [0.1, 1]"), "line 12, starts[0]", "free space"),
        (replaced("[0, 3, 1, 4]", "[0, 0, 3, 3]"), "line 12, starts[0]", "the inside of line 6, b"),
        (replaced("at: [1, 1]", "at: [3.9, 3.5]"), "line 12, starts[0]", "inside of line 8, poly"),
        (replaced("at: [1, 1]", "at: [4.6, 2]"), "line 10, rooms.only", "no way into only"),
        (replaced("at: [1, 1]", "at: [9, 9]"), "line 12, starts[0]", "1 m outside the rectangle"),
        (replaced("heading: 90", "heading: .nan"), "line 12, starts[0]", "finite"),
        (replaced("boxes:", "walls:"), "line 5", "the key 'walls' once"),
        (replaced("[0, 0]]\nb", "[0, 0]\nb"), "line 5", "valid YAML"),
        (replaced("name: small", "name: !!python/name:os.system"), "line 2", "the tag"),
        (replaced("name: small", "name: *small"), "line 2", "an alias"),
        (replaced("walls:", "walls: !!set"), "line 3", "the tag"),
        (replaced("name: small", "name: a\x07b"), "line 2", "the character"),
        (replaced("name: small", "? [1, 2]\n: 3"), "line 2", "a key that is text"),
        (SMALL + "--- {}\n", "line 13", "valid YAML"),
        (SMALL + "exits: {A: {line: [[0, 0], [1, 1]], rooms: [only, x]}}", "line 13, exits.A", "x"),
        (SMALL + "exits: {A: {line: [[0, 0], [1, 1]]}}", "line 13, exits.A", "the key rooms"),
        (SMALL + "tours:\n  t: [[1, 1], [1, 3.9]]", "line 14, tours.t", "0.25 m clear"),
        (SMALL + MOVING.replace("hinge", "hing"), "line 15, movables.doors[0].hing", "hinge?"),
        (
            SMALL + MOVING.replace("-90", "200"),
            "line 15, movables.doors[0].opening",
            "from 5.73 to 180 degrees, or from -180 to -5.73 degrees, found 200",
        ),
        (
            SMALL + MOVING.replace("opening: -90", "opening_rad: 4"),
            "line 15, movables.doors[0].opening_rad",
            "from 0.1 to pi rad, or from -pi to -0.1 rad, found 4",
        ),
        (SMALL + MOVING.replace("0.4", "0.1"), "line 17, movables.boxes[0].length", "0.3 to 3 (m)"),
        (SMALL + MOVING.replace("[2, 2]", "[1, 3.5]"), "line 17, movables.boxes[0]", "a wall at"),
        (SMALL + MOVING.replace("[2, 2]", "[2]"), "line 17, movables.boxes[0].at", "a point [x"),
        (SMALL + MOVING.replace(", 2.5]]", ", 3.5]]"), "line 19, movables.walkers[0]", "clear of"),
        (SMALL + MOVING.replace("walkers", "people"), "line 18, movables.people", "walkers"),
        ("[" * 5000, "", "without deep nesting"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(text, place, words):
    with pytest.raises(InputError) as caught:
        parse_world(text, source="small.yaml")
    assert caught.value.place == place
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("written", "meant"), [("1e-1", 0.1), ("+.5", 0.5), ("0x10", None), ("1:30", None), ("010", 10)]
)
def test_numbers_are_read_as_yaml_1_2_has_them(written, meant):
    text = replaced("heading: 90", f"heading: {written}")
    if meant is None:
        with pytest.raises(InputError, match="a heading in degrees"):
            parse_world(text, source="small.yaml")
    else:
        assert parse_world(text, source="small.yaml").starts[0, 2] == np.deg2rad(meant)


def test_a_name_may_look_like_a_truth_value():
    world = parse_world(replaced("only:", "no:").replace("small", "on"), source="small.yaml")
    assert (world.name, world.rooms[0].name) == ("on", "no")


def test_the_schema_is_one_and_says_in_words_what_it_expects():
    file = resources.files("albot_maps.formats") / "albot-world.schema.json"
    schema = json.loads(file.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)

    def unexplained(part, path):
        if isinstance(part, dict):
            if "type" in part and "description" not in part:
                yield path
            for key, value in part.items():
                yield from unexplained(value, f"{path}/{key}")

    assert list(unexplained(schema, "")) == []


def test_the_example_in_the_documentation_is_a_valid_world():
    page = (Path(__file__).parents[3] / "docs" / "worlds.md").read_text(encoding="utf-8")
    example = page.split("```yaml\n")[1].split("```")[0]
    world = parse_world(example, source="docs/worlds.md")
    assert world.closed
    assert [room.name for room in world.rooms] == ["lab", "office"]
    assert all((world.movables.doors, world.movables.boxes, world.movables.walkers))
    assert all(key in page for key in ("heading_rad", "notes"))
