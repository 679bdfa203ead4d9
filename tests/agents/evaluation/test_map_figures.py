"""What an episode's map was like, in cases with a known answer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from albot_agents.agent import EnvironmentConfigs
from albot_agents.evaluation.map_figures import MapFigures
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import run_trial
from albot_core.geometry.poses import compose, relative
from albot_env.sim import RayCaster
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.beliefs import observe_home
from albot_env.tasks.core.parts.scales import scale_ranges
from tests.env.quick import LOOP, STROLL, STROLL_BY_MAP


def _configs(**changed: Any) -> EnvironmentConfigs:
    return EnvironmentConfigs(ObservationConfig(**changed), ActionConfig())


def _step(
    config: ObservationConfig, pose: Any, belief: Any, ranges: Any = None
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Observation and info of a robot with these true and believed poses, whose start is 0."""
    shown = {name: np.full(shape, -1, np.float32) for name, shape in config.shapes.items()}
    pose, belief = np.array(pose, float), np.array(belief, float)
    observe_home(relative(belief, np.zeros(3)), config.scales.home, shown["home"])
    if ranges is not None:
        scale_ranges(ranges, config.scales.laser, shown["laser"])
    info = {"pose": pose, "belief": belief, "start": np.zeros(3), "path_length": 0.0}
    return shown, info


@pytest.mark.parametrize(
    ("pose", "belief", "error"),
    [
        ((3, 4, 1), (3, 4, 1), 0.0),
        ((3, 4, 1), (3, 5, 1), 1.0),
        # The believed position is right, but home is sought in another direction.
        ((6, 8, 0.0), (6, 8, 0.2), 2 * 10 * math.sin(0.1)),
    ],
)
def test_the_error_of_home_is_how_far_the_robot_would_miss_it(
    pose: Any, belief: Any, error: float
) -> None:
    configs = _configs()
    away = _step(configs.observations, pose, belief)
    there = _step(configs.observations, (1, 0, 0), (1, 0, 0))
    figures = MapFigures(configs, *away).end(*there)
    assert figures["home_error_begin"] == pytest.approx(error, abs=1e-4)
    assert figures["home_error"] == pytest.approx(0.0, abs=1e-4)
    assert MapFigures(configs, *there).end(*away)["home_error"] == pytest.approx(error, abs=1e-4)


def _tour(turn: float) -> dict[str, float]:
    """The figures of a robot that drives round a room, and turns by so much less than it thinks."""
    configs = _configs()
    caster = RayCaster(np.array(((-4, -3, 4, -3), (4, -3, 4, 3), (4, 3, -4, 3), (-4, 3, -4, -3.0))),
                       configs.observations.laser)  # fmt: skip
    pose, belief, steps = np.zeros(3), np.zeros(3), []
    for _ in range(40):
        steps.append(_step(configs.observations, pose, belief, caster.scan(pose)))
        pose = compose(pose, np.array((0.3, 0.0, 0.2)))
        belief = compose(belief, np.array((0.3, 0.0, 0.2 + turn)))
    figures = MapFigures(configs, *steps[0])
    for step in steps[1:]:
        figures.add(*step)
    return figures.end(*steps[-1])


def test_a_map_by_true_poses_is_as_sharp_as_the_true_map_and_one_by_false_poses_is_not() -> None:
    true, false = _tour(0.0), _tour(0.02)
    assert true["map_entropy"] == true["true_map_entropy"] == false["true_map_entropy"]
    assert false["map_entropy"] > true["map_entropy"] + 0.5


def test_what_is_not_observed_is_not_measured() -> None:
    sectors = _configs(laser_sectors=36)
    step = _step(sectors.observations, (0, 0, 0), (0, 0, 0))
    assert set(MapFigures(sectors, *step).end(*step)) == {"home_error_begin", "home_error"}
    blind = _configs(parts=("motion",))
    shown = {name: np.zeros(shape) for name, shape in blind.observations.shapes.items()}
    assert MapFigures(blind, shown, step[1]).end(shown, step[1]) == {}


@pytest.mark.parametrize(
    ("task", "agent", "config", "maps"),
    [
        ("Albot/HomingByMap-v0", "map-homing", STROLL_BY_MAP, False),
        ("Albot/Homing-v0", "home-vector", STROLL, False),
        ("Albot/Explore-v0", "gap-explorer", None, True),
    ],
)
def test_an_episode_has_the_figures_of_its_map(
    task: str, agent: str, config: Any, maps: bool
) -> None:
    """An ideal odometer knows home, however far the robot has driven."""
    settings = {"mapper": "odometry", "odometer": "ideal", "config": config}
    trial = Trial(
        task=task,
        agent=agent,
        world=LOOP.name,
        seed=1,
        settings={**settings, "max_episode_steps": 60},
    )
    info = run_trial(trial).info
    assert info["home_error_begin"] < 1e-3
    assert info["home_error"] < 1e-3
    assert ("map_entropy" in info) == maps
    if maps:
        assert info["map_entropy"] == pytest.approx(info["true_map_entropy"], abs=1e-3)
