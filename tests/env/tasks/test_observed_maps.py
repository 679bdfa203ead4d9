"""Maps as observed with each mapper: alone, in batches, branched, and replayed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from albot_core.geometry.poses import compose, relative, wrap_angle
from albot_core.mappers.registry import installed_mappers, make_mappers, mapper_names, mapper_spec
from albot_core.mappers.result_checks import is_from_outside
from albot_core.robot import CONTROL_STEP
from albot_core.sensing.reading import LaserGeometry, Readings
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation import DEFAULT_PARTS, ObservationConfig
from albot_env.tasks.core.observation_builder import ObservationBuilder
from albot_env.tasks.core.parts.map_patch import (
    MAP_PATCH,
    MapPatchConfig,
    channels_of,
)
from albot_env.tasks.core.parts.matches import MATCHES
from albot_env.tasks.explore.env import ExploreEnv, ExploreVectorEnv
from albot_env.tasks.explore.task import ExploreConfig
from albot_env.tasks.homing.env import HomingEnv, HomingVectorEnv
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import World
from tests.env.conftest import drive
from tests.env.quick import LOOP
from tests.env.tasks.test_map_patch import believed

PATCH = MapPatchConfig(sides=(8.0, 40.0), cells=16)

MAPPERS = ("none", *(name for name in mapper_names() if not is_from_outside(mapper_spec(name))))
STROLL = ObservationConfig(parts=(*DEFAULT_PARTS, "map_patch"), map_patch=PATCH)


def config_for(mapper: str) -> ExploreConfig:
    """All that can be observed of a mapper's map."""
    spec = None if mapper == "none" else mapper_spec(mapper)
    has_graph = spec is not None and "place_graph" in spec.layers
    has_matches = spec is not None and spec.has_matches
    parts = STROLL.parts + ("place_graph",) * has_graph + ("matches",) * has_matches
    patch = replace(PATCH, channels=channels_of(spec))
    return ExploreConfig(observations=replace(STROLL, parts=parts, map_patch=patch))


@pytest.mark.parametrize("mapper", MAPPERS)
def test_every_mapper_gives_its_channels_alone_as_in_a_batch(two_rooms: World, mapper) -> None:
    if mapper not in ("none", *installed_mappers()):
        pytest.skip(f"{mapper} needs an extra that is not installed")
    settings = {"mapper": mapper, "config": config_for(mapper), "observation": "dict"}
    needed = frozenset() if mapper == "none" else mapper_spec(mapper).sensors
    settings |= {"scenes": "paper"} if "scene" in needed else {}
    settings |= {"compass": "polarised"} if "compass" in needed else {}
    env = ExploreEnv(two_rooms, **settings)
    batch = ExploreVectorEnv(2, two_rooms, threads=2, **settings)
    seen = drive(env, 40)
    rows, _ = batch.reset(seed=[5, 6], options={"start": 0})
    rng = np.random.default_rng(5)
    for step in range(41):
        for name, part in seen[step][0].items():
            np.testing.assert_array_equal(rows[name][0], part, err_msg=name)
        action = np.array((*rng.uniform((0, -0.6), (1, 0.6)), -1.0), np.float32)
        rows, *_ = batch.step(np.stack((action, action)))
    decoded = env.observation_config.decode(MAP_PATCH, seen[-1][0])
    spec = None if mapper == "none" else mapper_spec(mapper)
    assert tuple(decoded.channels) == channels_of(spec)
    for name, squares in decoded.channels.items():
        if name == "home":
            assert (squares == 1).sum(axis=(1, 2)).tolist() == [1, 1]
        if name in ("walls", "free", "trail", "obstacles"):
            assert (squares > -1).any(axis=(1, 2)).all(), name
    assert decoded.channels["trail"][:, 7:9, 7:9].max() > 0.99
    batch.close()


@pytest.mark.parametrize("mapper", ["albot1", "graph-slam", "none"])
def test_the_map_is_a_function_of_the_readings_alone(
    two_rooms: World, tmp_path: Path, mapper: str
) -> None:
    """Recorded readings, told to a fresh mapper in another world, give the same numbers."""
    config = config_for(mapper)
    env = ExploreEnv(two_rooms, mapper=mapper, config=config)
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    seen = drive(env, 60)
    env.close()
    fitted = env.observation_config
    mappers = None if mapper == "none" else make_mappers(mapper, 1)
    builder = ObservationBuilder(1, fitted, LaserGeometry(), 0.25, mappers)
    elsewhere = replace(two_rooms, walls=two_rooms.walls + 3.0, rooms=())
    builder.begin(0, elsewhere)
    if mappers is not None:
        mappers.reset(0, np.random.default_rng(0))
    state, row = believed(), np.zeros((1, fitted.flat_space.shape[0]), np.float32)
    rows = np.zeros(1, np.int64)
    for moment, (observation, _) in zip(
        EpisodeReader(tmp_path / "a.mcap").moments(), seen, strict=True
    ):
        reading = moment.reading
        assert reading.laser is not None
        state.motions[0], state.ranges[0] = reading.motion, reading.laser.ranges
        if mappers is None:
            state.beliefs[0] = compose(state.beliefs[0], reading.motion)
        else:
            stamps, laser = np.array([reading.stamp]), reading.laser.geometry
            readings = Readings(
                stamps=stamps, motions=state.motions, laser=laser, ranges=state.ranges
            )
            mappers.update(rows, readings)
            state.beliefs[0], state.homes_in_map[0] = mappers.poses[0], mappers.homes_in_map[0]
        builder.observe(rows, state, row)
        for part in ("map_patch", "place_graph", "matches"):
            if part in fitted.shapes:
                found, wanted = fitted.split(row[0])[part], fitted.split(observation)[part]
                np.testing.assert_array_equal(found, wanted, err_msg=part)
    assert relative(state.homes_in_map[0], state.beliefs[0])[:2].any()


