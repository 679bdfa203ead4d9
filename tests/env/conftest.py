"""A small world with two rooms, an explorer in it, and a recorded episode."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.core import journeys
from albot_env.tasks.core.journeys import JourneyCache
from albot_env.tasks.explore.env import ExploreEnv
from albot_maps import Room, World

MakeEnv = Callable[..., ExploreEnv]


def _box(x0: float, y0: float, x1: float, y1: float) -> list[list[float]]:
    return [[x0, y0, x1, y0], [x1, y0, x1, y1], [x1, y1, x0, y1], [x0, y1, x0, y0]]


@pytest.fixture(scope="session")
def two_rooms() -> World:
    """Two rooms of 5 m by 4 m, west and east, with a doorway of 1 m between them."""
    walls = [*_box(0, 0, 10, 4), [5, 0, 5, 1.5], [5, 2.5, 5, 4]]
    outlines = {
        "west": ((0, 0), (5, 0), (5, 4), (0, 4)),
        "east": ((5, 0), (10, 0), (10, 4), (5, 4)),
    }
    return World(
        name="two-rooms",
        walls=np.array(walls, float),
        starts=np.array(((2.0, 2.0, 0.0), (8.0, 2.0, np.pi))),
        rooms=tuple(Room(name=k, boundary=np.array(v, float)) for k, v in outlines.items()),
    )


@pytest.fixture(autouse=True)
def every_journey_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Journeys that are new each time are made by every robot: episodes are compared in tests."""
    monkeypatch.setattr(journeys, "_LATEST", JourneyCache(limit=0))


@pytest.fixture
def make_env(two_rooms: World) -> MakeEnv:
    """Makes an environment in the two rooms, with the odometry mapper if not told otherwise."""

    def make(**options: Any) -> ExploreEnv:
        return ExploreEnv(two_rooms, **{"mapper": "odometry", **options})

    return make


def drive(env: ExploreEnv, steps: int, seed: int = 5) -> list[tuple[Any, dict[str, Any]]]:
    """Drive by chance; every observation and info, those of the reset first."""
    rng = np.random.default_rng(seed)
    seen = [env.reset(seed=seed, options={"start": 0})]
    for _ in range(steps):
        action = np.array((*rng.uniform((0, -0.6), (1, 0.6)), -1.0), np.float32)
        observation, _, _, _, info = env.step(action)
        seen.append((observation, info))
    return seen


@pytest.fixture
def episode(make_env: MakeEnv, tmp_path: Path) -> Path:
    """A recorded episode of forty steps with albot1."""
    env = make_env(mapper="albot1")
    env.agent, env.recorder = "chance", EpisodeWriter(tmp_path / "episode.mcap")
    drive(env, 40)
    env.close()
    return tmp_path / "episode.mcap"
