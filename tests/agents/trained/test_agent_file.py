"""Agents' files: whole or refused, whatever somebody else has put into one."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.registry import find_agent, make_agent
from albot_agents.trained.agent_file import AgentFile, TrainingFacts, kept_settings, read_agent
from albot_agents.trained.card import read_evaluation, write_card
from albot_agents.trained.network import NetworkConfig
from albot_agents.training.plan import PolicyPlan, TrainingPlan
from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_env.tasks.homing.task import HomingConfig
from tests.env.quick import STROLL

TASK = "Albot/Homing-v0"
SEEN = ObservationConfig(parts=("laser", "home"), laser_sectors=5, home_range=70.0)
FACTS = TrainingFacts(
    plan=TrainingPlan(task=TASK, policy=PolicyPlan(net_arch=(4,))),
    command="albot train Albot/Homing-v0",
    samples=1000,
    episodes=7,
    seconds=12.0,
    python="3.11",
    machine="here",
    versions={"numpy": "2"},
    curve={"samples": [500.0, 1000.0], "return": [1.0, 2.0], "success_rate": [0.1, 0.6]},
)


def _agent(discrete: bool = False, outputs: int = 3) -> AgentFile:
    network = NetworkConfig(inputs=8, layers=(4,), activation="tanh", outputs=outputs)
    rng = np.random.default_rng(0)
    return AgentFile(
        task=TASK,
        settings={
            "mapper": "odometry",
            "action": "discrete" if discrete else "continuous",
            "config": {"observations": to_plain(SEEN), "actions": {"speed": 0.5}},
        },
        discrete=discrete,
        network=network,
        weights={
            name: rng.normal(size=shape).astype(np.float32)
            for name, shape in network.shapes.items()
        },
        training=FACTS,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """An agent's file."""
    _agent().save(tmp_path / "a.albot")
    return tmp_path / "a.albot"


def test_an_agent_comes_back(path: Path) -> None:
    back, agent = read_agent(path), _agent()
    assert (back.task, back.settings, back.discrete) == (agent.task, agent.settings, False)
    assert (back.network, back.training) == (agent.network, agent.training)
    assert back.observation_config == SEEN
    for name, array in agent.weights.items():
        np.testing.assert_array_equal(back.weights[name], array)
    assert path.stat().st_size < 20_000


@pytest.mark.parametrize("discrete", [False, True])
def test_it_acts_in_the_environment_made_for_it(discrete: bool, tmp_path: Path) -> None:
    file = _agent(discrete, 11 if discrete else 3)
    file.save(tmp_path / "a.albot")
    entry = find_agent(str(tmp_path / "a.albot"))
    made = entry.environment(TASK, {"odometer": "ideal", "config": STROLL, "journeys": 1})
    assert made["mapper"] == "odometry"
    assert isinstance(made["config"], HomingConfig)
    assert made["config"].outing == STROLL.outing
    assert made["config"].actions.speed == 0.5
    env = gymnasium.make(TASK, world="square-loop", **made)
    agent = make_agent(str(tmp_path / "a.albot"), EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 3)
    first = choose_action(agent, observation, info)
    for _ in range(3):
        action = choose_action(agent, observation, info)
        assert action in env.action_space
        observation, *_, info = env.step(action)
    assert isinstance(first, np.int64) == discrete
    parts = env.get_wrapper_attr("observation_config").split(observation)
    assert np.array_equal(agent.act(parts, {}), agent.act(observation, {}))
    env.close()


def test_what_differs_is_said(path: Path) -> None:
    other = ObservationConfig(parts=("laser", "home"), laser_sectors=6, home_range=60.0)
    with pytest.raises(InputError, match=r"home_range 60.0, not 70.0; laser_sectors 6, not 5"):
        make_agent(str(path), EnvironmentConfigs(other, ActionConfig()))
    with pytest.raises(InputError, match=r"actions as in its training, found turn_rate 1.0, not 2"):
        make_agent(str(path), EnvironmentConfigs(SEEN, ActionConfig(speed=0.5, turn_rate=1.0)))
    agent = make_agent(str(path))
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="actions as in its training: 3 numbers, found 2 numbers"):
        agent.reset(rng, Box(-1, 1, (2,), np.float32))
    with pytest.raises(InputError, match="3 numbers, found 11 discrete"):
        agent.reset(rng, Discrete(11))
    agent.reset(rng, Box(-1, 1, (3,), np.float32))