def test_a_branched_episode_observes_the_same_map(two_rooms: World) -> None:
    env = ExploreEnv(two_rooms, mapper="albot1", config=config_for("albot1"))
    drive(env, 50)
    state = env.get_state()
    action = np.array((0.6, 0.3, -1.0), np.float32)
    onward = [env.step(action)[0] for _ in range(20)]
    other = ExploreEnv(two_rooms, mapper="albot1", config=config_for("albot1"))
    other.reset(seed=1)
    other.set_state(state)
    for wanted in onward:
        np.testing.assert_array_equal(other.step(action)[0], wanted)


@pytest.mark.parametrize("mapper", ["albot1", "none", "gmapping"])
def test_the_trail_of_the_outward_journey_is_seen_from_the_first_step_on(mapper: str) -> None:
    """Alone as in a batch, also where the journey was made by robots without a map to observe."""
    outing = OutwardJourneyConfig(shortest=6.0, longest=6.0, away=0.0)
    blind = HomingConfig(outing=outing)
    shown = replace(
        blind, observations=replace(config_for(mapper).observations, coverage=CoverageConfig())
    )
    settings = {"mapper": mapper, "world": LOOP, "journeys": 1}
    HomingEnv(config=blind, **settings).reset(seed=1)
    env = HomingEnv(config=shown, **settings)
    batch = HomingVectorEnv(2, config=shown, **settings)
    seen, _ = env.reset(seed=1)
    rows, _ = batch.reset(seed=[1, 2])
    np.testing.assert_array_equal(rows[0], seen)
    trail = env.observation_config.decode(MAP_PATCH, seen).channels["trail"]
    assert (trail[1] > -1).sum() > 2
    for _ in range(5):
        action = np.array((0.3, 0.4, -1.0), np.float32)
        seen, *_ = env.step(action)
        rows, *_ = batch.step(np.stack((action, action)))
        np.testing.assert_array_equal(rows[0], seen)
    batch.close()


def steered(pose: np.ndarray, goal: tuple[float, float]) -> np.ndarray:
    """The action of a robot that drives to a goal."""
    x, y = np.array(goal) - pose[:2]
    turn = float(wrap_angle(np.arctan2(y, x) - pose[2]))
    return np.array((max(0.0, 1.0 - abs(turn)), np.clip(2.0 * turn, -1, 1), -1.0), np.float32)


@pytest.mark.parametrize(
    ("mapper", "settings"),
    [("graph-slam", {}), ("ratslam", {}), ("ratslam-scenes", {"scenes": "ideal"})],
)
def test_matches_of_a_second_lap_are_where_the_robot_was_on_the_first(
    mapper: str, settings: dict[str, str]
) -> None:
    """Alone as in a batch, and branched; on the first lap there are none."""
    if mapper not in installed_mappers():
        pytest.skip(f"{mapper} needs an extra that is not installed")
    config = ExploreConfig(observations=ObservationConfig(parts=("home", "matches")))
    settings = {"mapper": mapper, "config": config, **settings}
    env, batch = ExploreEnv(LOOP, **settings), ExploreVectorEnv(2, LOOP, **settings)
    seen, info = env.reset(seed=3)
    rows, _ = batch.reset(seed=[3, 4])
    corners = [(1.25, 5.75), (5.75, 5.75), (5.75, 1.25), (1.25, 1.25)] * 2
    poses, ways, errors = [info["pose"]], [0.0], [0.0]
    actions, observations, matched = [], [], 0
    state = None
    while corners:
        if np.hypot(*(info["pose"][:2] - corners[0])) < 0.3:
            corners.pop(0)
            continue
        if len(corners) == 2 and state is None:
            state, actions, observations = env.get_state(), [], []
        actions.append(steered(info["pose"], corners[0]))
        seen, *_, info = env.step(actions[-1])
        rows, *_ = batch.step(np.stack((actions[-1], actions[-1])))
        np.testing.assert_array_equal(rows[0], seen)
        observations.append(seen)
        poses.append(info["pose"])
        ways.append(info["path_length"])
        errors.append(info["position_error"])
        matches = env.observation_config.decode(MATCHES, seen)
        if not len(matches.ages):
            continue
        matched += 1
        then = len(poses) - 1 - round(matches.ages[0] / CONTROL_STEP)
        away = relative(poses[-1], poses[then])[:2]
        assert ways[-1] - ways[then] > 15.0
        # Both poses are as wrong as the mapper's at most, of which one is seen in the other.
        assert np.hypot(*(matches.points[0] - away)) < 2 * max(errors) + 0.02
        assert np.hypot(*away) < 1.6
        assert (matches.scores > 0.4).all() and (matches.scores <= 1).all()
        assert (matches.ambiguities <= matches.probabilities).all()
    assert ways[-1] > 35.0
    assert matched > 0.3 * len(poses)
    batch.close()
    other = ExploreEnv(LOOP, **settings)
    other.reset(seed=9)
    assert state is not None
    other.set_state(state)
    for action, wanted in zip(actions, observations, strict=True):
        np.testing.assert_array_equal(other.step(action)[0], wanted)
