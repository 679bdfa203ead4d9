"""Homing by the map: what is changed after the way out, and that nobody tells the way."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.tasks.core.observation import HINTS, HOMING_PARTS, ObservationConfig
from albot_env.tasks.explore_and_home.env import ExploreAndHomeEnv
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing_by_map.changes import (
    CHANGES,
    ChangesConfig,
    carried_pose,
    furniture_of,
    openable_doors,
    shut_on_way_home,
    with_furniture_moved,
)
from albot_env.tasks.homing_by_map.env import HomingByMapEnv, HomingByMapVectorEnv
from albot_env.tasks.homing_by_map.task import HomingByMapConfig
from albot_maps import Exit, Room, World
from albot_maps.geodesic import DistanceField

SHORT = OutwardJourneyConfig(shortest=8.0, longest=12.0, away=3.0)
NOTHING = ChangesConfig(door_shut=0.0, door_opened=0.0, carried=0.0, furniture_moved=0.0)
TABLE = ((7.0, 2.0), (7.8, 2.0), (7.8, 2.8), (7.0, 2.8))


def only(kind: str) -> ChangesConfig:
    return ChangesConfig(**{name: float(name == kind) for name in CHANGES[1:]})


@pytest.fixture(scope="module")
def ring() -> World:
    """Four rooms of 5 m by 5 m around a cross of walls, each joined to two others by a door.

    A table stands in the room SE. The robot starts in the room SW.
    """
    box = [(0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0)]
    cross = []
    for a, b in ((0, 2), (3, 7), (8, 10)):  # Doors of 1 m at 2..3 and 7..8 of each arm.
        cross += [(5, a, 5, b), (a, 5, b, 5)]
    table = [(*TABLE[k], *TABLE[(k + 1) % 4]) for k in range(4)]
    corners = {"SW": (0, 0), "SE": (5, 0), "NE": (5, 5), "NW": (0, 5)}
    rooms = tuple(
        Room(name=name, boundary=np.array(((x, y), (x + 5, y), (x + 5, y + 5), (x, y + 5)), float))
        for name, (x, y) in corners.items()
    )
    doors = {
        ("SW", "SE"): (5, 2, 5, 3),
        ("NW", "NE"): (5, 7, 5, 8),
        ("SW", "NW"): (2, 5, 3, 5),
        ("SE", "NE"): (7, 5, 8, 5),
    }
    exits = tuple(
        Exit(name="-".join(pair), segment=np.array(line, float), rooms=pair)
        for pair, line in doors.items()
    )
    return World(
        name="ring",
        walls=np.array([*box, *cross, *table], float),
        starts=np.array(((2.5, 2.5, 0.0),)),
        rooms=rooms,
        exits=exits,
    )


HOME = np.array((2.5, 2.5))


def field_of(world: World) -> DistanceField:
    return DistanceField(world.walls, world.robot_radius, HOME)


def test_each_change_is_drawn_as_often_as_it_is_to_be() -> None:
    config, rng = ChangesConfig(), np.random.default_rng(1)
    drawn = Counter(config.draw(rng) for _ in range(5000))
    for kind in CHANGES[1:]:
        assert drawn[kind] / 5000 == pytest.approx(getattr(config, kind), abs=0.02)
    assert {only(kind).draw(rng) for kind in CHANGES[1:] for _ in range(9)} == set(CHANGES[1:])
    with pytest.raises(InputError, match=r"sum to at most 1, found 1\.3"):
        ChangesConfig(door_shut=0.9)
    with pytest.raises(InputError, match=r"ChangesConfig\.carried"):
        ChangesConfig(carried=-0.1)


def test_the_first_door_on_the_way_home_is_shut_and_there_is_a_way_round(ring: World) -> None:
    field, position = field_of(ring), np.array((6.0, 2.5))
    assert field.distance(position) == pytest.approx(3.5, abs=0.05)
    changed = shut_on_way_home(ring, field, position, HOME)
    assert changed is not None
    assert changed.world.walls[-1].tolist() == [5, 2, 5, 3]
    np.testing.assert_array_equal(changed.world.walls[:-1], ring.walls)
    # By the three other doors, round the middle of the cross.
    assert 10.0 < changed.field.distance(position) < 16.0
    assert len(ring.walls) + 1 == len(changed.world.walls)


def test_a_door_in_which_the_robot_stands_is_not_shut(ring: World) -> None:
    for x, is_shut in ((5.3, False), (5.6, True)):
        position = np.array((x, 2.5))
        changed = shut_on_way_home(ring, field_of(ring), position, HOME)
        assert (changed is not None) == is_shut


def test_no_door_is_shut_without_which_a_room_cannot_be_reached(ring: World) -> None:
    field, position = field_of(ring), np.array((6.0, 2.5))
    once = shut_on_way_home(ring, field, position, HOME)
    assert once is not None
    again = shut_on_way_home(once.world, once.field, position, HOME)
    assert again is None


def test_doors_that_may_open_make_the_way_home_longer_while_they_are_shut(ring: World) -> None:
    shut = list(openable_doors(ring, field_of(ring)))
    assert {tuple(world.walls[-1].tolist()) for world in shut} <= {
        tuple(map(float, each.segment)) for each in ring.exits
    }
    before, after = field_of(ring), field_of(shut[0])
    middles = [room.boundary.mean(axis=0) for room in ring.rooms]
    assert max(after.distance(at) / max(before.distance(at), 0.1) for at in middles) > 1.2


def test_a_robot_is_carried_to_another_room(ring: World) -> None:
    rng, field, position = np.random.default_rng(2), field_of(ring), np.array((2.0, 3.0))
    rooms = set()
    for _ in range(30):
        pose = carried_pose(ring, field, position, rng)
        assert pose is not None
        assert field.distance(pose[:2]) >= 5.0
        assert ring.reaches(pose[:2])
        rooms.add(ring.room_at(*pose[:2].tolist()))
    assert rooms == {"SE", "NE", "NW"}


def test_furniture_is_what_stands_free_and_closes(ring: World) -> None:
    (table,) = furniture_of(ring)
    assert {tuple(point) for point in ring.walls[table][:, :2].tolist()} == set(TABLE)


def test_furniture_is_moved_as_a_whole_within_its_room(ring: World) -> None:
    rng, moved = np.random.default_rng(3), 0
    for _ in range(12):
        world = with_furniture_moved(ring, HOME, rng)
        if world is None:
            continue
        moved += 1
        (table,) = furniture_of(ring)
        np.testing.assert_array_equal(
            np.delete(world.walls, table, axis=0), np.delete(ring.walls, table, axis=0)
        )
        shift = world.walls[table] - ring.walls[table]
        np.testing.assert_allclose(shift, np.tile(shift[0, :2], (4, 2)), atol=1e-9)
        assert np.hypot(*shift[0, :2]) >= 0.75
        assert all(world.room_at(*point) == "SE" for point in world.walls[table][:, :2].tolist())
    assert 2 <= moved <= 11


@pytest.mark.parametrize("kind", CHANGES)
def test_an_episode_after_each_change_alone_in_a_batch_and_branched(ring: World, kind: str) -> None:
    changes = NOTHING if kind == "none" else only(kind)
    config = HomingByMapConfig(outing=SHORT, changes=changes)
    settings: dict[str, Any] = {"config": config, "mapper": "albot1"}
    env = HomingByMapEnv(ring, **settings)
    batch = HomingByMapVectorEnv(2, ring, **settings)
    kinds = set()
    for seed in range(4):
        seen, info = env.reset(seed=seed)
        rows, infos = batch.reset(seed=[seed, seed + 50])
        np.testing.assert_array_equal(rows[0], seen)
        assert infos["change"][0] == info["change"]
        kinds.add(info["change"])
        if info["change"] == kind != "none":
            check_change(kind, env, ring)
        rng = np.random.default_rng(seed)
        for step in range(12):
            action = np.array((*rng.uniform(-0.8, 0.8, 2), -1.0, 1.0), np.float32)
            seen, reward, *_, info = env.step(action)
            rows, rewards, *_ = batch.step(np.stack((action, action)))
            np.testing.assert_array_equal(rows[0], seen)
            assert rewards[0] == reward
            if step == 5:
                state = env.get_state()
        other = HomingByMapEnv(ring, **settings)
        other.reset(seed=99)
        rng = np.random.default_rng(seed)
        actions = [np.array((*rng.uniform(-0.8, 0.8, 2), -1.0, 1.0), np.float32) for _ in range(12)]
        other.set_state(state)
        for action in actions[6:]:
            again, *_, told = other.step(action)
        np.testing.assert_array_equal(again, seen)
        assert told["distance_home"] == info["distance_home"]
        assert told["change"] == info["change"]
    assert kind in kinds
    batch.close()


def check_change(kind: str, env: HomingByMapEnv, ring: World) -> None:
    """What has been changed in an episode that begins."""
    task = env._robot
    pose, walls = task.poses[0], task.world(0).walls
    way = float(task.facts["distance_home"][0])
    direct = field_of(ring).distance(pose[:2])
    if kind == "door_shut":
        assert len(walls) == len(ring.walls) + 1
        assert way >= 1.15 * direct
    elif kind == "door_opened":
        assert len(walls) >= len(ring.walls)
        assert way <= direct + 0.1
    elif kind == "carried":
        # The robot does not know it: it believes to be where its journey ended.
        start = task.starts[0]
        believed = start[:2] + task.beliefs[0, :2]
        assert math.dist(believed, pose[:2]) > 3.0
    else:
        assert len(walls) == len(ring.walls)
        assert (walls != ring.walls).any()


def test_hints_are_barred_and_the_default_shows_what_the_mapper_can_give(ring: World) -> None:
    shown = HomingByMapEnv(ring, mapper="albot1").observation_config.parts
    assert {"map_patch", "place_graph", "matches"} <= set(shown)
    assert not set(HINTS) & set(shown)
    plain = HomingByMapEnv(ring, mapper="none").observation_config.parts
    assert {"map_patch"} == {"map_patch", "place_graph", "matches"} & set(plain)
    hinted = HomingByMapConfig(hints=True)
    assert set(HINTS) <= set(HomingByMapEnv(ring, config=hinted).observation_config.parts)
    for env, config in (
        (HomingByMapEnv, HomingByMapConfig(observations=ObservationConfig(parts=HOMING_PARTS))),
        (
            ExploreAndHomeEnv,
            ExploreAndHomeConfig(observations=ObservationConfig(parts=HOMING_PARTS)),
        ),
    ):
        with pytest.raises(InputError, match=r"parts: expected .*hints=True, found exit"):
            env(ring, config=config)
    mission = ExploreAndHomeEnv(ring).observation_config.parts
    assert {"time_left", "map_patch", "matches"} <= set(mission)


def test_a_world_without_doors_changes_as_far_as_it_can(two_rooms: World) -> None:
    for kind in ("door_shut", "door_opened", "furniture_moved"):
        config = HomingByMapConfig(outing=SHORT, changes=only(kind))
        env = gymnasium.make("Albot/HomingByMap-v0", world=two_rooms, config=config)
        assert env.reset(seed=1)[1]["change"] == "none"
