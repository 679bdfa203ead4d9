"""Robots without a laser: what they lack, and what stays as it is."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from click.testing import CliRunner
from gymnasium.utils.env_checker import check_env

from albot_agents.agent import EnvironmentConfigs
from albot_agents.registry import agent_names, make_agent
from albot_cli.group import albot
from albot_core.errors import InputError
from albot_env.recording.reader import EpisodeReader
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from tests.env import quick

GROUND = {"laser", "shortcut", "path", "coverage", "frontier", "onward"}


def make(environment: str, **options: Any) -> gymnasium.Env[Any, Any]:
    settings = {"world": quick.LOOP, "mapper": "none", **quick.SETTINGS.get(environment, {})}
    return gymnasium.make(environment, **settings, **options)


@pytest.mark.parametrize("environment", quick.DRIVEN)
@pytest.mark.parametrize("observation", ["flat", "dict"])
def test_they_pass_gymnasiums_checker(environment: str, observation: str) -> None:
    env = make(environment, laser="none", observation=observation)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("environment", quick.DRIVEN)
def test_they_are_shown_what_others_are_but_for_what_a_laser_sees(environment: str) -> None:
    """The truth, its rewards and its infos are the same; so are sonars and odometer."""
    envs = [make(environment, laser=laser, observation="dict") for laser in ("lms-200", "none")]
    first = [env.reset(seed=4) for env in envs]
    actions = quick.drawn_actions(environment, np.random.default_rng(2), 40)
    steps = [first, *([env.step(action) for env in envs] for action in actions)]
    for with_laser, without in steps:
        assert set(with_laser[0]) - set(without[0]) == GROUND & set(with_laser[0])
        for part, shown in without[0].items():
            np.testing.assert_array_equal(shown, with_laser[0][part], err_msg=part)
        assert without[1:-1] == with_laser[1:-1]
        for name, fact in without[-1].items():
            np.testing.assert_equal(fact, with_laser[-1][name], err_msg=name)


@pytest.mark.parametrize("environment", quick.DRIVEN)
def test_a_batch_is_as_many_single_ones(environment: str) -> None:
    settings = {"world": quick.LOOP, "mapper": "none", "laser": "none"}
    settings |= quick.SETTINGS.get(environment, {})
    batch = gymnasium.make_vec(environment, num_envs=2, **settings)
    singles = [gymnasium.make(environment, **settings) for _ in range(2)]
    seen, _ = batch.reset(seed=[5, 6])
    alone = [env.reset(seed=seed)[0] for env, seed in zip(singles, (5, 6), strict=True)]
    np.testing.assert_array_equal(seen, alone)
    for actions in quick.drawn_actions(environment, np.random.default_rng(1), 30, 2):
        seen = batch.step(actions)[0]
        alone = [env.step(action)[0] for env, action in zip(singles, actions, strict=True)]
        np.testing.assert_array_equal(seen, alone)


def test_an_episode_of_one_is_recorded_and_played(tmp_path: Path) -> None:
    words = ["play", "--agent", "random", "--mapper", "none", "--laser", "none", "--headless"]
    files = [
        "--steps",
        "20",
        "--record",
        str(tmp_path / "a.mcap"),
        "--png",
        str(tmp_path / "a.png"),
    ]
    done = CliRunner().invoke(albot, [*words, "--world", "square-loop", *files, "--json"])
    assert done.exit_code == 0, done.output
    reader = EpisodeReader(tmp_path / "a.mcap")
    assert reader.header.laser is None
    moments = list(reader.moments())
    assert len(moments) == 21
    assert all(moment.reading.laser is None for moment in moments)
    assert moments[0].reading.sonar is not None


def test_mappers_and_agents_that_need_one_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="albot1, which needs laser"):
        gymnasium.make("Albot/Explore-v0", laser="none", mapper="albot1")
    env = make("Albot/Explore-v0", laser="none")
    configs = EnvironmentConfigs.of(env)
    for name in ("gap-explorer", "nearest-frontier"):
        assert name in agent_names("Albot/Explore-v0")
        with pytest.raises(InputError, match=f"{name}: expected observations with the part laser"):
            make_agent(name, configs)


def test_places_are_recognised_by_laser_alone() -> None:
    with pytest.raises(InputError, match="PlaceRecognition-v0, laser: expected a laser"):
        make("Albot/PlaceRecognition-v0", laser="none")


def test_only_what_a_laser_shows_is_nothing_to_observe() -> None:
    config = ExploreConfig(observations=ObservationConfig(parts=("laser", "coverage")))
    with pytest.raises(InputError, match="a part that robots with these sensors have"):
        make("Albot/Explore-v0", laser="none", config=config)
