"""One step of Albot1 (algorithm 4), compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from albot_core.albot1.config import Limits
from albot_core.albot1.localization import localize
from albot_core.albot1.memory import Memory
from albot_core.albot1.recognition import length_of, recognize_landmarks, wrap
from albot_core.albot1.sight import Sight
from albot_core.albot1.triangulation import triangulate
from albot_core.albot1.updating import update_map
from albot_core.perception.surfaces import NO_EDGE, extract_surfaces

STEP, UPDATED_AT, UPDATES, LOST = 0, 1, 2, 3
"""Places in `progress`: readings taken in, the reading last laid into the map (the
thesis's ustep), views laid into the map, and readings without any recognised landmark."""


@njit(cache=True, error_model="numpy")
def find_landmarks(current: Sight, limits: Limits) -> None:
    """Section 3.1.4: long surfaces with an occluding or corner point are landmarks."""
    for k in range(current.size[0]):
        current.landmark[k] = length_of(current.surfaces[k]) >= limits.landmark_length and (
            current.edges[k, 0] != NO_EDGE or current.edges[k, 1] != NO_EDGE
        )


@njit(cache=True, error_model="numpy")
def _recognize_and_localize(
    memory: Memory, previous: Sight, current: Sight, motion: np.ndarray, limits: Limits
) -> int:
    """Set the landmarks recognised in the current view and the pose; return how many."""
    cos, sin = np.cos(previous.pose[2]), np.sin(previous.pose[2])
    current.pose[0] = previous.pose[0] + cos * motion[0] - sin * motion[1]
    current.pose[1] = previous.pose[1] + sin * motion[0] + cos * motion[1]
    current.pose[2] = wrap(previous.pose[2] + motion[2])
    if limits.remembered:
        return int(triangulate(memory, previous, current, motion, limits))
    pairs = np.empty((current.size[0], 4))
    recognized = recognize_landmarks(previous, current, motion, limits, pairs)
    # With no landmark in view path integration stands in (section 3.2.1).
    if recognized > 0:
        localize(memory, current, pairs)
    return int(recognized)


@njit(cache=True, error_model="numpy")
def map_step(
    memory: Memory,
    previous: Sight,
    current: Sight,
    ranges: np.ndarray,
    directions: np.ndarray,
    mount: tuple[float, float],
    max_range: float,
    view_thresholds: np.ndarray,
    fit_lines: bool,
    motion: np.ndarray,
    limits: Limits,
    progress: np.ndarray,
) -> None:
    """Algorithm 4: take in one reading; `current` becomes what is seen now."""
    current.size[0] = extract_surfaces(  # line 3
        ranges,
        directions,
        mount[0],
        mount[1],
        max_range,
        view_thresholds,
        fit_lines,
        current.surfaces,
        current.edges,
    )
    find_landmarks(current, limits)  # line 4
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
