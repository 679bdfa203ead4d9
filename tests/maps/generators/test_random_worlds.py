"""Every random world is valid, connected, labelled, closed, and the same everywhere."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_maps import ROBOT_RADIUS, World, load_world
from albot_maps.freespace import FreeSpace, wall_lines
from albot_maps.generators.parameters import ParameterRange
from albot_maps.generators.spec import KINDS, RandomSpec, parameters_of, parse_spec

SEEDS = st.integers(0, 2**64 - 1)
LARGEST = {"rooms": 20, "columns": 8, "rows": 8, "aisles": 5, "bays": 5, "cross_aisles": 3}
"""Counts that the search does not go beyond, for the sake of its time."""
WITH_DOORS = ("apartment", "hall", "office")
DIGESTS = {
    "apartment": "dca0228731990917",
    "hall": "f3be5ada704f5a9e",
    "maze": "cf600170e6a4765a",
    "office": "b9aad2e6b8b0d9ef",
    "ring": "b806b8e5c7d3df66",
    "warehouse": "f5c6a497f87b2ca2",
}


def digest(world: World) -> str:
    """A fingerprint of all that a world holds."""
    fingerprint = hashlib.sha256()
    for array in (world.walls, world.starts, *(room.boundary for room in world.rooms)):
        fingerprint.update(array.astype("<f8").tobytes())
    for opening in world.exits:
        fingerprint.update(opening.segment.astype("<f8").tobytes())
    names = [room.name for room in world.rooms]
    names += [f"{opening.name} {opening.rooms}" for opening in world.exits]
    fingerprint.update("\n".join(names).encode())
    return fingerprint.hexdigest()[:16]


def values(allowed: ParameterRange, name: str) -> st.SearchStrategy[Any]:
    if allowed.type is bool:
        return st.booleans()
    if allowed.type is int:
        return st.integers(int(allowed.minimum), min(int(allowed.maximum), LARGEST.get(name, 10)))
    most = min(allowed.maximum, 60)
    return st.floats(float(allowed.minimum), float(most)).map(lambda value: round(value, 2))


@st.composite
def asked(draw: st.DrawFn) -> RandomSpec:
    """Any kind, any seed, any parameters within their ranges, not all of them possible."""
    known = parameters_of(draw(st.sampled_from(KINDS)))
    ranges = known.ranges()
    chosen = draw(st.lists(st.sampled_from(sorted(ranges)), unique=True, max_size=4))
    given_values = {name: draw(values(ranges[name], name)) for name in chosen}
    return RandomSpec(kind=known.kind, seed=draw(SEEDS), parameters=known(**given_values))


def check(world: World) -> None:
    """All that a random world promises, by the exact free space and not by the quick proof."""
    assert world.closed
    space = FreeSpace(world.walls, ROBOT_RADIUS)
    region = space.region_at(world.starts[0, :2])
    outlines = [shapely.Polygon(room.boundary) for room in world.rooms]
    assert all(space.disc_fits_inside(region, outline) for outline in outlines)
    assert world.room_at(*world.starts[0, :2]) is not None
    check_exits(world)


def check_exits(world: World) -> None:
    """Exits are open, lie on the edges of their two rooms, and join all rooms."""
    walls = wall_lines(world.walls)
    outlines = {room.name: shapely.Polygon(room.boundary) for room in world.rooms}
    joined = {world.rooms[0].name}
    for opening in world.exits:
        line = shapely.LineString(opening.segment.reshape(2, 2))
        assert line.length > 2 * ROBOT_RADIUS
        assert line.interpolate(0.5, normalized=True).distance(walls) >= ROBOT_RADIUS
        assert all(outlines[name].distance(line) < 0.1 for name in opening.rooms)
    for _ in world.rooms:
        for opening in world.exits:
            if joined.intersection(opening.rooms):
                joined.update(opening.rooms)
    assert joined == set(outlines)
    tree = shapely.STRtree(list(outlines.values()))
    first, second = tree.query(list(outlines.values()), predicate="overlaps")
    assert not len(first), "no two rooms overlap"
    assert len(second) == 0


@settings(max_examples=80, deadline=None)
@given(asked())
def test_what_is_made_keeps_its_promises_and_what_is_not_says_why(spec):
    try:
        world = spec.make()
    except InputError as error:
        assert error.source == str(spec)
        assert error.place in spec.parameters.ranges()
        assert error.expected
        assert error.found
        return
    check(world)
    assert world.source == str(spec)
    assert digest(load_world(str(spec))) == digest(world)


@pytest.mark.parametrize("kind", KINDS)
def test_twenty_of_each_kind_are_whole(kind):
    """Their drawing is clean too: total length equals the length of the walls' union."""
    digests = set()
    for seed in range(20):
        world = load_world(f"random:{kind}:{seed}")
        check_exits(world)
        lines = wall_lines(world.walls)
        assert shapely.union_all(lines).length == pytest.approx(lines.length)
        assert world.closed
        assert world.name == f"{kind}-{seed}"
        digests.add(digest(world))
    assert len(digests) == 20


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_on_every_machine(kind):
    assert digest(load_world(f"random:{kind}:42")) == DIGESTS[kind]


