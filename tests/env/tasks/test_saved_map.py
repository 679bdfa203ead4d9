"""Environments in which robots come back to a building that they know."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.map_file import save_map
from albot_core.mappers.registry import make_mapper
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.sim.simulator import Simulator, StartStop, follow_leg
from albot_maps import load_world

EXPLORE, TRIP = "Albot/Explore-v0", "Albot/ExploreAndHome-v1"
WORLD = "square-loop"
MAPPER = "scan-matching"
STEPS = 60


@pytest.fixture(scope="module")
def saved_map(tmp_path_factory) -> Path:
    """A map of the world, begun at its start."""
    world, mapper = load_world(WORLD), make_mapper(MAPPER)
    simulator = Simulator(world, movables=False)
    mapper.update(simulator.reset(np.random.default_rng(0), world.starts[0]))
    for room in [*world.rooms, world.rooms[0]]:
        for reading in follow_leg(simulator, room.boundary.mean(axis=0), StartStop(move=0.5)):
            mapper.update(reading)
    path = tmp_path_factory.mktemp("saved") / "loop.albot"
    save_map(mapper, path)
    return path


def make(saved_map: Path | None, task: str = EXPLORE, **settings: Any) -> gymnasium.Env:
    settings = {"world": WORLD, "mapper": MAPPER, "saved_map": saved_map, **settings}
    return gymnasium.make(task, disable_env_checker=True, **settings)


def action_of(env: gymnasium.Env | gymnasium.vector.VectorEnv, step: int) -> np.ndarray:
    action = np.full(env.action_space.shape, -1.0, np.float32)
    action[..., 0], action[..., 1] = 1.0, 0.5 * np.sin(step / 9)
    return action


def drive(env: gymnasium.Env, steps: int = STEPS) -> list[tuple]:
    rows = []
    for step in range(steps):
        observation, reward, _, _, info = env.step(action_of(env, step))
        rows.append((*observation.tolist(), reward, *np.ravel(info["belief"]).tolist()))
    return rows


def test_home_is_where_the_saved_map_was_begun_wherever_the_robot_starts(saved_map):
    world, env = load_world(WORLD), make(saved_map, TRIP)
    start = np.array((*world.rooms[-1].boundary.mean(axis=0), 1.0))
    _, info = env.reset(seed=1, options={"start": start})
    assert np.allclose(info["pose"], start, atol=1e-6)
    assert np.array_equal(info["start"], world.starts[0])
    env.close()


def test_a_robot_is_lost_at_first(saved_map):
    env = make(saved_map)
    env.reset(seed=1)
    assert env.unwrapped._robot._mappers.is_lost.tolist() == [True]
    env.close()


def test_an_episode_repeats_itself_and_goes_on_from_a_state_to_the_bit(saved_map):
    one, other = make(saved_map), make(saved_map)
    one.reset(seed=4)
    other.reset(seed=4)
    assert drive(one, 20) == drive(other, 20)
    state = one.unwrapped.get_state()
    after = drive(one, 15)
    other.reset(seed=9)
    other.unwrapped.set_state(state)
    assert drive(other, 15) == after
    one.close()
    other.close()


@pytest.mark.parametrize("extend_map", [False, True])
def test_a_batch_is_as_each_alone(extend_map, saved_map):
    settings = {"world": WORLD, "mapper": MAPPER, "saved_map": saved_map}
    settings["extend_map"] = extend_map
    batch = gymnasium.make_vec(EXPLORE, num_envs=2, **settings)
    alone = make(saved_map, extend_map=extend_map)
    together, _ = batch.reset(seed=[5, 6])
    single, _ = alone.reset(seed=6)
    assert np.array_equal(together[1], single)
    for step in range(30):
        together, rewards, *_ = batch.step(action_of(batch, step))
        single, reward, *_ = alone.step(action_of(alone, step))
        assert np.array_equal(together[1], single) and rewards[1] == reward
    batch.close()
    alone.close()


def test_its_recording_holds_the_saved_map_from_the_first_moment(saved_map, tmp_path):
    env = make(saved_map)
    env.unwrapped.recorder = EpisodeWriter(tmp_path / "episode.mcap")
    env.reset(seed=2)
    drive(env, 5)
    env.close()
    moments = list(EpisodeReader(tmp_path / "episode.mcap").moments())
    assert any(moment.facts["localised"] is False for moment in moments)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"mapper": "albot1"}, "expected a map of albot1, found one of scan-matching"),
        ({"mapper": "none"}, "saved_map: expected None, for a robot without a mapper"),
        ({"saved_map": "nowhere.albot"}, r"nowhere\.albot: expected a map file"),
        ({"saved_map": 7}, "saved_map: expected the path of a map file"),
        ({"saved_map": None, "extend_map": True}, "extend_map: expected False"),
    ],
)
def test_what_cannot_be_is_refused(settings, message, saved_map):
    with pytest.raises(InputError, match=message):
        make(**{"saved_map": saved_map, **settings})


def test_homing_must_start_at_home(saved_map):
    env = make(saved_map, "Albot/Homing-v0")
    start = np.array((*load_world(WORLD).rooms[-1].boundary.mean(axis=0), 1.0))
    with pytest.raises(InputError, match="where the saved map was begun"):
        env.reset(seed=1, options={"start": start})
    env.close()


def test_tours_have_no_saved_map(saved_map):
    with pytest.raises(InputError, match="a task in which the agent drives"):
        make(saved_map, "Albot/PlaceRecognition-v0")
