"""A world that can be read can be played: every task begins in it, from each of its starts."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from albot_core.errors import InputError
from albot_env.sim import Simulator
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import ROBOT_RADIUS, World, WorldSet, load_world
from albot_maps.formats.world_file import world_text
from tests.env import quick
from tests.maps.formats.test_ros_grid import write_map

Write = Callable[[Path], Path]
Line = list[list[float]]


def ours(walls: list[Line], *starts: tuple[float, float]) -> Write:
    """An albot-world file."""

    def write(folder: Path) -> Path:
        placed = ", ".join(f"{{at: [{x}, {y}], heading: 0}}" for x, y in starts)
        path = folder / "a.yaml"
        path.write_text(
            f"albot-world: 1\nname: a\nwalls: {json.dumps(walls)}\nstarts: [{placed}]\n"
        )
        return path

    return write


def ros(draw: Callable[[ImageDraw.ImageDraw], None], **changes: object) -> Write:
    """A map of 20 m by 16 m in cells of 0.1 m, white where nothing is drawn."""

    def write(folder: Path) -> Path:
        image = Image.new("L", (200, 160), 255)
        draw(ImageDraw.Draw(image))
        return write_map(folder, np.asarray(image), **changes)

    return write


def stage(text: str) -> Write:
    """A Stage world; its floor plan is that of `ring`."""

    def write(folder: Path) -> Path:
        image = Image.new("L", (200, 160), 255)
        ring(ImageDraw.Draw(image))
        image.save(folder / "ring.png")
        path = folder / "a.world"
        path.write_text(text)
        return path

    return write


def house(*corners: tuple[float, float]) -> Write:
    """A house of HouseExpo."""

    def write(folder: Path) -> Path:
        path = folder / "a.json"
        path.write_text(json.dumps({"verts": corners}))
        return path

    return write


def plan(*corners: tuple[int, int]) -> Write:
    """An XML floor plan of one room (cm)."""
    points = "".join(f'<point x="{x}" y="{y}"/>' for x, y in corners)

    def write(folder: Path) -> Path:
        path = folder / "a.xml"
        path.write_text(
            "<building><scale><represented_distance><value>100</value><um>pixel</um>"
            "</represented_distance><real_distance><value>100</value><um>cm</um></real_distance>"
            '</scale><floor><spaces><space id="a"><labels><label>A</label></labels>'
            f"<bounding_polygon>{points}</bounding_polygon></space></spaces></floor></building>"
        )
        return path

    return write


def ring(draw: ImageDraw.ImageDraw) -> None:
    draw.ellipse((30, 10, 170, 150), outline=0, width=3)
    draw.ellipse((60, 40, 140, 120), outline=0, width=3)


def bay(draw: ImageDraw.ImageDraw) -> None:
    draw.line(((150, 20), (40, 20), (40, 140), (150, 140)), fill=0, width=2)


def islands(draw: ImageDraw.ImageDraw) -> None:
    for x, y in ((50, 40), (120, 50), (70, 110)):
        draw.rectangle((x, y, x + 8, y + 12), fill=0)


def thin(draw: ImageDraw.ImageDraw) -> None:
    draw.polygon(((20, 20), (180, 30), (160, 140), (30, 120)), outline=0, width=1)


def with_a_hole(draw: ImageDraw.ImageDraw) -> None:
    thin(draw)
    draw.line(((95, 20), (99, 30)), fill=255, width=4)


def with_a_door(draw: ImageDraw.ImageDraw) -> None:
    thin(draw)
    draw.line(((90, 20), (105, 30)), fill=255, width=16)


def post(draw: ImageDraw.ImageDraw) -> None:
    draw.point((100, 80), fill=0)


ROOM = [[[0, 0], [6, 0], [6, 5], [0, 5], [0, 0]]]
BAY = [[[6, 0], [0, 0], [0, 5], [6, 5]]]
SEEN = 'floorplan ( bitmap "ring.png" size [16 14 1] obstacle_return 0 ranger_return 0.5 )'
WORLDS: dict[str, Write] = {
    "ring": ros(ring),
    "ring, turned": ros(ring, origin=[-7.0, 3.0, 0.7]),
    "ring, the frame in the infield": ros(ring, origin=[-10.0, -8.0, 0.0]),
    "bay": ros(bay),
    "islands": ros(islands),
    "thin walls": ros(thin),
    "thin walls with a hole": ros(with_a_hole),
    "thin walls with a door": ros(with_a_door),
    "a post": ros(post),
    "started in": ours(ROOM, (3, 2.5)),
    "started in a corner": ours(ROOM, (ROBOT_RADIUS, ROBOT_RADIUS)),
    "started outside": ours(ROOM, (7, 2.5)),
    "bay, started in": ours(BAY, (3, 2.5), (6.9, 2.5)),
    "bay, started outside": ours(BAY, (-1, -1)),
    "a wall": ours([[[0, 0], [4, 0]]], (2, ROBOT_RADIUS), (2, -0.9)),
    "a cell": ours([[[0, 0], [0.6, 0], [0.6, 0.6], [0, 0.6], [0, 0]]], (0.3, 0.3)),
    "Stage, a ring": stage(SEEN),
    "Stage, a robot": stage(SEEN + "\nposition ( pose [0 0 0 0] )"),
    "Stage, boxes": stage("model ( size [1 1] )\nmodel ( size [2 1] pose [4 0 0] )"),
    "Stage, a box": stage("model ( size [1 1] )"),
    "house": house((0, 0), (4, 0), (4, 2), (8, 2), (8, 5), (0, 5)),
    "narrow house": house((0, 0), (9, 0), (9, 0.52), (0, 0.52)),
    "plan": plan((0, 0), (700, 0), (700, 400), (0, 400)),
    "narrow plan": plan((0, 0), (700, 0), (700, 53), (0, 53)),
}


@pytest.fixture(scope="module")
def worlds(tmp_path_factory):
    """All worlds by name."""
    return {name: load_world(str(WORLDS[name](tmp_path_factory.mktemp("w")))) for name in WORLDS}


@pytest.fixture(scope="module", params=quick.IDS)
def env(request, worlds):
    """An environment of each task with all these worlds."""
    every = {"world": WorldSet(list(worlds.values())), "mapper": "odometry"}
    made = gymnasium.make(request.param, **quick.SETTINGS.get(request.param, {}) | every)
    yield made
    made.close()


@pytest.mark.parametrize("name", WORLDS)
def test_what_is_read_can_be_played(env, worlds, name):
    task, world = env.spec.id, worlds[name]
    for start in range(len(world.starts)):
        options = {"world": list(worlds).index(name), "start": start}
        if task in quick.JUDGED:  # None of these worlds has two rooms.
            with pytest.raises(InputError, match="two rooms in which a robot can stop"):
                env.reset(seed=1, options=options)
            continue
        observation, info = env.reset(seed=1, options=options)
        assert env.observation_space.contains(observation)
        assert all(np.isfinite(info[key]) for key in info if key.endswith("distance_home"))
        env.step(quick.drawn_actions(task, np.random.default_rng(1)))


@pytest.mark.parametrize("name", WORLDS)
def test_what_is_converted_is_the_same_world(tmp_path, worlds, name):
    world = worlds[name]
    path = tmp_path / "converted.yaml"
    path.write_text(world_text(world))
    again = load_world(str(path))
    assert again.walls.tobytes() == world.walls.tobytes()
    assert again.starts.tobytes() == world.starts.tobytes()
    assert (again.closed, again.notes) == (world.closed, world.notes)


@pytest.mark.parametrize("name", ["ring", "thin walls", "Stage, a ring", "house", "plan"])
def test_within_walls_a_robot_starts_within(worlds, name):
    assert worlds[name].closed


def test_homes_outside_all_walls_are_as_far_as_they_are(worlds):
    """A journey out of the bay and away leads off the plan."""
    outing = OutwardJourneyConfig(shortest=40.0, longest=40.0)
    world, config = worlds["a wall"], HomingConfig(outing=outing)
    env = gymnasium.make("Albot/Homing-v0", world=world, mapper="odometry", config=config)
    _, info = env.reset(seed=1, options={"start": 0})
    straight = np.hypot(*(info["pose"][:2] - info["start"][:2]))
    assert straight > 5
    assert straight - 0.01 <= info["initial_distance_home"] < straight + 5
    env.close()


LENGTHS = st.integers(0, 60).map(lambda tenths: tenths / 10)
WALLS = st.lists(st.tuples(LENGTHS, LENGTHS, LENGTHS, LENGTHS), min_size=1, max_size=6)
PLACES = st.integers(-20, 80).map(lambda tenths: tenths / 10)


@settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(WALLS, PLACES, PLACES)
def test_whatever_is_valid_is_a_start_for_the_simulator(walls, x, y):
    lines = np.array([wall for wall in walls if wall[:2] != wall[2:]], float).reshape(-1, 4)
    try:
        world = World(name="drawn", walls=lines, starts=np.array([[x, y, 0.0]]))
    except InputError:
        return
    assert world.reaches(world.starts[0, :2])
    Simulator(world).reset(np.random.default_rng(1))