@settings(max_examples=12, deadline=None)
@given(SEEDS, st.integers(8, 24), st.integers(0, 2))
def test_an_office_has_the_rooms_and_loops_asked_for(seed, rooms, loops):
    world = load_world(f"random:office:{seed}?rooms={rooms}&loops={loops}&connections=0")
    halls = [room.name for room in world.rooms if room.name.startswith(("corridor", "link"))]
    assert len(world.rooms) - len(halls) == rooms
    assert len(world.exits) - (len(world.rooms) - 1) == loops


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.integers(1, 12), st.integers(0, 3))
def test_an_apartment_has_the_rooms_and_loops_asked_for(seed, rooms, loops):
    spec = f"random:apartment:{seed}?rooms={rooms}&loops={loops}"
    try:
        world = load_world(spec)
    except InputError as error:
        assert error.place == "loops"
        assert rooms < 6
        return
    assert len(world.rooms) == rooms
    assert len(world.exits) - (rooms - 1) == loops


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(20, 200), st.integers(1, 4), st.floats(1, 2))
def test_a_rings_loops_have_the_length_asked_for(seed, length, loops, growth):
    world = load_world(
        f"random:ring:{seed}?length={length}&loops={loops}&growth={growth}&corridor_width=1.5"
    )
    middle = {room.name: room.boundary.mean(axis=0) for room in world.rooms}
    for index in range(1, loops + 1):
        width = middle[f"cross {index + 1}"][0] - middle[f"cross {index}"][0]
        depth = middle[f"north {index}"][1] - middle[f"south {index}"][1]
        assert 2 * (width + depth) == pytest.approx(length * growth ** (index - 1), abs=0.02)
    assert len(world.exits) == 4 * loops


@pytest.mark.parametrize("loops", [0, 4, 20])
def test_a_maze_has_the_loops_asked_for(loops):
    for mirrored in ("true", "false"):
        world = load_world(f"random:maze:3?loops={loops}&symmetry={mirrored}")
        assert len(world.exits) - (len(world.rooms) - 1) == loops


@pytest.mark.parametrize(
    ("query", "loops"),
    [
        ("", 3),
        ("symmetry=true", 2),
        ("columns=2&rows=2", 1),
        ("columns=2&rows=3", 2),
        ("columns=2&symmetry=true", 0),
        ("columns=4&rows=2&symmetry=true", 2),
    ],
)
def test_a_maze_has_few_loops_where_none_are_asked_for(query, loops):
    world = load_world(f"random:maze:1?{query}".removesuffix("?"))
    assert len(world.exits) - (len(world.rooms) - 1) == loops
    link = "&" if query else "?"
    given = load_world(f"{world.source}{link}loops={loops}")
    assert digest(given) == digest(world)


@pytest.mark.parametrize(
    ("spec", "rooms"),
    [
        ("random:office:1", 20),
        ("random:office:1?loops=12", 28),
        ("random:office:1?width=8", 6),
        ("random:office:1?width=8&depth=8", 6),
        ("random:apartment:1", 5),
        ("random:apartment:1?width=3", 5),
        ("random:apartment:1?width=3&depth=3", 1),
        ("random:apartment:1?width=3&depth=6", 2),
    ],
)
def test_as_many_rooms_as_fit_where_none_are_asked_for(spec, rooms):
    world = load_world(spec)
    names = [room.name for room in world.rooms if not room.name.startswith(("corridor", "link"))]
    assert len(names) == rooms
    if "width" not in spec:
        link = "&" if "?" in spec else "?"
        assert digest(load_world(f"{spec}{link}rooms={rooms}")) == digest(world)


@pytest.mark.parametrize("pillars", ["0", "0.0", "3", "50"])
def test_the_pillars_of_a_hall(pillars):
    world = load_world(f"random:hall:1?clutter=0&porches=0&pillars={pillars}")
    count = {"0": 0, "0.0": 0, "3": 48, "50": 0}[pillars]
    assert len(world.walls) == 8 + 4 * count


