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

STEP, UPDATED_AT, UPDATES, LOST, STRANGE = 0, 1, 2, 3, 4
"""Places in `progress`: views taken in, the view last laid into the map (the thesis's
ustep), views laid into the map, views without any recognised landmark, and how many views
on end, up to two, had nothing in them that should be there."""

STRANGE_SHARE = 0.0
"""A view of which no more than this is familiar is strange."""


@njit(cache=True, error_model="numpy", inline="always")
def _recognize_and_localize(
    memory: Memory, previous: Sight, current: Sight, motion: np.ndarray, limits: Limits
) -> tuple[int, float]:
    """Set the landmarks recognised in the current view and the pose.

    Returns how many they are, and which share of the view is familiar (1 in the thesis's way).
    """
    moved(previous.pose, motion, current.pose)
    if limits.remembered:
        recognized, share = triangulate(memory, previous, current, motion, limits)
        return int(recognized), float(share)
    pairs = np.empty((current.size[0], 4))
    recognized = recognize_landmarks(previous, current, motion, limits, pairs)
    # With no landmark in view path integration stands in (section 3.2.1).
    if recognized > 0:
        localize(memory, current, pairs)
    return int(recognized), 1.0


@njit(cache=True, error_model="numpy", inline="always")
def map_step(
    memory: Memory,
    previous: Sight,
    current: Sight,
    motion: np.ndarray,
    limits: Limits,
    progress: np.ndarray,
) -> None:
    """Algorithm 4 from line 5 on: take in the view `current`, a motion away from `previous`.

    A strange view is not laid over the map before the next one is strange as well: it may be
    that it was misread, and what it covers is forgotten. This is ours.
    """
    step = progress[STEP]
    progress[STEP] += 1
    recognized, share = 0, 1.0
    if step == 0:  # lines 5 to 8
        for i in range(3):
            current.pose[i] = 0.0
    else:
        while True:
            recognized, share = _recognize_and_localize(memory, previous, current, motion, limits)
            laid = progress[UPDATED_AT] >= step - 1 or progress[STRANGE] > 0
            if recognized >= limits.fewest_landmarks or laid:
                break
            update_map(memory, previous, limits)  # lines 19 to 23: back to line 11
            progress[UPDATED_AT] = step - 1
            progress[UPDATES] += 1
        if recognized == 0:
            progress[LOST] += 1
    strange = recognized < limits.fewest_landmarks and share <= STRANGE_SHARE
    progress[STRANGE] = progress[STRANGE] + 1 if strange else 0
    if progress[STRANGE] == 1:
        return
    if recognized < limits.fewest_landmarks:  # lines 13 to 17
        update_map(memory, current, limits)
        progress[UPDATED_AT] = step
        progress[UPDATES] += 1