@pytest.mark.parametrize(
    ("observation", "found"),
    [
        (np.zeros(3), r"8 finite numbers, found the shape \(3,\)"),
        (np.zeros((2, 8)), r"8 finite numbers, found the shape \(2, 8\)"),
        (None, r"8 finite numbers, found the shape \(\)"),
        ("left", "8 finite numbers, found 'left'"),
        (np.full(8, np.nan), "8 finite numbers, found NaN or infinity"),
        (
            {"laser": np.zeros(5)},
            r"observations with laser \(5,\), home \(3,\), found laser \(5,\)$",
        ),
        ({"laser": np.zeros(6), "home": np.zeros(2)}, r"found laser \(6,\), home \(2,\)"),
        ({}, "found none of them"),
        ({"laser": [[0.0], [0.0, 1.0]], "home": np.zeros(3)}, "home .*, found {'home'"),
    ],
)
def test_what_is_no_observation_of_its_environment_is_refused(
    path: Path, observation: Any, found: str
) -> None:
    agent = make_agent(str(path), EnvironmentConfigs(SEEN, ActionConfig(speed=0.5)))
    agent.reset(np.random.default_rng(0), Box(-1, 1, (3,), np.float32))
    with pytest.raises(InputError, match=found) as caught:
        agent.act(observation, {})
    assert caught.value.source == str(path)
    assert np.isfinite(agent.act(np.zeros(8), {})).all()


def test_what_it_never_learnt_to_act_with_is_said(path: Path) -> None:
    entry = find_agent(str(path))
    assert (
        entry.untrained_settings({})
        == entry.untrained_settings({"mapper": "odometry", "odometer": "poor"})
        == ()
    )
    assert entry.untrained_settings({"mapper": "none"}) == ("mapper none (trained with odometry)",)
    other = ("mapper_config x.yaml (trained with its default parameters)",)
    assert entry.untrained_settings({"mapper_config": Path("x.yaml")}) == other
    assert find_agent("oracle").untrained_settings({"mapper": "albot1"}) == ()


def test_it_remembers_the_robot_that_it_was_trained_with(tmp_path: Path) -> None:
    kept = kept_settings(TASK, {"mapper": "odometry", "robot": "kobuki"}, SEEN)
    file = replace(_agent(), settings=kept)
    file.save(tmp_path / "a.albot")
    write_card(file, "a", tmp_path / "a.md")
    assert "| robot | `kobuki` |" in (tmp_path / "a.md").read_text()
    assert file.environment(TASK, {})["robot"] == "kobuki"
    assert file.environment(TASK, {"robot": "peoplebot"})["robot"] == "peoplebot"
    entry = find_agent(str(tmp_path / "a.albot"))
    other = ("robot peoplebot (trained with kobuki)",)
    assert entry.untrained_settings({"robot": "peoplebot"}) == other
    assert find_agent("homing").untrained_settings({"robot": "pioneer-3dx"}) == ()


def test_its_mapper_s_thresholds_are_kept_but_not_for_another_mapper() -> None:
    settings = {"mapper": "albot1", "mapper_config": {"view_spacing": 0.5}}
    kept = kept_settings(TASK, settings, ObservationConfig())
    file = replace(_agent(), settings=kept)
    made = file.environment(TASK, {})
    assert made["mapper_config"] == {"view_spacing": 0.5}
    assert "mapper_config" not in file.environment(TASK, {"mapper": "odometry"})


@pytest.mark.parametrize("hints", [True, False])
def test_an_agent_that_was_shown_hints_is_shown_them_again(hints: bool) -> None:
    task = "Albot/ExploreAndHome-v1"
    parts = ("laser", "motion", "home", "way") if hints else ("laser", "motion", "home")
    seen = ObservationConfig(parts=parts)
    config = ExploreAndHomeConfig(observations=seen, hints=hints)
    file = replace(_agent(), task=task, settings=kept_settings(task, {"config": config}, seen))
    for asked in ({}, {"config": ExploreAndHomeConfig(shortest=60.0)}):
        made = file.environment(task, asked)
        assert made["config"].hints == hints
        gymnasium.make(task, world="square-loop", **made).close()


