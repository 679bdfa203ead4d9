"""One view of Albot1's (algorithm 4), compiled."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.doubt import contradiction
from albot_core.mappers.albot1.localization import localize
from albot_core.mappers.albot1.memory import Memory
from albot_core.mappers.albot1.outlook import Outlook
from albot_core.mappers.albot1.recognition import moved, recognize_landmarks
from albot_core.mappers.albot1.sight import Sight
from albot_core.mappers.albot1.triangulation import triangulate
from albot_core.mappers.albot1.updating import update_map

STEP, UPDATED_AT, UPDATES, LOST, STRANGE = 0, 1, 2, 3, 4
"""Places in `progress`: views taken in, the view last laid into the map (the thesis's
ustep), views laid into the map, views without any recognised landmark, and how many views
on end were strange: not from where the robot believes to be."""

CONTRADICTED = 0.45
"""A view is strange where more of its walls and the last view's contradict each other."""


@kernel()
def _recognize_and_localize(
    memory: Memory,
    previous: Sight,
    current: Sight,
    motion: np.ndarray,
    limits: Limits,
    outlook: Outlook,
) -> int:
    """Set the landmarks recognised in the current view and the pose; return how many they are."""
    moved(previous.pose, motion, current.pose)
    if limits.remembered:
        return int(triangulate(memory, previous, current, motion, limits, outlook))
    return _localize_by_one(memory, previous, current, motion, limits)


@kernel(arrays=True)
def _localize_by_one(
    memory: Memory, previous: Sight, current: Sight, motion: np.ndarray, limits: Limits
) -> int:
    """Algorithms 1 and 2; with no landmark in view path integration stands in (section 3.2.1)."""
    pairs = np.empty((current.size[0], 4))
    recognized = recognize_landmarks(previous, current, motion, limits, pairs)
    if recognized > 0:
        localize(memory, current, pairs)
    return int(recognized)


@kernel()
def _strangeness(
    before: int, recognized: int, previous: Sight, current: Sight, limits: Limits
) -> int:
    """How many views on end are strange now: 0, 1, or 2 where this bears out the one before.

    A view that contradicts the last one is strange, and so is the next if it agrees with it:
    if it does not, the one between was misread.
    """
    if before == 0:
        if recognized >= limits.fewest_landmarks:
            return 0
        return 1 if contradiction(previous, current, limits) > CONTRADICTED else 0
    return 0 if contradiction(previous, current, limits) > CONTRADICTED else before + 1


@kernel()
def map_step(
    memory: Memory,
    previous: Sight,
    current: Sight,
    motion: np.ndarray,
    limits: Limits,
    progress: np.ndarray,
    outlook: Outlook,
) -> None:
    """Algorithm 4 from line 5 on: take in the view `current`, a motion away from `previous`.

    A strange view is not laid over the map before the next one bears it out: it may be that it
    was misread, and what it covers is forgotten. This is ours. `outlook` is room to work in.
    """
    step = progress[STEP]
    progress[STEP] += 1
    recognized = 0
    if step == 0:  # lines 5 to 8
        for i in range(3):
            current.pose[i] = 0.0
    else:
        while True:
            recognized = _recognize_and_localize(memory, previous, current, motion, limits, outlook)
            laid = progress[UPDATED_AT] >= step - 1 or progress[STRANGE] > 0
            if recognized >= limits.fewest_landmarks or laid:
                break
            update_map(memory, previous, limits)  # lines 19 to 23: back to line 11
            progress[UPDATED_AT] = step - 1
            progress[UPDATES] += 1
        if recognized == 0:
            progress[LOST] += 1
        if limits.remembered:
            progress[STRANGE] = _strangeness(
                progress[STRANGE], recognized, previous, current, limits
            )
    if progress[STRANGE] == 1:
        return
    if recognized < limits.fewest_landmarks:  # lines 13 to 17
        update_map(memory, current, limits)
        progress[UPDATED_AT] = step
        progress[UPDATES] += 1
