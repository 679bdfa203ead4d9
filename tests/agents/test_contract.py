"""What every agent promises, in every environment."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_agents.agent import Agent, EnvironmentConfigs, begin_episode, choose_action
from albot_agents.registry import AGENTS, agent_names, check_agent, find_agent, make_agent
from albot_agents.task import config_kind, task_names
from albot_core.errors import InputError
from albot_env.tasks.core.parts.matches import MATCHES
from tests.env.quick import DRIVEN, IDS, JUDGED, LOOP, SETTINGS

JUDGES = {"decision-stump", "place-judge", "place-recognition"}
"""Those who judge places and drive nothing."""
DRIVERS = [
    (name, task)
    for task in DRIVEN
    for name in AGENTS
    if task in AGENTS[name].tasks and name != "random"
]
"""Scripted agents that give commands, and their tasks."""
WHO_ACTS_WHERE = [(name, task) for task in IDS for name in agent_names(task)]


def _begun(name: str, environment: str, form: str = "flat") -> tuple[Agent, Any]:
    entry = find_agent(name)
    settings = {"world": LOOP, "mapper": "odometry", "observation": form}
    hears_only = entry.environment(environment, {}).get("laser") == "none"
    chosen = entry.file is not None or entry.observations is not None
    sees_matches = chosen and entry.configs.observations.observes(MATCHES)
    if hears_only or sees_matches:  # An odometer has neither exits nor matches.
        settings["mapper"] = entry.mapper
    wanted = {**settings, **SETTINGS.get(environment, {})}
    if name == "place-recognition":
        wanted["config"] = None  # It was trained with longer tours.
    env = gymnasium.make(environment, **entry.environment(environment, wanted))
    return make_agent(name, EnvironmentConfigs.of(env)), env


def _actions(agent: Agent, env: Any, seed: int, steps: int = 50) -> list[Any]:
    observation, info = begin_episode(env, agent, seed)
    actions = []
    for _ in range(steps):
        actions.append(choose_action(agent, observation, info))
        assert actions[-1] in env.action_space
        observation, _, over, _, info = env.step(actions[-1])
        if over:
            break
    return actions


@cache
def _fresh_actions(name: str, environment: str) -> list[Any]:
    """The actions of an agent in its first episode."""
    return _actions(*_begun(name, environment), 1)


class _Watched(dict[str, Any]):
    """An observation by part that keeps the names of the parts that were looked at."""

    def __init__(self, parts: Any, looked_at: set[str]) -> None:
        super().__init__(parts)
        self._looked_at = looked_at

    def __getitem__(self, part: str) -> Any:
        self._looked_at.add(part)
        return super().__getitem__(part)


@pytest.mark.parametrize(("name", "task"), DRIVERS)
def test_an_agent_looks_at_no_other_parts_than_it_says(name: str, task: str) -> None:
    """Else it could not be shown them where a learner observes less."""
    agent, env = _begun(name, task, "dict")
    observation, info = begin_episode(env, agent, 0)
    looked_at: set[str] = set()
    for _ in range(20):
        action = choose_action(agent, _Watched(observation, looked_at), info)
        observation, _, over, _, info = env.step(action)
        if over:
            break
    assert looked_at
    assert looked_at <= set(AGENTS[name].uses)


@pytest.mark.parametrize(("name", "task"), DRIVERS)
def test_an_agent_drives_as_fast_whatever_its_actions_stand_for(name: str, task: str) -> None:
    """Its commands are in m/s and rad/s: only where they exceed an action's limit are they cut."""
    usual = _driven(name, task)
    if name != "oracle":  # It drives and turns as fast as its actions let it.
        doubled = _driven(name, task, speed=2.0, turn_rate=4.0)
        np.testing.assert_allclose(doubled, usual, atol=1e-3)
    slow, fast = _speeds(_driven(name, task, speed=0.25)), _speeds(usual)
    assert slow.max() < 0.26
    assert np.quantile(slow, 0.9) > 0.96 * min(np.quantile(fast, 0.9), 0.25)
    if "onward" in find_agent(name).uses:
        # What that leads to depends on what was seen so far, so the slow one goes another way.
        _check_same_commands(name, task, speed=0.25)
    else:
        assert slow.sum() > 0.8 * np.minimum(fast, 0.25).sum()


