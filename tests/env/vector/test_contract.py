"""What every vectorised environment promises: bit for bit what single ones give."""

from __future__ import annotations

import os
from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import MultiDiscrete
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from albot_core.errors import InputError
from albot_maps import load_worlds
from tests.env import quick

MODES = list(AutoresetMode)
FORMS = ("flat", "dict")
MAPPERS = ("none", "odometry", "albot1")
COUNT = 3
WORLDS = ["square-loop", "random:apartment:1?people=1&boxes=1&doors=1"]
LONG = 10_000 if os.environ.get("ALBOT_LONG_DRIVE") else 1_000


def _settings(environment: str, options: dict[str, Any]) -> dict[str, Any]:
    usual = {"world": quick.LOOP, "mapper": "none", "max_episode_steps": 7}
    return usual | quick.SETTINGS.get(environment, {}) | options


def _vector(environment: str, count: int = COUNT, **options: Any) -> VectorEnv[Any, Any, Any]:
    settings = {"num_envs": count} | _settings(environment, options)
    return gymnasium.make_vec(environment, **settings)


def _singles(environment: str, mode: AutoresetMode, **options: Any) -> SyncVectorEnv[Any, Any]:
    """The same by gymnasium's loop over single environments."""
    settings = _settings(environment, options)
    worlds = settings.pop("world")
    worlds = worlds if isinstance(worlds, list) else [worlds] * COUNT
    return SyncVectorEnv(
        [lambda w=world: gymnasium.make(environment, world=w, **settings) for world in worlds],
        autoreset_mode=mode,
    )


def assert_same(one: Any, other: Any, place: str = "") -> None:
    """Both are the same to the last bit, types included."""
    if isinstance(other, dict):
        assert one.keys() == other.keys(), place
        for key in other:
            assert_same(one[key], other[key], f"{place}/{key}")
    elif isinstance(other, tuple | list):
        assert len(one) == len(other), place
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            assert_same(a, b, f"{place}/{k}")
    elif isinstance(other, np.ndarray) and other.dtype == object:
        assert_same(one.tolist(), other.tolist(), place)
    elif isinstance(other, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape), place
        assert one.tobytes() == other.tobytes(), (place, one, other)
    else:
        assert one == other, place


def _drive(env: VectorEnv[Any, Any, Any], steps: int, seed: Any = 5) -> list[Any]:
    """All that an environment gives in a drive by chance; resets what is over where need be."""
    rng = np.random.default_rng(1)
    seen: list[Any] = [env.reset(seed=seed)]
    for _ in range(steps):
        seen.append(env.step(_drawn(env, rng)))
        over = seen[-1][2] | seen[-1][3]
        if env.metadata["autoreset_mode"] is AutoresetMode.DISABLED and over.any():
            seen.append(env.reset(options={"reset_mask": over}))
    return seen


def _drawn(env: VectorEnv[Any, Any, Any], rng: np.random.Generator) -> np.ndarray:
    """Actions by chance, declarations among them."""
    if isinstance(env.action_space, MultiDiscrete):
        return rng.integers(env.action_space.nvec)
    return rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)


@pytest.mark.parametrize(
    ("environment", "mode", "form", "mapper"),
    [
        (environment, mode, FORMS[(i + j) % len(FORMS)], MAPPERS[(i + j) % len(MAPPERS)])
        for i, environment in enumerate(quick.IDS)
        for j, mode in enumerate(MODES)
    ],
)
def test_a_batch_gives_what_single_environments_give(
    environment: str, mode: AutoresetMode, form: str, mapper: str
) -> None:
    """Whichever two of their settings come together."""
    options = {"mapper": mapper, "observation": form}
    batch = _drive(_vector(environment, autoreset_mode=mode, **options), 16)
    assert_same(batch, _drive(_singles(environment, mode, **options), 16))


@pytest.mark.parametrize("environment", quick.DRIVEN)
def test_it_does_so_for_long_in_worlds_that_change(environment: str) -> None:
    """With contacts, every sensor, things that move, and at each reset another world of a set."""
    options = {
        "world": [
            load_worlds("random:office:0..3?rooms=4"),
            load_worlds("random:apartment:0..1?rooms=3&people=1&boxes=1&doors=1"),
            load_worlds("random:maze:0..2?rows=3&columns=3"),
        ],
        "max_episode_steps": 50,
        "odometer": "carpet",
        "sonar": "poor",
        "scenes": "paper",
        "compass": "clouded",
    }
    batch = _vector(environment, **options)
    singles = _singles(environment, AutoresetMode.NEXT_STEP, **options)
    rng, worlds, bumps = np.random.default_rng(1), set(), 0
    assert_same(batch.reset(seed=[3, 1, 4]), singles.reset(seed=[3, 1, 4]))
    for step in range(LONG):
        if step % 20 == 0:  # Held for a while, so that robots come to the walls.
            actions = quick.drawn_actions(environment, rng, COUNT)
        many = batch.step(actions)
        assert_same(many, singles.step(actions), f"step {step}")
        worlds |= set(many[4]["world"])
        bumps += int(many[4]["collided"].sum())
    assert len(worlds) == 4 + 2 + 3
    assert bumps > 50


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize(
    "options", quick.cycled(world=WORLDS, **quick.SENSORS), ids=lambda made: "-".join(made.values())
)
def test_it_does_so_with_every_sensor(environment: str, options: dict[str, str]) -> None:
    sensors = {**options, "world": quick.loaded(options["world"])}
    batch = _drive(_vector(environment, **sensors), 16)
    assert_same(batch, _drive(_singles(environment, AutoresetMode.NEXT_STEP, **sensors), 16))


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize("mapper", ["none", "albot1"])
def test_threads_change_nothing(environment: str, mapper: str) -> None:
    worlds = load_worlds("random:office:0..1?rooms=4")
    options = {"world": worlds, "mapper": mapper, "max_episode_steps": 20}
    alone = _drive(_vector(environment, 32, threads=1, **options), 30)
    assert_same(alone, _drive(_vector(environment, 32, threads=3, **options), 30))


