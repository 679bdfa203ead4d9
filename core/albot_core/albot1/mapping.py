"""One view of Albot1's (algorithm 4), compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from albot_core.albot1.config import Limits
from albot_core.albot1.localization import localize
from albot_core.albot1.memory import Memory
from albot_core.albot1.recognition import moved, recognize_landmarks
from albot_core.albot1.sight import Sight
from albot_core.albot1.triangulation import triangulate
from albot_core.albot1.updating import update_map

STEP, UPDATED_AT, UPDATES, LOST = 0, 1, 2, 3
"""Places in `progress`: views taken in, the view last laid into the map (the thesis's
ustep), views laid into the map, and views without any recognised landmark."""


@njit(cache=True, error_model="numpy", inline="always")
def _recognize_and_localize(
    memory: Memory, previous: Sight, current: Sight, motion: np.ndarray, limits: Limits
) -> int:
    """Set the landmarks recognised in the current view and the pose; return how many."""
    moved(previous.pose, motion, current.pose)
    if limits.remembered:
        return int(triangulate(memory, previous, current, motion, limits))
    pairs = np.empty((current.size[0], 4))
    recognized = recognize_landmarks(previous, current, motion, limits, pairs)
    # With no landmark in view path integration stands in (section 3.2.1).
    if recognized > 0:
        localize(memory, current, pairs)
    return int(recognized)


@njit(cache=True, error_model="numpy", inline="always")
def map_step(
    memory: Memory,
    previous: Sight,
    current: Sight,
    motion: np.ndarray,
    limits: Limits,
    progress: np.ndarray,
) -> None:
    """Algorithm 4 from line 5 on: take in the view `current`, a motion away from `previous`."""
    step = progress[STEP]
    progress[STEP] += 1
    recognized = 0
    if step == 0:  # lines 5 to 8
        for i in range(3):
            current.pose[i] = 0.0
    else:
        while True:
            recognized = _recognize_and_localize(memory, previous, current, motion, limits)
            if recognized >= limits.fewest_landmarks or progress[UPDATED_AT] >= step - 1:
                break
            update_map(memory, previous, limits)  # lines 19 to 23: back to line 11
            progress[UPDATED_AT] = step - 1
            progress[UPDATES] += 1
        if recognized == 0:
            progress[LOST] += 1
    if recognized < limits.fewest_landmarks:  # lines 13 to 17
        update_map(memory, current, limits)
        progress[UPDATED_AT] = step
        progress[UPDATES] += 1
