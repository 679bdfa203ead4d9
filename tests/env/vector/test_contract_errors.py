"""What a batch says of bad input, and in what state it is afterwards."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import albot_env
import albot_maps
from albot_core.errors import InputError
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import WorldSet

assert albot_env.__doc__  # Importing it registers the environments.
STILL = np.zeros((2, 3), np.float32)


def _batch(**options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    settings = {"world": "square-loop", "mapper": "none", **options}
    return gymnasium.make_vec("Albot/Explore-v0", num_envs=settings.pop("num_envs", 2), **settings)


@pytest.mark.parametrize(
    ("options", "seed", "message"),
    [
        ({"start": 2}, None, r"environment 0, options.start: .*index below"),
        ({"start": (0.0, 0.0, 0.0)}, None, r"environment 0, start: .*clear of the walls"),
        ({"start": (90.0, 90.0, 0.0)}, None, r"environment 0, start: .*can come to"),
        ({"start": True}, None, "environment 0, options.start"),
        ({"world": True}, None, "environment 0, options.world"),
        ({"world": 1}, None, r"environment 0, options.world: .*below 1"),
        ({}, [1, -2], "seed of environment 1: expected a whole number from 0 to .*, found -2"),
        ({}, [1], "2 seeds, found 1"),
        ({}, True, "v0, seed: expected a whole number from 0 to 2¹²⁸ − 1, found True"),
        ({}, 2**128 - 1, "seed of environment 1: .* found one of 129 bits"),
    ],
)
def test_a_reset_that_cannot_be_says_where_and_must_be_made_good(
    options: dict[str, Any], seed: Any, message: str
) -> None:
    env = _batch()
    env.reset(seed=0)
    env.step(STILL)
    with pytest.raises(InputError, match=message):
        env.reset(seed=seed, options=options)
    if seed is None:
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(STILL)
    env.reset(seed=0)
    env.step(STILL)


def test_a_world_that_is_none_is_told_of_its_environment_when_it_is_drawn() -> None:
    env = _batch(world=[WorldSet(["square-loop", "nope"]), "square-loop"])
    with pytest.raises(InputError, match=r"environment 0, .*found nope"):
        env.reset(seed=0, options={"world": 1})
    with pytest.raises(InputError, match=r"world of environment 1, .*found nope"):
        _batch(world=["square-loop", "nope"])


@pytest.mark.parametrize("wrong", [{"sonar": "sonic"}, {"laser": "lms"}, {"mapper": "non"}])
def test_sensors_and_mappers_that_are_none_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"expected (none or )?one of"):
        _batch(**wrong)


def test_episodes_without_steps_are_refused() -> None:
    with pytest.raises(InputError, match="max_episode_steps: expected a whole number from 1"):
        _batch(max_episode_steps=0)


def test_what_cannot_be_observed_is_refused() -> None:
    config = ExploreConfig(observations=ObservationConfig(parts=("sonar",)))
    with pytest.raises(InputError, match="parts: expected a part that robots with these sensors"):
        _batch(sonar="none", config=config)


OTHER_KINDS = """
import gymnasium
from albot_core.errors import InputError
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from albot_env.tasks.homing.task import HomingConfig

def batch(name="Albot/Explore-v0", **settings):
    return gymnasium.make_vec(name, num_envs=2, **{"world": "square-loop", **settings})

for make in (
    lambda: batch(world=3),
    lambda: batch(world=["square-loop", None]),
    lambda: batch(world=[]),
    lambda: batch(config=HomingConfig()),
    lambda: batch(config={"claim": True}),
    lambda: batch(config=ExploreConfig(weights={"coverage": 1})),
    lambda: batch(config=ExploreConfig(observations="x")),
    lambda: batch(config=ExploreConfig(observations=ObservationConfig(sonar=3))),
    lambda: batch("Albot/Homing-v0", config=HomingConfig(outing=None)),
    lambda: batch(movables="yes"),
    lambda: batch(laser=["lms-200"]),
    lambda: batch(world={}),
    lambda: gymnasium.make_vec("Albot/Explore-v0", num_envs="2"),
    lambda: gymnasium.make_vec("Albot/Explore-v0", num_envs=True),
    lambda: batch(max_episode_steps=1.5),
    lambda: batch("Albot/Homing-v0", journeys=1.5),
    lambda: batch().reset(options=5),
    lambda: LaserGeometry(beams=2.5),
    lambda: LaserGeometry(mount=(0.0, 0.0)),
):
    try:
        make()
    except InputError as error:
        print(error)
"""
REFUSED = (
    "environment 0, world: expected a world, a set of worlds, or a spec of them, found 3",
    "environment 1, world: expected a world, a set of worlds, or a spec of them, found None",
    "world: expected 2 worlds, found 0",
    "config: expected ExploreConfig, a mapping of its fields, or None, found HomingConfig(",
    "v0, config.claim: expected one of actions, claims, observations, weights, found claim (did "
    "you mean claims?)",
    "ExploreConfig.weights: expected ExploreWeights, found a dict, {'coverage': 1}",
    "ExploreConfig.observations: expected ObservationConfig, found a str, 'x'",
    "ObservationConfig.sonar: expected SonarGeometry or None, found a int, 3",
    "HomingConfig.outing: expected OutwardJourneyConfig, found a NoneType, None",
    "movables: expected True or False, found 'yes'",
    "laser: expected one of none, ideal, lms-200, lms-200-fine, panoramic, long, short, "
    "found ['lms-200']",
    "environment 0, world: expected a world, a set of worlds, or a spec of them, found {}",
    "make_vec, num_envs: expected a whole number from 1, found 2",
    "make_vec, num_envs: expected a whole number from 1, found True",
    "max_episode_steps: expected a whole number from 1, found 1.5",
    "journeys: expected a whole number from 0, found 1.5",
    "options: expected a mapping, found 5",
    "LaserGeometry.beams: expected a whole number from 2, found 2.5",
    "LaserGeometry.mount: expected three finite numbers",
)


def test_what_is_of_another_kind_is_refused() -> None:
    """In a process where nobody checks types: here the tests do."""
    words = [sys.executable, "-c", "import albot_env" + OTHER_KINDS]
    lines = subprocess.run(words, check=True, capture_output=True, text=True).stdout.splitlines()
    assert len(lines) == len(REFUSED)
    for line, expected in zip(lines, REFUSED, strict=True):
        assert expected in line


def test_a_world_may_be_a_path() -> None:
    path = Path(albot_maps.__file__).parent / "catalogue" / "square-loop.yaml"
    seen = [_batch(world=world).reset(seed=3)[0] for world in ("square-loop", path, [path, path])]
    np.testing.assert_array_equal(seen[0], seen[1])
    np.testing.assert_array_equal(seen[0], seen[2])


def test_closing_lets_the_threads_go() -> None:
    before = set(threading.enumerate())
    env = _batch(num_envs=80, threads=2)
    env.reset(seed=0)
    env.step(np.zeros((80, 3), np.float32))
    assert len(set(threading.enumerate()) - before) == 1
    env.close()
    assert set(threading.enumerate()) <= before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_child_steps_with_threads_of_its_own() -> None:
    env = _batch(num_envs=80, threads=2)
    env.reset(seed=0)
    actions = np.zeros((80, 3), np.float32)
    env.step(actions)
    child = os.fork()
    if child == 0:
        env.step(actions)
        os._exit(7)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 7
    env.close()
