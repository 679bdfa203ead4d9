"""Agents that drive home: where they succeed, where they do not, and that they touch nothing."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box

from albot_agents.agent import EnvironmentConfigs, begin_episode, choose_action
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_agents.registry import make_agent
from albot_agents.scripted.homing import Albot0Homing
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.planning.navigator import GoalSeeker
from albot_core.planning.percept import Percept
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import RayCaster
from albot_env.tasks.core.actions import DeclaringActionConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.beliefs import observe_home
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from tests.env.quick import IDS

OUT = HomingConfig(outing=OutwardJourneyConfig(shortest=6.0, longest=6.0, away=3.0))


def _home(agent: str, world: str, **settings: Any) -> Outcome:
    made = {"mapper": "none", "config": OUT, "max_episode_steps": 400, **settings}
    return run_trial(Trial(task="Albot/Homing-v0", agent=agent, world=world, seed=3, settings=made))


@pytest.mark.parametrize("world", ["office-ring", "random:apartment:3"])
def test_the_oracle_drives_the_shortest_way(world: str) -> None:
    outcome = _home("oracle", world)
    assert outcome.info["is_success"]
    assert outcome.info["spl"] > 0.98
    assert outcome.collisions <= 1  # The shortest path touches corners.


def test_path_integration_comes_home_by_a_true_odometer_and_not_by_a_bad_one() -> None:
    true = _home("path-integration", "office-ring", odometer="ideal")
    bad = _home("path-integration", "office-ring", odometer="bias-6")
    assert true.info["is_success"]
    assert true.info["spl"] > 0.6
    assert not bad.info["is_success"]
    assert true.collisions == bad.collisions == 0


def test_path_integration_looks_at_the_belief_only_once() -> None:
    """What a mapper makes of it later does not matter: two agents, one told nonsense."""
    from albot_agents.registry import make_agent
    from albot_env.tasks.homing.env import HomingEnv

    env = HomingEnv("square-loop", mapper="none", config=OUT, observation="dict", sonar="none")
    actions = []
    for nonsense in (False, True):
        agent = make_agent("path-integration", EnvironmentConfigs.of(env))
        agent.reset(np.random.default_rng(0), env.action_space)  # type: ignore[arg-type]
        observation, _ = env.reset(seed=1)
        for _ in range(20):
            actions.append(agent.act(observation, {}))
            observation = dict(env.step(actions[-1])[0])  # type: ignore[arg-type]
            if nonsense:
                observation["home"] = -observation["home"]
    assert np.array_equal(actions[:20], actions[20:])


def test_an_approach_finds_its_way_out_of_a_bag() -> None:
    """The target lies behind the bottom of a bag that is open behind the robot."""
    walls = np.array(
        ((3, -1.5, 3, 1.5), (3, 1.5, 0, 1.5), (3, -1.5, 0, -1.5),
         (-6, -6, 9, -6), (9, -6, 9, 6), (9, 6, -6, 6), (-6, 6, -6, -6)), float,
    )  # fmt: skip
    laser, target = LaserGeometry(), np.array((6.0, 0.0))
    caster, pose, motion = RayCaster(walls, laser), np.zeros(3), np.zeros(3)
    seeker = GoalSeeker()
    seeker.reset(np.random.default_rng(2))
    for _ in range(3000):
        percept = Percept(ranges=caster.scan(pose), laser=laser, pose=pose, motion=motion)
        seen = transform_points(inverse(pose), target)
        if np.hypot(*seen) < 0.3:
            break
        speed, turn = seeker.command(percept, seen)
        motion = np.array((0.1 * speed, 0.0, 0.1 * turn))
        pose = compose(pose, motion)
        assert caster.scan(pose).min() > 0.2
    assert np.hypot(*(target - pose[:2])) < 0.3


assert "Albot/Homing-v0" in IDS


def _come_home(world: Any, seed: int, **outing: float) -> dict[str, Any]:
    config = HomingConfig(outing=OutwardJourneyConfig(**outing))
    env = gymnasium.make("Albot/Homing-v0", world=world, config=config, max_episode_steps=900)
    agent = make_agent("albot1-homing", EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, seed)
    over = False
    while not over:
        action = choose_action(agent, observation, info)
        observation, _, ended, cut, info = env.step(action)
        over = ended or cut
    return dict(info)


def test_it_comes_home_from_another_room_without_touching_anything() -> None:
    info = _come_home("random:office:3?rooms=4", 3, shortest=12.0, longest=16.0, away=3.0)
    assert info["is_success"]
    assert info["spl"] > 0.5
    assert not info["collided"]


def test_where_no_way_is_shown_it_makes_straight_for_home() -> None:
    outing = OutwardJourneyConfig(shortest=0.0, longest=0.0, away=0.0)
    config = HomingConfig(outing=outing, observations=ObservationConfig())
    env = gymnasium.make("Albot/Homing-v0", world="square-loop", mapper="odometry", config=config)
    agent = make_agent("albot1-homing", EnvironmentConfigs.of(env))
    observation, info = begin_episode(env, agent, 1)
    assert np.array_equal(choose_action(agent, observation, info), [0, 0, 1])


@pytest.mark.parametrize(
    ("distance", "has_exit", "declares"),
    [(0.2, False, True), (0.2, True, False), (3.0, False, False), (3.0, True, False)],
)
def test_albot0_declares_home_near_its_beginning_in_its_own_asr_alone(
    distance: float, has_exit: bool, declares: bool
) -> None:
    config = ObservationConfig(parts=("sonar", "motion", "home", "exit", "way"))
    agent = Albot0Homing(EnvironmentConfigs(config, DeclaringActionConfig()))
    agent.reset(np.random.default_rng(0), Box(-1, 1, (3,), np.float32))
    shown = {name: np.zeros(shape, np.float32) for name, shape in config.shapes.items()}
    observe_home(np.array((distance, 0.0, 0.0)), config.scales.home, shown["home"])
    shown["exit"][5] = 1.0 if has_exit else -1.0
    shown["way"][:] = (1.0, 0.0, shown["home"][2], 1.0)
    action = agent.act(shown, {})
    assert (action[2] > 0) == declares
