"""Episodes that are branched: a state goes on to the bit, here, elsewhere and in a batch."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.registry import installed_mappers, mapper_spec
from albot_env.recording.episode import NullRecorder
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core.episode_state import EpisodeState, check_state
from albot_env.tasks.core.observation import PART_NAMES, ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import WorldSet
from tests.env import quick
from tests.env.vector.test_contract import assert_same

CROWD = "random:apartment:1?people=2&boxes=3&doors=2&rooms=4"
"""A world in which everything moves."""
STEPS = 25


def _make(environment: str, **options: Any) -> Any:
    given = {
        "world": quick.LOOP,
        "mapper": "none",
        **quick.SETTINGS.get(environment, {}),
        **options,
    }
    return gymnasium.make(environment, **given).unwrapped


def _actions(env: Any, rng: np.random.Generator, steps: int) -> np.ndarray:
    """Actions by chance that lead ahead, and claim or answer now and then."""
    if isinstance(env.action_space, gymnasium.spaces.Discrete):
        return rng.integers(env.action_space.n, size=steps)
    names = env._interface.robots.actions.names
    low, high = np.full(len(names), -1.0), np.full(len(names), 0.6)
    low[:2], high[:2] = (0.0, -0.6), (1.0, 0.6)
    actions = rng.uniform(low, high, (steps, len(names))).astype(np.float32)
    if "declare" in names:
        actions[:, names.index("declare")] = -1.0  # It would end the episode.
    return actions


def _go_on(env: Any, actions: np.ndarray) -> list[Any]:
    """All that an environment gives for these actions, and in the episode after."""
    seen: list[Any] = []
    for action in actions:
        seen.append(env.step(action))
        if seen[-1][2]:
            break
    return [*seen, env.reset(), env.step(actions[0])]


def _check_branches(environment: str, seed: int, steps: int = STEPS, **options: Any) -> None:
    """Branch an episode at a random step; compare what its branches give, bit for bit."""
    env, other = _make(environment, **options), _make(environment, **options)
    rng = np.random.default_rng(seed)
    other.reset(seed=seed + 1)
    env.reset(seed=seed)
    cut = int(rng.integers(steps)) if environment in quick.DRIVEN else 1
    for action in _actions(env, rng, cut):
        last = env.step(action)
    state = env.get_state()
    assert isinstance(state, EpisodeState) and state.steps == cut
    sent = pickle.loads(pickle.dumps(state))  # noqa: S301
    twin = copy.deepcopy(env)
    observation, info = other.set_state(sent)
    if cut:
        assert_same((observation, info), (last[0], last[4]), "what set_state returns")
    actions = _actions(env, rng, steps)
    expected = _go_on(env, actions)
    assert_same(_go_on(twin, actions), expected, "copy")
    assert_same(_go_on(other, actions), expected, "another environment")
    for _ in range(2):  # Once more, because going on must not change the state.
        env.set_state(state)
        assert_same(_go_on(env, actions), expected, "back")
    for each in (env, twin, other):
        each.close()


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize("seed", range(3))
def test_branches_of_an_episode_are_the_same(environment: str, seed: int) -> None:
    """In a world in which everything moves, with albot1 and both forms of observations."""
    options: dict[str, Any] = {"mapper": "albot1", "observation": ("flat", "dict")[seed % 2]}
    if environment in quick.DRIVEN:
        options["world"] = quick.loaded(CROWD)
    _check_branches(environment, seed, **options)


@pytest.mark.parametrize("mapper", ["none", *installed_mappers()])
def test_they_are_so_with_every_mapper(mapper: str) -> None:
    """In homing, where the way home is observed too."""
    needed = frozenset() if mapper == "none" else mapper_spec(mapper).sensors
    options = {"scenes": "ambiguous"} if "scene" in needed else {}
    options |= {"compass": "clouded"} if "compass" in needed else {}
    _check_branches("Albot/Homing-v0", 4, steps=10, mapper=mapper, **options)


def test_they_are_so_with_every_part_of_observations() -> None:
    """Occupancy grids and the ways over them among these."""
    parts = tuple(part for part in PART_NAMES if part != "time_left")
    config = ExploreConfig(observations=ObservationConfig(parts=parts))
    _check_branches("Albot/ExploreRevealed-v0", 5, mapper="albot1", config=config)
    _check_branches(
        "Albot/ExploreRevealed-v0", 6, mapper="albot1", config=config, action="discrete"
    )


def test_a_state_is_not_changed_when_episodes_go_on() -> None:
    env = _make("Albot/Explore-v0", mapper="albot1", world=quick.loaded(CROWD))
    env.reset(seed=1)
    state = env.get_state()
    before = pickle.dumps(state)
    for action in _actions(env, np.random.default_rng(2), 10):
        env.step(action)
    env.set_state(state)
    for action in _actions(env, np.random.default_rng(2), 10):
        env.step(action)
    assert pickle.dumps(pickle.loads(before)) == pickle.dumps(pickle.loads(pickle.dumps(state)))  # noqa: S301


@pytest.mark.parametrize("environment", quick.IDS)
def test_copies_of_wrapped_environments_count_on(environment: str) -> None:
    """Steps to the time limit, statistics, spaces that draw actions, attributes of others."""
    env: Any = gymnasium.make(
        environment, max_episode_steps=7, **quick.SETTINGS.get(environment, {})
    )
    env = gymnasium.wrappers.RecordEpisodeStatistics(env)
    env.unwrapped.note = ["by its user"]
    env.action_space.seed(3)
    env.reset(seed=2)
    env.step(quick.still(environment))
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):  # noqa: S301
        original = copy.deepcopy(env)
        assert twin.unwrapped.note == ["by its user"]
        assert twin.unwrapped.note is not env.unwrapped.note
        assert (twin.spec.id, twin.spec.max_episode_steps) == (environment, 7)
        assert_same(twin.action_space.sample(), original.action_space.sample())
        for _ in range(6):
            step, other = (
                original.step(quick.still(environment)),
                twin.step(quick.still(environment)),
            )
            for infos in (step[4], other[4]):
                if "episode" in infos:
                    infos["episode"].pop("t")
            assert_same(other, step)
            if step[2]:
                break
        assert step[2] or step[3]


def test_a_copy_before_the_first_reset_begins_alike() -> None:
    env = _make("Albot/Explore-v0")
    twin = copy.copy(env)
    assert_same(twin.reset(seed=1), env.reset(seed=1))
    assert_same(copy.copy(env).reset(), env.reset())
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        copy.deepcopy(env)


def test_a_state_goes_into_a_batch_and_back() -> None:
    """Into any of its environments, without a change of the others."""
    options = {"mapper": "albot1", "world": "random:office:0..3?rooms=3&people=1&boxes=1"}
    env = _make("Albot/Explore-v0", **options)
    batch: Any = gymnasium.make_vec(
        "Albot/Explore-v0", num_envs=3, max_episode_steps=12, autoreset_mode="Disabled", **options
    )
    untouched: Any = copy.deepcopy(batch)
    rng = np.random.default_rng(1)
    env.reset(seed=9)
    assert_same(batch.reset(seed=1), untouched.reset(seed=1))
    for action in _actions(env, rng, 10):
        env.step(action)
    observation, infos = batch.set_state(1, env.get_state())
    assert infos["_pose"].tolist() == [False, True, False]
    assert observation.shape == env.observation_space.shape
    for step, action in enumerate(_actions(env, rng, 2)):
        actions = np.tile(action, (3, 1))
        seen, others, single = batch.step(actions), untouched.step(actions), env.step(action)
        assert_same(seen[0][1], single[0])
        assert_same(seen[1][1], np.float64(single[1]))
        assert_same(seen[0][[0, 2]], others[0][[0, 2]])
        assert seen[3].tolist() == [False, step == 1, False]  # Its twelfth step.
    back = batch.get_state(1)
    batch.reset(options={"reset_mask": np.array([False, True, False])})
    env.set_state(back)
    batch.set_state(2, back)
    with pytest.raises(gymnasium.error.ResetNeeded):  # It was over, and is so again.
        batch.step(np.tile(action, (3, 1)))
    batch.set_state(2, untouched.get_state(2))
    for action in _actions(env, rng, 2):
        env.step(action)
        batch.step(np.tile(action, (3, 1)))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_is_copied_and_pickled(mode: str) -> None:
    batch: Any = gymnasium.make_vec(
        "Albot/Homing-v0",
        num_envs=3,
        max_episode_steps=4,
        autoreset_mode=mode,
        mapper="albot1",
        **quick.SETTINGS["Albot/Homing-v0"],
    )
    batch.reset(seed=1)
    rng = np.random.default_rng(3)
    for _ in range(3):
        batch.step(quick.drawn_actions("Albot/Homing-v0", rng, 3))
    twins = [copy.deepcopy(batch), pickle.loads(pickle.dumps(batch))]  # noqa: S301
    for _ in range(6):
        actions = quick.drawn_actions("Albot/Homing-v0", rng, 3)
        seen = batch.step(actions)
        for twin in twins:
            assert_same(twin.step(actions), seen)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mapper": "odometry"}, "one with mapper none, not odometry"),
        ({"odometer": "poor"}, "one with odometer pioneer, not poor"),
        ({"config": {"claims": False}}, "one with config.claims [Tt]rue, not [Ff]alse"),
        ({"world": quick.loaded("corridor-loop")}, "world 0 .*, found one in square-loop"),
    ],
)
def test_a_state_of_another_environment_is_refused(options: dict[str, Any], message: str) -> None:
    env = _make("Albot/Explore-v0")
    env.reset(seed=1)
    other = _make("Albot/Explore-v0", **options)
    seen = other.reset(seed=2)
    with pytest.raises(InputError, match=f"Albot/Explore-v0, state: expected .*{message}"):
        other.set_state(env.get_state())
    other.step(other.action_space.sample())  # It goes on as if nothing had been.
    assert_same(other.reset(seed=2), seen)


def test_what_is_no_state_is_refused() -> None:
    env, homing = _make("Albot/Explore-v0"), _make("Albot/Homing-v0")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.get_state()
    env.reset(seed=1)
    homing.reset(seed=1)
    with pytest.raises(InputError, match="Task, state: expected a state that get_state returned"):
        check_state({"pose": 3}, "Task", {}, WorldSet([quick.LOOP]))
    with pytest.raises(InputError, match="one with environment Albot/Homing-v0, not Albot/Explore"):
        env.set_state(homing.get_state())
    batch: Any = gymnasium.make_vec("Albot/Explore-v0", num_envs=2, world=quick.LOOP, mapper="none")
    with pytest.raises(gymnasium.error.ResetNeeded):
        batch.get_state(1)
    batch.reset(seed=1)
    with pytest.raises(InputError, match=r"environment: expected .*number below 2, found 2"):
        batch.get_state(2)
    with pytest.raises(InputError, match=r"^Albot/Explore-v0, environment 1, state: expected a st"):
        batch.set_state(1, homing.get_state())


def test_a_state_finds_its_world_in_another_set() -> None:
    """Worlds are the same if all is in the same place, whichever process loaded them."""
    env = _make("Albot/Explore-v0", world=WorldSet(["corridor-loop", "square-loop"]))
    env.reset(seed=1, options={"world": 1})
    state = env.get_state()
    same = _make("Albot/Explore-v0", world=WorldSet(["corridor-loop", "square-loop"]))
    same.set_state(state)
    assert same._robot.world(0) is not state.world
    with pytest.raises(InputError, match=r"state in world 1 of .*, found one in square-loop"):
        _make("Albot/Explore-v0", world="square-loop").set_state(state)


def test_a_picture_begins_anew_with_a_state(tmp_path: Path) -> None:
    env = _make("Albot/Explore-v0", render_mode="rgb_array")
    env.reset(seed=1)
    state = env.get_state()
    for _ in range(3):
        env.step(quick.still("Albot/Explore-v0"))
    assert env.frame.steps == 3
    env.set_state(state)
    assert env.frame.steps == 0
    assert copy.deepcopy(env).render().shape == env.render().shape
    env.recorder = EpisodeWriter(tmp_path / "a.mcap")
    env.reset(seed=1)
    with pytest.raises(InputError, match="expected one episode a file"):
        env.set_state(state)
    # It is at another moment than the recording, which must not go on from there.
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(quick.still("Albot/Explore-v0"))
    assert isinstance(copy.deepcopy(env).recorder, NullRecorder)
    env.close()


def test_a_mapping_of_settings_may_change_afterwards() -> None:
    """As in a loop over values that uses one mapping again."""
    config = {"observations": {"coverage": {"radius": 2.0}}}
    env: Any = gymnasium.make("Albot/Explore-v0", mapper="none", world="square-loop", config=config)
    config["observations"]["coverage"]["radius"] = 4.0
    env.reset(seed=1)
    twin = copy.deepcopy(env)
    assert twin.unwrapped.observation_config.coverage.radius == 2.0
    assert json.loads(env.spec.to_json())["kwargs"]["config"]["observations"]["coverage"] == {
        "radius": 2.0
    }
