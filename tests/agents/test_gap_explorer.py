"""The gap explorer end to end: it covers, it does not collide, it leaves dead ends."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import albot_env
from albot_agents.agent import choose
from albot_agents.registry import make_agent
from albot_maps import World

assert albot_env.__doc__  # Importing it registers the environments.


def _explore(world: str | World, steps: int, seed: int, **options: Any) -> dict[str, Any]:
    """Explore; the last info, and how many steps the robot was in contact."""
    name, start = options.pop("agent", "gap-explorer"), options.pop("start", None)
    env = gymnasium.make("Albot/Explore-v0", world=world, max_episode_steps=steps, **options)
    agent = make_agent(name, env.get_wrapper_attr("observing"))
    agent.reset(np.random.default_rng(seed), env.action_space)
    observation, info = env.reset(seed=seed, options={} if start is None else {"start": start})
    contacts, over = 0, False
    while not over:
        observation, _, _, over, info = env.step(choose(agent, observation, info))
        contacts += info["collided"]
    return {**info, "contacts": contacts}


def test_it_covers_a_quarter_of_the_office_in_two_minutes() -> None:
    journeys = [_explore("office-ring", 1200, seed) for seed in (1, 2, 3, 4, 5, 6)]
    assert all(info["coverage"] > 0.25 for info in journeys)
    assert np.median([info["coverage"] for info in journeys]) > 0.3
    assert all(info["rooms_entered"] >= 2 for info in journeys)
    assert not any(info["contacts"] for info in journeys)


def test_it_covers_far_more_than_chance(two_rooms: World) -> None:
    ours = _explore(two_rooms, 500, 1, mapper="odometry")
    chance = _explore(two_rooms, 500, 1, mapper="odometry", agent="random")
    assert ours["coverage"] > 0.95
    assert ours["rooms_entered"] == 2
    assert chance["coverage"] < 0.8


def test_it_leaves_a_dead_end() -> None:
    """It begins at the closed end of a corridor, facing the wall, with a room at the other."""
    walls = np.array(
        (
            (0, 0, 8, 0), (0, 1.2, 8, 1.2), (0, 0, 0, 1.2), (8, 1.2, 8, 5), (8, 0, 8, -4),
            (8, 5, 14, 5), (14, 5, 14, -4), (14, -4, 8, -4),
        ),
        float,
    )  # fmt: skip
    world = World(name="dead end", walls=walls, starts=np.array(((0.6, 0.6, np.pi),)))
    info = _explore(world, 600, 3, mapper="odometry", odometer="ideal")
    assert info["pose"][0] > 8.0
    assert info["coverage"] > 0.85
    assert info["contacts"] == 0


@pytest.mark.parametrize(
    ("laser", "sonar"), [("lms-200-fine", "none"), ("long", "poor"), ("short", "ideal")]
)
def test_it_explores_with_any_laser_and_sonars(two_rooms: World, laser: str, sonar: str) -> None:
    info = _explore(two_rooms, 350, 1, mapper="odometry", laser=laser, sonar=sonar)
    assert info["rooms_entered"] == 2
    assert info["coverage"] > 0.8
    assert info["contacts"] == 0