@pytest.mark.parametrize("kind", KINDS)
def test_what_moves_is_as_much_as_was_asked_and_changes_nothing_else(kind):
    asked = {"people": 2, "boxes": 3} | ({"doors": 2} if kind in WITH_DOORS else {})
    query = "&".join(f"{name}={number}" for name, number in asked.items())
    for seed in range(3):
        world, bare = (
            load_world(f"random:{kind}:{seed}?{query}"),
            load_world(f"random:{kind}:{seed}"),
        )
        moving = world.movables
        assert (len(moving.walkers), len(moving.boxes)) == (2, 3)
        assert len(moving.doors) == asked.get("doors", 0)
        assert digest(world) == digest(bare)
        assert load_world(world.source).movables == moving
        assert not bare.movables


def test_doors_fill_their_doorways():
    world = load_world("random:office:3?doors=5")
    openings = np.array([opening.segment for opening in world.exits])
    for door in world.movables.doors:
        gaps = np.hypot(*(openings.reshape(-1, 2) - door.hinge).T)
        assert gaps.min() == pytest.approx(0.075)
        assert door.width == pytest.approx(0.9)


def mirrored(world: World) -> set[tuple[float, ...]]:
    """Ends of the walls, seen in a mirror that stands at the middle of the building."""
    x_min, _, x_max, _ = world.bounds
    points = world.walls.reshape(-1, 2).copy()
    points[:, 0] = x_min + x_max - points[:, 0]
    return {tuple(point) for point in np.round(points, 6).tolist()}


@pytest.mark.parametrize(
    ("spec", "same"),
    [
        ("random:maze:1?symmetry=true&loops=2", True),
        ("random:maze:1", False),
        ("random:hall:1?symmetry=true&porches=0", True),
        ("random:hall:1?porches=0", False),
        ("random:warehouse:1?empty=0&clutter=0", True),
        ("random:warehouse:1", False),
    ],
)
def test_symmetry(spec, same):
    world = load_world(spec)
    ends = {tuple(point) for point in np.round(world.walls.reshape(-1, 2), 6).tolist()}
    assert (mirrored(world) == ends) is same


@pytest.mark.parametrize("seed", range(5))
def test_rooms_alike_in_a_symmetric_office(seed):
    plain, alike = (
        {
            tuple(np.ptp(room.boundary, axis=0).round(1).tolist())
            for room in load_world(f"random:office:{seed}?loops=1&rooms=20&symmetry={flag}").rooms
        }
        for flag in ("false", "true")
    )
    assert len(alike) < 0.7 * len(plain)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"maze"}))
def test_clutter_is_more_walls(kind):
    empty, full = (
        np.mean(
            [len(load_world(f"random:{kind}:{seed}?clutter={clutter}").walls) for seed in range(4)]
        )
        for clutter in (0, 1)
    )
    assert full > empty


def test_seeds_to_the_limit():
    assert load_world(f"random:ring:{2**64 - 1}").name == f"ring-{2**64 - 1}"


