"""Home is near as the crow flies, in all tasks that end at home."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_env.tasks.explore_and_home.task import ExploreAndHomeConfig
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import World

AT_HOME = OutwardJourneyConfig(shortest=0.0, longest=0.0, away=0.0)
CONFIGS = {
    "Albot/Homing-v0": lambda radius: HomingConfig(outing=AT_HOME, radius=radius),
    "Albot/ExploreAndHome-v1": lambda radius: ExploreAndHomeConfig(
        claims=False, shortest=60.0, longest=60.0, share=0.0, radius=radius
    ),
}


def _drive(env: gymnasium.Env[Any, Any], pose: np.ndarray, points: np.ndarray) -> dict[str, Any]:
    """Drive through some points (m, world frame); the last info."""
    info: dict[str, Any] = {"pose": pose}
    for point in points:
        for _ in range(200):
            east, north = point - info["pose"][:2]
            if np.hypot(east, north) < 0.25:
                break
            bearing = np.arctan2(north, east) - info["pose"][2]
            turn = np.clip(np.arctan2(np.sin(bearing), np.cos(bearing)), -1, 1)
            speed = 0.4 if np.cos(bearing) > 0.9 else 0.0
            info = env.step(np.array((speed, turn, -1), np.float32))[4]
    return info


@pytest.mark.parametrize("task", CONFIGS)
@pytest.mark.parametrize(("radius", "home"), [(1.2, False), (2.2, True)])
def test_the_radius_counts_straight_through_a_wall(
    two_rooms: World, task: str, radius: float, home: bool
) -> None:
    """Home is 1.6 m away through the wall between the rooms, and over 2.5 m by the doorway."""
    world = replace(two_rooms, starts=np.array(((4.2, 3.5, -np.pi / 2),)))
    env = gymnasium.make(task, world=world, mapper="none", config=CONFIGS[task](radius))
    _, info = env.reset(seed=1)
    info = _drive(env, info["pose"], np.array(((4.2, 2.0), (5.8, 2.0), (5.8, 3.3))))
    assert 1.3 < np.hypot(*(info["pose"] - info["start"])[:2]) < 2.0
    assert info["distance_home"] > 2.5
    assert env.step(np.array((0, 0, 1), np.float32))[4]["is_success"] is home