def _npy(array: np.ndarray, *, pickled: bool = False) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=pickled)
    return stream.getvalue()


def _rewrite(path: Path, change: Callable[[dict[str, Any]], None], **members: bytes | None) -> Path:
    """The file with another header, and with members replaced, added or (None) left out."""
    with zipfile.ZipFile(path) as archive:
        content: dict[str, bytes] = {name: archive.read(name) for name in archive.namelist()}
    header = json.loads(content["header.json"])
    change(header)
    content["header.json"] = json.dumps(header).encode()
    for name, new in members.items():
        content.pop(f"{name}.npy", None)
        if new is not None:
            content[f"{name}.npy"] = new
    with zipfile.ZipFile(path, "w") as archive:
        for member, data in content.items():
            archive.writestr(member, data)
    return path


class _Evil:
    """Runs code where it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (pytest.fail, ("a pickle was loaded",))


WEIGHT = "action.weight"


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({WEIGHT: None}, r"action\.weight\.npy: expected the array action\.weight, found none"),
        ({"more": _npy(np.zeros(3, np.float32))}, "more.npy: expected only arrays of the network"),
        ({WEIGHT: _npy(np.zeros((3, 4)))}, r"expected shape \(3, 4\) of float32, found .*float64"),
        ({WEIGHT: _npy(np.zeros((4, 3), np.float32))}, r"expected shape \(3, 4\) of float32"),
        ({WEIGHT: _npy(np.full((3, 4), np.nan, np.float32))}, "expected finite numbers"),
        ({WEIGHT: _npy(np.array([_Evil()]), pickled=True)}, "an array of numbers, found object"),
        ({WEIGHT: b"x"}, r"action\.weight\.npy: expected an array"),
    ],
)
def test_other_arrays_are_refused(
    members: dict[str, bytes | None], message: str, path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        read_agent(_rewrite(path, lambda header: None, **members))


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("version",), 9, "version 1 of the format, found 9"),
        (("format",), "albot-map", "file of a trained agent, found a map that a mapper"),
        (("format",), "else", "expected the file of a trained agent, found a zip archive"),
        (("task",), "Albot/Evil-v0", "task: expected one of"),
        (("task",), 3, "task: expected text"),
        (("extra",), 3, "extra: expected one of"),
        (("discrete",), "yes", "discrete: expected true or false"),
        (("network", "layers"), [4, 4], r"layer1.*: expected the array"),
        (("network", "inputs"), 10**12, "network.inputs: expected a whole number"),
        (
            ("network", "candidates"),
            3,
            "network.inputs: expected at least 2 numbers for each of 3 candidates",
        ),
        (("network", "activation"), "os.system", "network.activation: expected one of"),
        (("settings", "world"), "/etc/passwd", "settings: expected only"),
        (("settings", "mapper"), 3, "settings.mapper: expected text"),
        (("settings", "config", "outing"), {}, "settings.config: expected a mapping with"),
        (("settings", "config", "observations", "home_rng"), 3, "did you mean home_range"),
        (("settings", "config", "observations", "home_range"), -3, "expected a positive number"),
        (("settings", "config", "observations", "laser_sectors"), 6, "observations of 8 numbers"),
        (
            ("settings", "config", "observations"),
            {"coverage": {"patch_cells": 1000}},
            "observations of 8 numbers",
        ),
        (("training", "curve"), {"samples": "x"}, "training.curve.samples: expected a list"),
        (
            ("training", "curve"),
            {"samples": [1.0, 2.0], "return": [1.0]},
            "training.curve: expected lists of one length.*, found 2 in samples, 1 in return",
        ),
        (("training", "curve"), {"samples": [1.0]}, "training.curve: .*, found 1 in samples"),
        (("training", "plan", "n_envs"), -1, "training.plan.n_envs: expected a whole number"),
    ],
)
def test_another_header_is_refused(
    keys: tuple[str, ...], value: Any, message: str, path: Path
) -> None:
    def change(header: dict[str, Any]) -> None:
        for key in keys[:-1]:
            header = header[key]
        header[keys[-1]] = value

    with pytest.raises(InputError, match=message) as caught:
        read_agent(_rewrite(path, change))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@settings(
    deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_a_torn_or_changed_file_is_refused_or_loads_the_same(data: Any, path: Path) -> None:
    _agent().save(path)
    content = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(bytes(content))
    try:
        back = read_agent(path)
    except InputError as error:
        assert "\n" not in str(error)
        return
    np.testing.assert_array_equal(back.weights[WEIGHT], _agent().weights[WEIGHT])


def test_a_card_tells_what_the_file_does(path: Path, tmp_path: Path) -> None:
    figures = {
        "task": TASK, "world_specs": ["random:office"], "seeds": "1000..1099", "episodes": 100,
        "odometer": "poor", "mapper": "odometry", "success_rate": 0.96, "ci95": [0.9, 0.99],
        "spl": None, "precision": 0.995, "recall": 0.9, "fingerprint": read_agent(path).fingerprint,
    }  # fmt: skip
    (tmp_path / "e.json").write_text(json.dumps(figures))
    agent = read_agent(path)
    evaluation = read_evaluation(tmp_path / "e.json", agent)
    card, picture = write_card(agent, "homer", tmp_path / "homer.md", [evaluation])
    text = card.read_text()
    assert text.startswith("# homer\n")
    for words in ("1,000 in 7 episodes", "`albot train Albot/Homing-v0`", "numpy 2", "(homer.png)"):
        assert words in text
    row = "| Albot/Homing-v0 | `random:office` | 1000..1099 | poor | odometry | 100 | 0.960 (0.900"
    assert row in text
    assert "to 0.990) | 0.995 | 0.900 |" in text
    assert "SPL |" not in text
    (tmp_path / "silent.json").write_text(json.dumps(figures | {"precision": None, "recall": 0.0}))
    silent = read_evaluation(tmp_path / "silent.json", agent)
    card, _ = write_card(agent, "homer", tmp_path / "homer.md", [evaluation, silent])
    assert "to 0.990) | – | 0.000 |" in card.read_text()
    assert picture.read_bytes().startswith(b"\x89PNG")
    (tmp_path / "e.json").write_text("[]")
    with pytest.raises(InputError, match="the figures of `albot evaluate`"):
        read_evaluation(tmp_path / "e.json", agent)
    for changed, message in (
        ({"task": None}, "e.json, task: expected text"),
        ({"world_specs": 3}, "e.json, world_specs: expected a list"),
        ({"success_rate": "all"}, "e.json, success_rate: expected a number, found all"),
        ({"ci95": [1]}, "e.json, ci95: expected tuple|e.json, ci95: expected a list"),
    ):
        (tmp_path / "e.json").write_text(json.dumps(figures | changed))
        with pytest.raises(InputError, match=message):
            read_evaluation(tmp_path / "e.json", agent)


def test_a_card_names_no_folder_of_the_machine_that_measured(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ALBOT_DATA", str(tmp_path / "data"))
    agent = read_agent(path)
    specs = [str(tmp_path / "data" / "plans" / "*.xml"), str(tmp_path / "mine.yaml"), "random:hall"]
    figures = {"task": TASK, "world_specs": specs, "seeds": "1", "episodes": 1, "odometer": "poor"}
    figures |= {"mapper": "odometry", "fingerprint": agent.fingerprint, "success_rate": 1.0}
    figures |= {"ci95": [0.2, 1.0], "spl": None, "precision": None, "recall": None}
    (tmp_path / "e.json").write_text(json.dumps(figures))
    evaluation = read_evaluation(tmp_path / "e.json", agent)
    card, _ = write_card(agent, "homer", tmp_path / "homer.md", [evaluation])
    shown = f"| `$ALBOT_DATA/plans/*.xml`, `{tmp_path / 'mine.yaml'}`, `random:hall` |"
    assert shown in card.read_text()


@pytest.mark.parametrize("evaluation", [{"fingerprint": None}, {"fingerprint": "0" * 64}, {}])
def test_the_figures_of_another_agent_are_none_for_a_card(
    path: Path, tmp_path: Path, evaluation: dict[str, str | None]
) -> None:
    (tmp_path / "e.json").write_text(
        json.dumps({"success_rate": 1.0, "agent": "random"} | evaluation)
    )
    with pytest.raises(InputError, match=r"e\.json, fingerprint: .*found those of random"):
        read_evaluation(tmp_path / "e.json", read_agent(path))
