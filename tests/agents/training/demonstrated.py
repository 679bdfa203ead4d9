"""Demonstrations that are made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from albot_agents.training.demonstrations import CUT, Demonstrations, Lesson
from albot_core.plain_data import to_plain
from albot_env.tasks.core.actions import DeclaringActionConfig
from albot_env.tasks.core.observation import ObservationConfig

ACTIONS = DeclaringActionConfig()
LESSON = Lesson(
    task="Albot/Homing-v0",
    mapper="none",
    observations=to_plain(ObservationConfig(parts=("motion",))),
    actions={**to_plain(ACTIONS), "names": list(ACTIONS.names)},
)
"""What is observed is three numbers."""


def demonstrations(**arrays: Any) -> Demonstrations:
    """Demonstrations of one round with these arrays, by default of motions, without rewards."""
    shape = np.shape(next(iter(arrays.values())))[:2]
    after = np.zeros(shape, np.uint8)
    after[:, -1] = CUT
    begins = np.zeros(shape, np.bool_)
    begins[:, 0] = True
    usual = {
        "observations": np.zeros((*shape, 3), np.float16),
        "actions": np.zeros((*shape, 3), np.float32),
        "rewards": np.zeros(shape, np.float32),
        "begins": begins,
        "after": after,
    }
    return Demonstrations(lesson=LESSON, agent="random", seed=0, rounds=1, **(usual | arrays))