@pytest.mark.parametrize(("name", "task"), DRIVERS)
def test_an_agent_drives_about_as_far_by_discrete_actions(name: str, task: str) -> None:
    both = _driven(name, task), _driven(name, task, "discrete")
    usual, discrete = (0.1 * _speeds(poses).sum() for poses in both)
    assert 0.4 * usual - 0.2 < discrete < 1.6 * usual + 0.2


def _check_same_commands(name: str, task: str, speed: float) -> None:
    """Check that of the same observations an agent makes the same commands, cut at a speed."""
    agent, env = _begun(name, task, "flat")
    told = EnvironmentConfigs.of(env)
    limited = told._replace(actions=replace(told.actions, speed=speed))
    slow = make_agent(name, limited)
    slow.reset(np.random.default_rng((0, 1)), env.action_space)
    observation, info = begin_episode(env, agent, 0)
    for _ in range(150):
        action = choose_action(agent, observation, info)
        other = choose_action(slow, observation, info)
        wanted, given = action[0] * told.actions.speed, other[0] * speed
        assert given == pytest.approx(np.clip(wanted, -speed, speed), abs=1e-6)
        assert other[1:] == pytest.approx(action[1:], abs=1e-6)
        observation, _, over, _, info = env.step(action)
        if over:
            break
    env.close()


def _speeds(poses: np.ndarray) -> np.ndarray:
    """How fast the robot is from step to step (m/s)."""
    return np.asarray(np.hypot(*np.diff(poses[:, :2], axis=0).T) / 0.1)


@cache
def _driven(name: str, task: str, form: str = "continuous", **scales: float) -> np.ndarray:
    """The poses (steps, 3) of an agent that drives for fifteen seconds."""
    entry, settings = find_agent(name), {"world": LOOP, "action": form, **SETTINGS.get(task, {})}
    config = settings.get("config") or config_kind(task)()
    settings["config"] = replace(config, actions=replace(config.actions, **scales))
    env = gymnasium.make(task, **entry.environment(task, settings))
    agent = make_agent(name, EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 3)
    poses = [info["pose"]]
    for _ in range(150):
        action = choose_action(agent, observation, info)
        assert action in env.action_space
        observation, _, over, _, info = env.step(action)
        poses.append(info["pose"])
        if over:
            break
    env.close()
    return np.array(poses)


def test_the_agents_are_these() -> None:
    assert tuple(AGENTS) == (
        "albot0-homing",
        "albot1-homing",
        "association-explorer",
        "association-homing",
        "decision-stump",
        "explore-and-home",
        "gap-explorer",
        "hint-follower",
        "home-vector",
        "map-homing",
        "nearest-frontier",
        "onward-follower",
        "onward-round-trip",
        "oracle",
        "path-integration",
        "patch-homing",
        "place-judge",
        "random",
        "ratslam-explorer",
        "ratslam-homing",
        "round-trip",
        "sahabot-homing",
    )


@pytest.mark.parametrize("name", agent_names())
def test_an_agent_is_found_by_its_name(name: str) -> None:
    agent = make_agent(name)
    assert isinstance(agent, Agent)
    assert agent.name == name
    assert make_agent(name) is not agent
    assert find_agent(name).summary.endswith(".")


def test_who_may_act_in_a_revealed_twin_takes_what_it_shows() -> None:
    twins = [task for task in task_names() if "Revealed" in task]
    assert len(twins) >= 9
    for twin in twins:
        for name in agent_names(twin):
            settings = find_agent(name).environment(
                twin, SETTINGS.get(twin.replace("Revealed", ""), {})
            )
            env = gymnasium.make(twin, disable_env_checker=True, **settings)
            agent = make_agent(name, EnvironmentConfigs.of(env))
            if name == agent_names(twin)[-1]:  # One is enough, and an episode takes a second.
                observation, info = begin_episode(env, agent, 1)
                assert env.action_space.contains(choose_action(agent, observation, info))
            env.close()
    with pytest.raises(InputError, match="found homing, which is for Albot/Homing-v0"):
        check_agent("homing", "Albot/HomingRevealed-v0")


