"""The scene sensor: RatSLAM's simulated camera, which returns numbers of visual scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields
from albot_env.sim.noise import draw, draw_normals

_GOLDEN = (math.sqrt(5) - 1) / 2
_COUNT = Range("a whole number from 1", 1.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class SceneConfig:
    """How scenes are numbered, and with which errors they are recognised.

    It follows the simulator of Milford, Prasser and Wyeth (Experience mapping, ACRA 2005, section
    5.1): noisy, ambiguous scene numbers computed from the robot's pose, with false matches at
    random times. The paper does not give its algorithm; this one is ours. The world is divided into
    square cells, and the headings in each cell into equal sectors. Each pair of cell and sector is
    a view. A view's number depends only on the world's extent, and distant views may share it.
    """

    cell: float = 1.0
    """Side of a cell (m)."""
    sectors: int = 8
    """Number of views per cell, all round."""
    sharing: int = 1
    """Number of views that share a scene number; they are scattered over the world."""
    position_noise: float = 0.0
    """Standard deviation of the errors of x and y (m) that decide which cell is seen."""
    heading_noise: float = 0.0
    """Standard deviation of the heading error (rad) that decides which sector is seen."""
    missed_rate: float = 0.0
    """Probability that a reading recognises no scene."""
    false_rate: float = 0.0
    """Probability that a reading recognises a random scene of the world, all equally likely."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "sectors", "sharing")
        check_fields(self, POSITIVE, "cell")
        check_fields(self, NOT_NEGATIVE, "position_noise", "heading_noise")
        check_fields(self, SHARE, "missed_rate", "false_rate")

    def constants(self, bounds: tuple[float, float, float, float]) -> SceneConstants:
        """Return the constants of the compiled scenes for a world's bounds (`World.bounds`)."""
        left, bottom, right, top = bounds
        columns = max(math.ceil((right - left) / self.cell), 1)
        rows = max(math.ceil((top - bottom) / self.cell), 1)
        views = columns * rows * self.sectors
        scenes = math.ceil(views / self.sharing)
        # Coprime, so that no two views of a share get the same number; near the golden section, so
        # that neighbours' numbers are far apart.
        stride = max(round(scenes * _GOLDEN), 1)
        while math.gcd(stride, scenes) > 1:
            stride += 1
        return SceneConstants(
            left=float(left),
            bottom=float(bottom),
            cell=float(self.cell),
            columns=columns,
            rows=rows,
            sectors=self.sectors,
            scenes=scenes,
            stride=stride,
            position_noise=float(self.position_noise),
            heading_noise=float(self.heading_noise),
            missed=round(self.missed_rate * 2**32),
            false=round(self.false_rate * 2**32),
        )


SCENES: Mapping[str, SceneConfig] = MappingProxyType(
    {
        "ideal": SceneConfig(),
        "paper": SceneConfig(
            sharing=2,
            position_noise=0.1,
            heading_noise=math.radians(5),
            missed_rate=0.05,
            false_rate=0.005,
        ),
        "ambiguous": SceneConfig(
            sharing=10,
            position_noise=0.2,
            heading_noise=math.radians(10),
            missed_rate=0.1,
            false_rate=0.02,
        ),
    }
)
"""Scene sensors by name.

`ideal`: every view has its own number and is always recognised.

`paper`: some of every error that the paper names. Cells of 1 m with 8 sectors make about 4,500
views of its floor of 43 × 13 m, as the paper's few thousand (section 3.4). The paper does
not give the rates; they are our choice.

`ambiguous`: a building with rooms that look alike.
"""


SCENE_DRAWS = 6
"""Number of random numbers that a reading draws."""


class SceneConstants(NamedTuple):
    """Constants of the compiled scenes; see `SceneConfig.constants`."""

    left: float
    """Left and lower edge of the cells (m)."""
    bottom: float
    cell: float
    """Side of a cell (m)."""
    columns: int
    rows: int
    sectors: int
    """Views per cell; the first starts at heading 0."""
    scenes: int
    """Number of scenes."""
    stride: int
    """Distance between the numbers of neighbouring views when numbers are used again."""
    position_noise: float
    """Standard deviation of x and of y (m)."""
    heading_noise: float
    """Standard deviation of the heading (rad)."""
    missed: int
    """Probability that no scene is recognised, times 2^32."""
    false: int
    """Probability of a false recognition, times 2^32."""


@kernel(nogil=True)
def recognise_scene(
    x: float, y: float, heading: float, scenes: SceneConstants, key: np.uint64, counter: int
) -> int:
    """Return the number of the scene that a robot recognises; -1 for none.

    Args:
        x: Position of the robot, world frame (m).
        y: Position of the robot, world frame (m).
        heading: Heading of the robot (rad).
        scenes: The scenes.
        key: Key of the robot's random numbers.
        counter: Counter of the first of the SCENE_DRAWS random numbers of this reading.
    """
    bits = draw(key, counter)
    if np.int64(bits & np.uint64(0xFFFFFFFF)) < scenes.missed:
        return -1
    if np.int64(bits >> np.uint64(32)) < scenes.false:
        return int(np.int64(draw(key, counter + 1) >> np.uint64(11)) % scenes.scenes)
    along, across = draw_normals(key, counter + 2)
    turn, _ = draw_normals(key, counter + 4)
    x, y = x + scenes.position_noise * along, y + scenes.position_noise * across
    return scene_at(x, y, heading + scenes.heading_noise * turn, scenes)


@kernel()
def scene_at(x: float, y: float, heading: float, scenes: SceneConstants) -> int:
    """Return the number of the true scene at a pose; outside all cells, that of an edge cell."""
    column = min(max(math.floor((x - scenes.left) / scenes.cell), 0), scenes.columns - 1)
    row = min(max(math.floor((y - scenes.bottom) / scenes.cell), 0), scenes.rows - 1)
    share = heading / (2 * math.pi)
    sector = min(math.floor((share - math.floor(share)) * scenes.sectors), scenes.sectors - 1)
    view = (row * scenes.columns + column) * scenes.sectors + sector
    # The first views take the numbers in order, as many views as there are numbers. The next take
    # them in a scattered order, and so on, each time in another order. With one order for all, a
    # whole part of the world would look like another, view by view along any path.
    number = view % scenes.scenes
    for _ in range(view // scenes.scenes):
        number = number * scenes.stride % scenes.scenes
    return number
