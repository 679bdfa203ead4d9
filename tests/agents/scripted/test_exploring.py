"""Agents that explore: on plans drawn by hand, and end to end; and out and back in time."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box

import albot_env
from albot_agents.agent import EnvironmentConfigs, choose_action
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import run_trial
from albot_agents.registry import make_agent
from albot_core.errors import InputError
from albot_core.planning.frontier_explorer import find_frontiers
from albot_core.planning.grid_search import BLOCKED, FREE
from albot_core.robot import ROBOTS
from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_maps import World, load_world

assert albot_env.__doc__  # Importing it registers the environments.


def _explore(world: str | World, steps: int, seed: int, **options: Any) -> dict[str, Any]:
    """Explore; the last info, and how many steps the robot was in contact."""
    name, start = options.pop("agent", "gap-explorer"), options.pop("start", None)
    env = gymnasium.make("Albot/Explore-v0", world=world, max_episode_steps=steps, **options)
    agent = make_agent(name, EnvironmentConfigs.of(env))
    agent.reset(np.random.default_rng(seed), env.action_space)
    observation, info = env.reset(seed=seed, options={} if start is None else {"start": start})
    contacts, over = 0, False
    while not over:
        observation, _, _, over, info = env.step(choose_action(agent, observation, info))
        contacts += info["collided"]
    return {**info, "contacts": contacts}


def test_it_covers_a_quarter_of_the_office_in_two_minutes() -> None:
    journeys = [_explore("office-ring", 1200, seed) for seed in (1, 2, 3)]
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


def _room() -> tuple[np.ndarray, np.ndarray]:
    """A room of 10 × 10 cells, walled but for a door of 4 cells to the right, and all covered."""
    grid = np.zeros((20, 20), np.int8)
    grid[4:16, 4:16] = BLOCKED
    grid[5:15, 5:15] = FREE
    grid[8:12, 15] = FREE
    return grid, grid == FREE


def test_the_frontier_of_a_room_is_its_door() -> None:
    grid, covered = _room()
    found = find_frontiers(grid, covered, 4)
    door = np.zeros(grid.shape, bool)
    door[8:12, 15] = True
    assert np.array_equal(found > 0, door)
    assert len(np.unique(found[door])) == 1


def test_a_gap_that_is_narrower_than_wanted_is_no_frontier() -> None:
    grid, covered = _room()
    assert not find_frontiers(grid, covered, 5).any()


def test_ground_seen_from_afar_is_beyond_the_frontier() -> None:
    """Free ground that is not covered yet, half the room: the frontier is the line between."""
    grid, covered = _room()
    covered[:, 10:] = False
    found = find_frontiers(grid, covered, 4)
    assert np.argwhere(found).tolist() == [[row, 9] for row in range(5, 15)]


def test_separate_frontiers_have_numbers_of_their_own() -> None:
    grid, covered = _room()
    grid[8:12, 4], covered[8:12, 4] = FREE, True
    found = find_frontiers(grid, covered, 4)
    assert found[8:12, 4].min() == found[8:12, 4].max() != found[8, 15]
    assert (found > 0).sum() == 8


def test_it_covers_two_rooms_and_touches_nothing(two_rooms: World) -> None:
    info = _explore(two_rooms, 400, 1, mapper="odometry", agent="nearest-frontier")
    assert info["coverage"] > 0.95
    assert info["rooms_entered"] == 2
    assert info["contacts"] == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_it_goes_on_in_the_office(seed: int) -> None:
    info = _explore("office-ring", 600, seed, mapper="none", agent="nearest-frontier")
    assert info["coverage"] > 0.1
    assert info["contacts"] == 0


def test_it_explores_and_is_home_in_time() -> None:
    config = ExploreAndHomeConfig(shortest=60.0, longest=60.0, ground=20.0)
    trial = Trial(
        task="Albot/ExploreAndHome-v1",
        agent="round-trip",
        world="office-ring",
        seed=3,
        settings={"config": config, "mapper": "albot1"},
    )
    outcome = run_trial(trial)
    assert outcome.info["is_success"]
    assert outcome.info["time_left"] > 0
    assert outcome.driven > 8.0
    assert outcome.collisions == 0


def test_where_no_time_is_shown_it_says_so() -> None:
    agent = make_agent("round-trip")
    with pytest.raises(InputError, match="round-trip: expected observations with the part time"):
        agent.reset(np.random.default_rng(1), Box(-1, 1, (3,), np.float32))


@pytest.mark.parametrize("agent", ["gap-explorer", "nearest-frontier"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_no_robot_touches_anything_in_a_world_made_for_it(agent: str, robot: str) -> None:
    world = load_world("random:office:4?rooms=6&door_width=1.1", ROBOTS[robot].radius)
    info = _explore(world, 600, 1, agent=agent, mapper="none", robot=robot)
    assert info["contacts"] == 0
    assert info["rooms_entered"] > 1
    assert info["path_length"] > 15.0
