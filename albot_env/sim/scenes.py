"""The scene sensor: RatSLAM's simulated camera, which gives numbers of visual scenes."""

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
    """How scenes are numbered, and how wrongly they are seen.

    After the simulator of Milford, Prasser and Wyeth (Experience mapping, ACRA 2005, section
    5.1): noisy, ambiguous scene numbers made from the robot's pose, and at random times a
    false match. Its algorithm is not given; this one is ours. The world is cut into square
    places, and each is viewed in equal sectors of the heading. A view has a number
    that depends on the world's extent only, and may share it with views elsewhere.
    """

    cell: float = 1.0
    """Side of a place (m)."""
    sectors: int = 8
    """How many views a place has, all round."""
    sharing: int = 1
    """How many views share a number; they lie scattered over the world."""
    position_noise: float = 0.0
    """Standard deviation of x and of y (m) when it is decided which place is seen."""
    heading_noise: float = 0.0
    """Standard deviation of the heading (rad) when it is decided which view is seen."""
    missed_rate: float = 0.0
    """Probability that a look recognises no scene."""
    false_rate: float = 0.0
    """Probability that a look recognises any scene of the world instead, each as likely."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "sectors", "sharing")
        check_fields(self, POSITIVE, "cell")
        check_fields(self, NOT_NEGATIVE, "position_noise", "heading_noise")
        check_fields(self, SHARE, "missed_rate", "false_rate")

    def constants(self, bounds: tuple[float, float, float, float]) -> SceneConstants:
        """What the compiled scenes compute with in a world of these bounds (`World.bounds`)."""
        left, bottom, right, top = bounds
        columns = max(math.ceil((right - left) / self.cell), 1)
        rows = max(math.ceil((top - bottom) / self.cell), 1)
        views = columns * rows * self.sectors
        scenes = math.ceil(views / self.sharing)
        # Coprime, so that no two views of a share meet; near the golden section, so that
        # neighbours' numbers lie far apart there.
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
"""The scene sensors by name.

`ideal`: every view has a number of its own, and is always recognised.

`paper`: some of everything that the paper names. Places of 1 m seen in 8 sectors make
about 4,500 views of its floor of 43 × 13 m, the few thousand that it speaks of (section 3.4);
the rates, which it does not give, are ours.

`ambiguous`: a building whose rooms look alike.
"""


SCENE_DRAWS = 6
"""Random numbers that a look draws."""


class SceneConstants(NamedTuple):
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
    """How far the numbers of neighbouring views are apart where numbers are given once more."""
    position_noise: float
    """Standard deviation of x and of y (m)."""
    heading_noise: float
    """Standard deviation of the heading (rad)."""
    missed: int
    """Probability that no scene is seen, times 2^32."""
    false: int
    """Probability that a scene is seen falsely, times 2^32."""


@kernel(nogil=True)
def recognise_scene(
    x: float, y: float, heading: float, scenes: SceneConstants, key: np.uint64, counter: int
) -> int:
    """The number of the scene that a robot sees; -1 where none.

    Args:
        x: Where the robot is, world frame (m).
        y: Where the robot is, world frame (m).
        heading: Its heading (rad).
        scenes: The scenes.
        key: Key to the robot's random numbers.
        counter: Counter of the first of the SCENE_DRAWS numbers that a look draws.
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
    """The number of the scene that is truly there; outside all places, that at their edge."""
    column = min(max(math.floor((x - scenes.left) / scenes.cell), 0), scenes.columns - 1)
    row = min(max(math.floor((y - scenes.bottom) / scenes.cell), 0), scenes.rows - 1)
    share = heading / (2 * math.pi)
    sector = min(math.floor((share - math.floor(share)) * scenes.sectors), scenes.sectors - 1)
    view = (row * scenes.columns + column) * scenes.sectors + sector
    # As many views as there are numbers take them in order, the next as many scattered, and so on,
    # each time otherwise: were all in the same order, a whole part of the world would look like
    # another, view by view along any way.
    number = view % scenes.scenes
    for _ in range(view // scenes.scenes):
        number = number * scenes.stride % scenes.scenes
    return number