@pytest.mark.parametrize("environment", quick.IDS)
def test_an_environment_does_not_depend_on_the_others(environment: str) -> None:
    """In a crowd that overlaps all along, each drives as it does alone."""
    count = 40
    crowd = _vector(environment, count, max_episode_steps=30)
    pair = _vector(environment, 2, max_episode_steps=30)
    rng = np.random.default_rng(2)
    crowd.reset(seed=0)
    pair.reset(seed=[7, 39])
    for _ in range(80):
        actions = quick.drawn_actions(environment, rng, count)
        many, few = crowd.step(actions), pair.step(actions[[7, 39]])
        assert_same([part[[7, 39]] for part in many[:4]], list(few[:4]))


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize("form", ["flat", "dict"])
def test_observations_are_inside_and_their_own(environment: str, form: str) -> None:
    env = _vector(environment, observation=form)
    seen = [step[0] for step in _drive(env, 20)]
    assert all(observation in env.observation_space for observation in seen)
    for before, after in pairwise(seen):
        old = before.values() if form == "dict" else [before]
        new = after.values() if form == "dict" else [after]
        assert not any(np.shares_memory(a, b) for a, b in zip(old, new, strict=True))


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((2, 2)), r"action: .* for each of 3, found shape \(2, \d\)"),
        (np.array([[0, 0], [0, np.nan], [2, 0]]), r"action of environment 1: .*nan"),
        (np.array([[0, 0], [0, 0], [2, -np.inf]]), r"action of environment 2: .*\[2.0, -inf"),
        ("fast", "action: .*fast"),
    ],
)
def test_actions_that_are_none_are_refused(environment: str, actions: Any, message: str) -> None:
    env = _vector(environment)
    env.reset(seed=1)
    if isinstance(actions, np.ndarray):
        silent = quick.still(environment, len(actions))[:, 2:]
        actions = np.concatenate((actions, silent), axis=1)
    with pytest.raises(InputError, match=message):
        env.step(actions)


@pytest.mark.parametrize("environment", quick.DRIVEN)
def test_numbers_beyond_the_limits_count_as_in_the_single_form(environment: str) -> None:
    env = _vector(environment)
    single = gymnasium.make(environment, **_settings(environment, {}))
    env.reset(seed=[4, 5, 4])
    single.reset(seed=4)
    some = np.array([[1.0000001, -9, -1], [0, 0, 0], [1, -1, -7.5]])
    actions = quick.saying(environment, some)
    observations, rewards, *_ = env.step(actions)
    np.testing.assert_array_equal(observations[0], observations[2])
    alone, reward, *_ = single.step(actions[2])
    np.testing.assert_array_equal(alone, observations[0])
    assert reward == rewards[0] == rewards[2]


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"world": ["office-ring"]}, "world: expected 3 worlds, found 1"),
        ({"autoreset_mode": "Sometimes"}, "autoreset_mode: expected one of NextStep"),
        ({"num_treads": 1}, "expected settings among"),
        ({"thread": 1}, r"found .* 'thread' \(did you mean threads\?\)"),
        ({"render_mode": "human"}, "render_mode: expected rgb_array or None; .*found human"),
        ({"threads": 0}, "threads: expected a whole number from 1, or None, found 0"),
        ({"num_envs": 0}, "make_vec, num_envs: expected a whole number from 1, found 0"),
        *quick.UNKNOWN,
    ],
)
def test_settings_that_are_none_are_refused(
    environment: str, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        _vector(environment, **options)


@pytest.mark.parametrize("environment", quick.IDS)
@pytest.mark.parametrize(
    ("call", "message"),
    [
        ({"seed": [1, 2]}, "seed: expected 3 seeds, found 2"),
        ({"options": {"reset_mask": [True]}}, "reset_mask: expected an array of 3 bool"),
        ({"options": {"reset_mask": np.zeros(3, bool)}}, "reset_mask: .* found none true"),
        ({"options": {"place": 1}}, "environment 0, options: .* found place"),
        ({"options": {"start": 99}}, "environment 0, options.start"),
    ],
)
def test_resets_that_are_none_are_refused(
    environment: str, call: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        _vector(environment).reset(**call)


@pytest.mark.parametrize("environment", quick.IDS)
def test_stepping_what_has_not_begun_or_is_over_or_closed_is_an_error(environment: str) -> None:
    env = _vector(environment, autoreset_mode="Disabled", max_episode_steps=1)
    nothing = quick.still(environment, COUNT)
    with pytest.raises(gymnasium.error.ResetNeeded, match="before the first step"):
        env.step(nothing)
    env.reset(seed=1, options={"start": 0})
    env.step(nothing)
    env.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(gymnasium.error.ResetNeeded, match="environment 1 is over"):
        env.step(nothing)
    env.close()
    for go_on in (env.reset, lambda: env.step(nothing)):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="is closed"):
            go_on()
