"""Compiled scenes: which visual scene a robot sees from where it is."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_env.sim.noise_kernels import draw, draw_normals

SCENE_DRAWS = 6
"""Places in the robot's stream that a look takes."""


class Scenes(NamedTuple):
    """What the compiled scenes compute with; see `SceneConfig.constants`."""

    left: float
    """Left and lower edge of the places (m)."""
    bottom: float
    cell: float
    """Side of a place (m)."""
    columns: int
    rows: int
    sectors: int
    """Views of a place; the first begins along x."""
    scenes: int
    """How many scenes there are."""
    stride: int
    """How far the numbers of neighbouring views are apart, before they are shared."""
    position_noise: float
    """Standard deviation of x and of y (m)."""
    heading_noise: float
    """Standard deviation of the heading (rad)."""
    missed: int
    """Probability that no scene is seen, times 2^32."""
    false: int
    """Probability that a scene is seen falsely, times 2^32."""


@kernel(nogil=True)
def look(x: float, y: float, heading: float, scenes: Scenes, key: np.uint64, place: int) -> int:
    """The number of the scene that a robot sees; -1 where none.

    Args:
        x: The robot's place, world frame (m).
        y: The robot's place, world frame (m).
        heading: Its heading (rad).
        scenes: The scenes.
        key: Key of the robot's stream.
        place: First of the SCENE_DRAWS places in it that the look takes.
    """
    bits = draw(key, place)
    if np.int64(bits & np.uint64(0xFFFFFFFF)) < scenes.missed:
        return -1
    if np.int64(bits >> np.uint64(32)) < scenes.false:
        return int(np.int64(draw(key, place + 1) >> np.uint64(11)) % scenes.scenes)
    along, across = draw_normals(key, place + 2)
    turn, _ = draw_normals(key, place + 4)
    x, y = x + scenes.position_noise * along, y + scenes.position_noise * across
    return scene_at(x, y, heading + scenes.heading_noise * turn, scenes)


@kernel()
def scene_at(x: float, y: float, heading: float, scenes: Scenes) -> int:
    """The number of the scene that is truly there; outside all places, that at their edge."""
    column = min(max(math.floor((x - scenes.left) / scenes.cell), 0), scenes.columns - 1)
    row = min(max(math.floor((y - scenes.bottom) / scenes.cell), 0), scenes.rows - 1)
    share = heading / (2 * math.pi)
    sector = min(math.floor((share - math.floor(share)) * scenes.sectors), scenes.sectors - 1)
    views = scenes.columns * scenes.rows * scenes.sectors
    view = (row * scenes.columns + column) * scenes.sectors + sector
    return view * scenes.stride % views % scenes.scenes