def test_the_spec_of_a_world_says_what_differs_from_the_defaults():
    spec = parse_spec("random:office:7?door_width=0.9&clutter=0.25&symmetry=true")
    assert str(spec) == "random:office:7?clutter=0.25&symmetry=true"
    assert parse_spec(str(spec)) == spec


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("random:", "one of the kinds apartment, hall"),
        ("random:ofice:1", "found ofice (did you mean office?)"),
        ("random:office", "expected the form random:KIND:SEED?KEY=VALUE&…, found no seed"),
        ("random:office:", "seed: expected a whole number from 0"),
        ("random:office:-1", "seed: expected a whole number from 0"),
        ("random:office:1.5", "found 1.5"),
        ("random:office:²", "found ²"),
        (f"random:office:{2**64}", f"found {2**64}"),
        ("random:office:1?room=12", "found room (did you mean rooms?)"),
        ("random:office:1?rooms", "found 'rooms'"),
        ("random:office:1?rooms=5&rooms=5", "rooms: expected each parameter once"),
        ("random:office:1?rooms=", "rooms: expected a whole number from 2 to 200, found nothing"),
        ("random:office:1?rooms=5.5", "rooms: expected a whole number from 2 to 200, found 5.5"),
        ("random:office:1?rooms=1", "rooms: expected a whole number from 2 to 200, found 1"),
        ("random:office:1?clutter=nan", "clutter: expected a number from 0 to 1, found nan"),
        ("random:office:1?clutter=1.01", "clutter: expected a number from 0 to 1, found 1.01"),
        ("random:office:1?door_width=inf", "a number from 0.75 to 1.5 (m), found inf"),
        ("random:office:1?symmetry=yes", "symmetry: expected true or false, found yes"),
        ("random:office:1?rooms=5&loops=3", "rooms: expected at least 10 for 3 loops, found 5"),
        ("random:office:1?width=12&depth=12&rooms=90", "rooms: expected at most"),
        ("random:office:1?loops=1&width=9", "width: expected at least"),
        ("random:office:1?loops=1&depth=9", "depth: expected at least"),
        ("random:apartment:1?rooms=12&width=5&depth=5", "rooms: expected rooms that fit into 5.0"),
        ("random:apartment:1?rooms=3&loops=9", "at most 1 in an apartment of 3 rooms"),
        ("random:maze:1?columns=3&symmetry=true", "columns: expected an even number"),
        ("random:maze:1?columns=4&rows=4&loops=10", "loops: expected at most 9 in 4 x 4 cells"),
        ("random:hall:1?pillars=2", "pillars: expected 0, or a number from 3 to 50 (m), found 2"),
        ("random:hall:1?pillars=0.5", "expected 0, or a number from 3 to 50 (m), found 0.5"),
        ("random:ring:1?growth=3&loops=10", "growth: expected loops at most 5000 m wide"),
        ("random:apartment:1?doors=50", "doors: expected at most "),
        (
            "random:maze:1?columns=2&rows=2&loops=0&boxes=50",
            "boxes: expected at most ",
        ),
        ("random:maze:1?doors=1", "found doors"),
        ("random:ring:1?length=9", "length: expected at least 12 with corridors of 2 m"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(spec, words):
    with pytest.raises(InputError) as caught:
        load_world(spec)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_documentation_lists_every_parameter():
    text = (Path(__file__).parents[3] / "docs" / "worlds.md").read_text(encoding="utf-8")
    for kind in KINDS:
        known = parameters_of(kind)
        section = text.split(f"### `random:{kind}`")[1].split("\n#")[0]
        rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| `")]
        listed = {row[0].strip("| `"): (row[1], row[2]) for row in rows}
        assert listed.keys() == known.ranges().keys()
        for name, allowed in known.ranges().items():
            default = known.defaults()[name]
            default = allowed.usual if default is None else default
            assert listed[name] == (shown(default), shown_range(allowed))


def shown(default: object) -> str:
    if isinstance(default, bool):
        return str(default).lower()
    return "" if default is None else f"{default:g}"


def shown_range(allowed: ParameterRange) -> str:
    if allowed.type is bool:
        return "true, false"
    zero = "0, " if allowed.zero else ""
    return f"{zero}{allowed.minimum:g}–{allowed.maximum:g} {allowed.unit}".rstrip()


@settings(deadline=None, max_examples=25)
@given(kind=st.sampled_from(KINDS), seed=st.integers(0, 10_000), radius=st.floats(0.1, 0.7))
def test_a_world_for_a_robot_has_ways_as_wide_as_it_or_is_refused(
    kind: str, seed: int, radius: float
) -> None:
    """Outside walls as thick as the robot, the ground for its centre must be in one piece.

    The circles' polygons let a robot pass that is up to 0.2 % too wide.
    """
    usual = load_world(f"random:{kind}:{seed}")
    thick = shapely.buffer(shapely.union_all(wall_lines(usual.walls)), radius, quad_segs=64)
    ground = shapely.get_parts(shapely.box(*usual.bounds).difference(thick))
    start = shapely.Point(usual.starts[0, :2])
    around = next((part for part in ground if part.covers(start)), shapely.Polygon())
    rooms = [shapely.Polygon(room.boundary) for room in usual.rooms]
    try:
        world = load_world(f"random:{kind}:{seed}", radius)
    except InputError as error:
        assert f"radius {radius:g} m" in str(error) or around.is_empty
        assert not all(around.intersection(room.buffer(-radius)).area > 1e-3 for room in rooms)
    else:
        assert (world.walls == usual.walls).all()
        assert all(around.buffer(0.002 * radius).intersects(room) for room in rooms)


def test_starts_and_movables_suit_the_robot() -> None:
    spec = "random:apartment:3?starts=9&boxes=2&doors=1"
    world = load_world(spec, 0.34)
    assert shapely.distance(shapely.points(world.starts[:, :2]), wall_lines(world.walls)).min() >= (
        0.34
    )
    with pytest.raises(InputError, match=r"rooms that a robot of radius 0.5 m reaches"):
        load_world(spec, 0.5)
