"""Episodes are the same for all: a function of world and seed, whatever an agent is or carries."""

from __future__ import annotations

from functools import cache
from typing import Any

import gymnasium
import numpy as np
import pytest

from albot_agents.registry import agent_names, find_agent
from albot_core.mappers.registry import installed_mappers, mapper_spec
from albot_env.sim import LASERS, ODOMETERS
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_env.tasks.homing_by_map.task import HomingByMapConfig
from albot_env.tasks.place_recognition.task import PlaceRecognitionConfig
from albot_env.tasks.place_recognition.tours import TourConfig
from tests.env.quick import DRIVEN, GLANCE, JUDGED, loaded, still

SEED = 1000
WORLD = "random:office:1001?rooms=4&people=2&boxes=2&doors=2"
"""People, boxes and doors move, so that what they do must be the same, too."""
_OUTING = OutwardJourneyConfig(shortest=2.0, longest=4.0, away=1.0)
SHORT = HomingConfig(outing=_OUTING)
CONFIGS: dict[str, Any] = {
    "Albot/Homing-v0": SHORT,
    "Albot/HomingByMap-v0": HomingByMapConfig(outing=_OUTING),
    JUDGED[0]: GLANCE,
}


TOUR = PlaceRecognitionConfig(tour=TourConfig(revisits=0.9))
"""Not as in the training of the agent that is shipped, but of the same length."""


@cache
def _reference(task: str) -> list[bytes]:
    """The episode that `random` meets."""
    return _episode(task, "random")


def _episode(task: str, agent: str, **settings: Any) -> list[bytes]:
    """The truth at hand-over, to the bit; where the agent does not drive, at each later stop."""
    wanted = {"world": loaded(WORLD), "config": CONFIGS.get(task), **settings}
    env: Any = gymnasium.make(task, **find_agent(agent).environment(task, wanted)).unwrapped
    _, info = env.reset(seed=SEED)
    truth = [np.asarray(info[key]) for key in ("pose", "start")]
    truth += [env._robot.dynamic_obstacles(0)]
    truth += [np.asarray(info[k]) for k in ("initial_distance_home", "outward_length") if k in info]
    over = task in DRIVEN
    while not over:
        _, _, over, _, info = env.step(still(task))
        truth.append(np.asarray(info["pose"]))
    env.close()
    return [each.tobytes() for each in truth]


@pytest.mark.parametrize("task", [*DRIVEN, *JUDGED])
def test_all_agents_meet_the_same_episodes(task: str) -> None:
    settings = {"config": TOUR} if task in JUDGED else {}
    met = {agent: _episode(task, agent, **settings) for agent in agent_names(task)}
    assert len(met) > 1
    for agent, episode in met.items():
        assert episode == met["random"], agent


def _equipped(mapper: str) -> dict[str, str]:
    needs = mapper_spec(mapper).sensors
    return {
        "mapper": mapper,
        "laser": "lms-200" if "laser" in needs else "none",
        "scenes": "paper" if "scene" in needs else "none",
        "compass": "clouded" if "compass" in needs else "none",
    }


@pytest.mark.parametrize("mapper", installed_mappers())
def test_all_mappers_meet_the_same_homing_episode(mapper: str) -> None:
    assert _episode("Albot/Homing-v0", "random", **_equipped(mapper)) == _reference(
        "Albot/Homing-v0"
    )


@pytest.mark.parametrize("task", ["Albot/Homing-v0", *JUDGED])
@pytest.mark.parametrize(
    "settings",
    [
        *({"odometer": name} for name in ODOMETERS),
        *({"laser": name} for name in LASERS),
        {"sonar": "none"},
        {"scenes": "paper", "mapper": "ratslam-scenes"},
        {"compass": "clouded"},
    ],
    ids=str,
)
def test_sensors_and_their_noise_change_no_episode(task: str, settings: dict[str, str]) -> None:
    settings = {"mapper": "odometry" if task in JUDGED else "none", **settings}
    assert _episode(task, "random", **settings) == _reference(task)


def test_observations_change_no_episode() -> None:
    """With a laser's range of 6 m, homing episodes once began 3 m farther from home."""
    seen = HomingConfig(outing=SHORT.outing, observations=ObservationConfig(laser_range=6.0))
    assert _episode("Albot/Homing-v0", "random", config=seen) == _reference("Albot/Homing-v0")


def test_other_seeds_are_other_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    before = _reference("Albot/Homing-v0")
    monkeypatch.setattr(f"{__name__}.SEED", SEED + 1)
    assert _episode("Albot/Homing-v0", "random") != before
