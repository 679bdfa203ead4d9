"""Settings with which an episode of each environment begins at once, and actions for it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import gymnasium
import numpy as np

import albot_env
from albot_env.sim import COMPASSES, LASERS, ODOMETERS, SCENES, SONARS
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_env.tasks.homing_by_map.task import HomingByMapConfig
from albot_env.tasks.place_recognition.task import PlaceRecognitionConfig
from albot_env.tasks.place_recognition.tours import TourConfig
from albot_maps import load_world

assert albot_env.__doc__  # Importing it registers the environments.
IDS = sorted(
    name
    for name in gymnasium.registry
    if name.startswith("Albot/") and not any(word in name for word in ("Revealed", "Probe"))
)
"""The environments but for their revealed twins and the probes: see `test_truth.py` and
`test_probes.py`."""

STROLL = HomingConfig(outing=OutwardJourneyConfig(shortest=1.0, longest=2.0, away=0.0))
"""A journey out of a metre or two."""
GLANCE = PlaceRecognitionConfig(tour=TourConfig(arrivals=3))
"""A tour of two stops."""
loaded = cache(load_world)
"""A world by its name, made once: what is kept of journeys is kept with their world."""
LOOP = loaded("square-loop")
STROLL_BY_MAP = HomingByMapConfig(outing=STROLL.outing)
SETTINGS: dict[str, dict[str, Any]] = {
    "Albot/HomingByMap-v0": {"config": STROLL_BY_MAP, "journeys": 1, "world": LOOP},
    "Albot/Homing-v0": {"config": STROLL, "journeys": 1, "world": LOOP},
    "Albot/PlaceRecognition-v0": {
        "config": GLANCE,
        "journeys": 4,
        "world": LOOP,
    },
}
"""What journeys out would take is not what contracts are about. In one and the same world they
are kept from one test to the next."""
JUDGED = ["Albot/PlaceRecognition-v0"]
"""Where the agent drives no robot, but answers."""
DRIVEN = [name for name in IDS if name not in JUDGED]
"""Where it drives."""


def cycled(**choices: Sequence[str]) -> list[dict[str, str]]:
    """As many settings as the longest sequence holds; each choice is in one of them."""
    count = max(map(len, choices.values()))
    return [{name: of[k % len(of)] for name, of in choices.items()} for k in range(count)]


SENSORS = {
    "laser": list(LASERS),
    "sonar": ["none", *SONARS],
    "odometer": list(ODOMETERS),
    "scenes": list(SCENES),
    "compass": list(COMPASSES),
}
"""The names of all sensors."""
UNKNOWN = [
    ({"odometer": "perfect"}, "perfect"),
    ({"mapper": "albot2"}, "albot2"),
    ({"observation": "image"}, "image"),
]
"""Settings that name what there is not, and what the refusal says it found."""


SAYING = {"Albot/HomingByMap-v0": 2, "Albot/ExploreAndHome-v1": 2}
"""How many numbers of an action declare or claim something; one elsewhere."""


def still(environment: str, *shape: int) -> np.ndarray:
    """Actions that do nothing."""
    if environment in JUDGED:
        return np.zeros(shape, np.int64)
    return np.zeros((*shape, 2 + SAYING.get(environment, 1)), np.float32)


def saying(environment: str, actions: np.ndarray) -> np.ndarray:
    """Actions of three numbers, the last of which is repeated for whatever else may be said."""
    others = np.repeat(actions[..., 2:], SAYING.get(environment, 1) - 1, axis=-1)
    return np.concatenate((actions, others), axis=-1)


def drawn_actions(environment: str, rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Actions by chance that declare and claim nothing."""
    if environment in JUDGED:
        return rng.integers(1 + GLANCE.tour.most, size=shape)
    actions = rng.uniform(-1, 1, (*shape, 2)).astype(np.float32)
    silent = np.full((*shape, SAYING.get(environment, 1)), -1, np.float32)
    return np.concatenate((actions, silent), axis=-1)