def test_only_the_oracle_knows_the_truth() -> None:
    assert [name for name in agent_names() if make_agent(name).knows_truth] == ["oracle"]


@pytest.mark.parametrize("name", agent_names())
def test_who_does_not_know_the_truth_is_not_shown_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent, shown = make_agent(name), []

    def act(observation: Any, info: Any) -> Any:
        shown.append(dict(info))
        return np.zeros(2, np.float32)

    monkeypatch.setattr(agent, "act", act)
    choose_action(agent, None, {"pose": 1})
    assert shown == [{"pose": 1} if name == "oracle" else {}]


def test_an_agent_that_cannot_do_a_task_is_refused() -> None:
    check_agent("random", "Albot/PlaceRecognition-v0")
    with pytest.raises(
        InputError, match=r"one for Albot/Homing-v0: albot0-homing, albot1-homing, .*place-judge"
    ):
        check_agent("place-judge", "Albot/Homing-v0")


@pytest.mark.parametrize(
    ("name", "task", "others"),
    [
        # They never declare.
        (
            "gap-explorer",
            "Albot/Homing-v0",
            "albot0-homing, albot1-homing, association-homing, hint-follower, home-vector, "
            "map-homing, oracle, ",
        ),
        (
            "nearest-frontier",
            "Albot/ExploreAndHome-v1",
            "explore-and-home, onward-round-trip, random, round-trip",
        ),
        # At the start they are at home, and stay.
        (
            "albot1-homing",
            "Albot/ExploreAndHome-v1",
            "explore-and-home, onward-round-trip, random, round-trip",
        ),
        (
            "oracle",
            "Albot/Explore-v0",
            "association-explorer, gap-explorer, nearest-frontier, onward-follower, random, "
            "ratslam-explorer, exploring",
        ),
    ],
)
def test_who_never_does_what_a_task_asks_is_refused_with_those_who_may(
    name: str, task: str, others: str
) -> None:
    with pytest.raises(InputError, match=f"one for {task}: {others}.* found {name}, which is for"):
        check_agent(name, task)


def test_an_unknown_agent_is_refused_with_a_hint() -> None:
    with pytest.raises(InputError, match=r"gap_explorer.*did you mean gap-explorer"):
        make_agent("gap_explorer")


def test_an_empty_name_is_not_the_current_folder() -> None:
    with pytest.raises(InputError, match=r"agent: expected one of .* found nothing"):
        find_agent("")


@pytest.mark.parametrize(("name", "environment"), WHO_ACTS_WHERE)
def test_actions_are_actions_whichever_form_observations_have(name: str, environment: str) -> None:
    parts = _actions(*_begun(name, environment, "dict"), 1, 40)
    assert np.array_equal(_fresh_actions(name, environment)[:40], parts)


@pytest.mark.parametrize(("name", "environment"), WHO_ACTS_WHERE)
def test_a_reset_forgets_everything(name: str, environment: str) -> None:
    agent, env = _begun(name, environment)
    first = _fresh_actions(name, environment)
    other = _actions(agent, env, 2)
    done = name in JUDGES  # By what they see, which may well be the same.
    if not done:
        done = not np.any([np.ravel(action)[:2] for action in first])  # Nothing is left to do.
    # Who knows the truth does not mind the noise.
    assert done or agent.knows_truth or not np.array_equal(first, other)
    assert np.array_equal(first, _actions(agent, env, 1))


@pytest.mark.parametrize(
    ("name", "environment"), [("gap-explorer", JUDGED[0]), ("place-judge", DRIVEN[0])]
)
def test_who_cannot_act_somewhere_says_so(name: str, environment: str) -> None:
    with pytest.raises(InputError, match=f"{name}: expected observations with the part"):
        _actions(*_begun(name, environment), 1)
