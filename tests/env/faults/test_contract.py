"""What every fault keeps to in environments."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from albot_core.errors import InputError
from albot_env.export.replay import replay
from albot_env.faults.registry import FAULTS
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering.page.events import EventFinder
from tests.env.quick import SETTINGS, STROLL

NAMES = sorted(FAULTS)
STEPS, SEED = 45, 3
WORLD = "random:office:5"
EXPLORE = "Albot/Explore-v0"
Row = tuple[np.ndarray, dict[str, Any]]


def _spec(name: str) -> str:
    """A fault that strikes after two seconds, and is over before the end if it can be."""
    lasts = "lasting" in FAULTS[name].__dataclass_fields__
    return f"{name}:at=2s" + (",lasting=1s" if lasts else "")


def _action(shape: tuple[int, ...] | None, step: int) -> np.ndarray:
    action = np.full(shape or (), -1.0, np.float32)
    action[:2] = 1.0, 0.6 * np.sin(step / 8)
    return action


def _make(faults: str | None, **settings: Any) -> gymnasium.Env[Any, Any]:
    settings = {"world": WORLD, "mapper": "albot1", **settings}
    return gymnasium.make(EXPLORE, faults=faults, disable_env_checker=True, **settings)


def _drive(env: gymnasium.Env[Any, Any], steps: range = range(STEPS)) -> Iterator[Row]:
    for step in steps:
        observation, reward, _, _, info = env.step(_action(env.action_space.shape, step))
        yield np.array((*observation, reward)), info


@cache
def _episode(faults: str | None) -> list[Row]:
    env = _make(faults)
    observation, info = env.reset(seed=SEED)
    rows = [(np.array((*observation, 0.0)), info), *_drive(env)]
    env.close()
    return rows


@pytest.mark.parametrize("name", NAMES)
def test_the_episode_is_the_same_until_the_fault_strikes(name: str) -> None:
    with_it, without = _episode(_spec(name)), _episode(None)
    struck = [bool(info["faults_struck"]) for _, info in with_it]
    first = struck.index(True)
    assert first == 20
    for (mine, info), (its, other) in zip(with_it[:first], without[:first], strict=True):
        assert np.array_equal(mine, its)
        assert info["fault"] == "" and info["pose"].tobytes() == other["pose"].tobytes()
    assert name in with_it[first][1]["fault"].split("+")
    assert with_it[-1][1]["fault"] == ""
    assert (
        with_it[0][1].keys()
        == with_it[-1][1].keys()
        == without[0][1].keys()
        | {
            "fault",
            "faults_struck",
        }
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_batch_does_as_the_single_environment(name: str) -> None:
    expected = _episode(_spec(name))
    settings = {"world": WORLD, "mapper": "albot1", "faults": _spec(name)}
    batch = gymnasium.make_vec(EXPLORE, num_envs=3, threads=2, **settings)
    observations, infos = batch.reset(seed=[1, SEED, 2])
    for step in range(STEPS):
        mine, info = expected[step]
        assert np.array_equal(observations[1], mine[:-1])
        assert infos["fault"][1] == info["fault"]
        assert infos["pose"][1].tobytes() == info["pose"].tobytes()
        actions = np.tile(_action(batch.single_action_space.shape, step), (3, 1))
        observations, rewards, _, _, infos = batch.step(actions)
        assert rewards[1] == expected[step + 1][0][-1]
    batch.close()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cut", [10, 22])
def test_a_state_continues_to_the_bit(name: str, cut: int) -> None:
    expected = _episode(_spec(name))
    env, other = _make(_spec(name)), _make(_spec(name))
    env.reset(seed=SEED)
    list(_drive(env, range(cut)))
    state = env.get_wrapper_attr("get_state")()
    observation, _ = other.unwrapped.set_state(state)  # type: ignore[attr-defined]
    assert np.array_equal(observation, expected[cut][0][:-1])
    for step in range(cut, STEPS):
        observation, reward, _, _, info = other.unwrapped.step(
            _action(other.action_space.shape, step)
        )
        assert np.array_equal(np.array((*observation, reward)), expected[step + 1][0])
        assert info["fault"] == expected[step + 1][1]["fault"]
    env.close()
    other.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_recording_replays_and_shows_the_fault(name: str, tmp_path: Path) -> None:
    path = tmp_path / "episode.mcap"
    env = _make(_spec(name))
    env.unwrapped.recorder = EpisodeWriter(path)  # type: ignore[attr-defined]
    env.reset(seed=SEED)
    list(_drive(env))
    env.close()
    replay(EpisodeReader(path), path)  # To the bit, or it is refused.
    finder = EventFinder()
    events = [event for moment in EpisodeReader(path).moments() for event in finder.add(moment)]
    told = [event for event in events if event.kind == "fault"]
    assert told[0].step == 20 and name.replace("-", " ") in told[0].text
    assert told[-1].text.endswith("is over")


@pytest.mark.parametrize("name", ["kidnap", "turned", "door-shut"])
def test_a_robot_that_stands_still_is_not_paid_for_where_a_fault_puts_it(name: str) -> None:
    """Nor for what it does to the way home: only `time` passes."""
    env = _make_homing(f"{name}:at=1s")
    for seed in range(3):
        _, info = env.reset(seed=seed)
        for _ in range(15):
            info = env.step(np.array((-1, 0, -1), np.float32))[4]
            for term in ("progress", "facing"):  # It still rolls a little in its first steps.
                assert info["reward_terms"][term] == pytest.approx(0.0, abs=1e-2)
        assert info["faults_struck"] == 1
    env.close()


def _make_homing(faults: str) -> gymnasium.Env[Any, Any]:
    settings = {"config": STROLL, "journeys": 1, "mapper": "none"}
    return gymnasium.make("Albot/Homing-v0", world="random:office:3?doors=2", faults=faults,
                          **settings)  # fmt: skip


@pytest.mark.parametrize("environment", sorted(SETTINGS))
def test_every_environment_takes_faults(environment: str) -> None:
    spec = "odometer-jump:at=0s,length=2m"
    env = gymnasium.make(
        environment, faults=spec, disable_env_checker=True, **SETTINGS[environment]
    )
    _, info = env.reset(seed=1)
    for _ in range(2):
        info = env.step(
            np.full_like(env.action_space.sample(), -1 if env.action_space.shape else 0)
        )[4]
    assert info["faults_struck"] == 1
    assert info["position_error"] > 1.0
    env.close()


def test_the_spec_of_an_environment_holds_the_faults_as_text() -> None:
    faults = [FAULTS["laser-dropout"](), "odometer-jump:at=3m"]
    env = _make(faults)  # type: ignore[arg-type]
    assert env.unwrapped.spec is not None
    spec = EnvSpec.from_json(env.unwrapped.spec.to_json())
    assert spec.kwargs["faults"] == "laser-dropout+odometer-jump:at=3m"
    env.close()


def test_a_robot_without_the_sensor_is_refused() -> None:
    with pytest.raises(InputError, match="sonar, which saturated-sonars needs, of the robot"):
        _make("saturated-sonars", sonar="none")
    with pytest.raises(InputError, match="did you mean laser-dropout"):
        _make("laser-dropot")


def test_states_of_other_faults_are_refused() -> None:
    env, other = _make("laser-dropout"), _make(None)
    env.reset(seed=1)
    state = env.get_wrapper_attr("get_state")()
    with pytest.raises(InputError, match="faults laser-dropout"):
        other.unwrapped.set_state(state)  # type: ignore[attr-defined]
    env.close()
    other.close()
