"""The scene sensor: RatSLAM's simulated camera, which returns numbers of visual scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.kernels.compiled import kernel
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields
from albot_core.robot import CONTROL_STEP
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
    """Share of the readings, apart from missed ones, that recognise a false scene."""
    false_shortest: float = 0.0
    """Shortest duration of a false scene (s), at a reading per control step of 0.1 s. Durations are
    uniformly distributed; each lasts one reading at least. 0: a false scene lasts one reading."""
    false_longest: float = 0.0
    """Longest duration of a false scene (s)."""
    familiar: bool = False
    """Whether false scenes are ones that the robot has passed, all times of the past equally
    likely, as in the paper. If not, they are any scene of the world, all equally likely."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "sectors", "sharing")
        check_fields(self, POSITIVE, "cell")
        check_fields(
            self,
            NOT_NEGATIVE,
            "position_noise",
            "heading_noise",
            "false_shortest",
            "false_longest",
        )
        check_fields(self, SHARE, "missed_rate", "false_rate")
        if self.false_longest < self.false_shortest:
            expected = f"at least false_shortest, {self.false_shortest:g}"
            raise InputError("SceneConfig.false_longest", expected, f"{self.false_longest:g}")

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
        shortest, longest = (
            max(round(duration / CONTROL_STEP), 1)
            for duration in (self.false_shortest, self.false_longest)
        )
        # A false scene of n readings in the mean begins after n (1 - rate) / rate true ones.
        true = (shortest + longest) / 2 * (1.0 - self.false_rate)
        begins = self.false_rate / (self.false_rate + true) if self.false_rate else 0.0
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
            begins=round(begins * 2**32),
            shortest=shortest,
            longest=longest,
            familiar=int(self.familiar),
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
    begins: int
    """Probability that a false scene begins while there is none, times 2^32."""
    shortest: int
    """Shortest and longest duration of a false scene (readings)."""
    longest: int
    familiar: int
    """1 if false scenes are those that the robot has passed, 0 if any."""


PASSED = 256
"""Number of scenes that a camera keeps of those that its robot has passed."""
CAMERA_STATE = 4 + PASSED
"""Length of a camera's state."""
_LEFT, _SCENE, _KEPT, _STRIDE = range(4)
"""Entries of a camera's state: number of readings for which the false scene still lasts, the false
scene, number of scenes kept, and number of readings from one kept scene to the next. The kept
scenes follow."""


@kernel()
def start_camera(camera: np.ndarray) -> None:
    """Start a camera that has seen nothing; `camera` is its state, (CAMERA_STATE,) int64."""
    camera[:] = 0
    camera[_STRIDE] = 1


@kernel()
def _pass_scene(scene: int, reading: int, camera: np.ndarray) -> None:
    """Keep the true scene of a reading, or not: those kept are spread evenly over the past."""
    if reading % camera[_STRIDE]:
        return
    if camera[_KEPT] == PASSED:  # Keep each second one, from now on at twice the distance.
        for k in range(PASSED // 2):
            camera[4 + k] = camera[4 + 2 * k]
        camera[_KEPT] = PASSED // 2
        camera[_STRIDE] *= 2
    if reading % camera[_STRIDE] == 0:
        camera[4 + camera[_KEPT]] = scene
        camera[_KEPT] += 1


@kernel(nogil=True)
def recognise_scene(
    x: float,
    y: float,
    heading: float,
    scenes: SceneConstants,
    key: np.uint64,
    counter: int,
    reading: int,
    camera: np.ndarray,
) -> int:
    """Return the number of the scene that a robot recognises; -1 for none.

    Args:
        x: Position of the robot, world frame (m).
        y: Position of the robot, world frame (m).
        heading: Heading of the robot (rad).
        scenes: The scenes.
        key: Key of the robot's random numbers.
        counter: Counter of the first of the SCENE_DRAWS random numbers of this reading.
        reading: Number of readings before this one.
        camera: The camera's state, (CAMERA_STATE,) int64, from `start_camera`; written over.
    """
    bits, other = draw(key, counter), draw(key, counter + 1)
    is_missed = np.int64(bits & np.uint64(0xFFFFFFFF)) < scenes.missed
    if camera[_LEFT] == 0 and not is_missed and np.int64(bits >> np.uint64(32)) < scenes.begins:
        if not scenes.familiar:
            camera[_SCENE] = np.int64(other >> np.uint64(11)) % scenes.scenes
        elif camera[_KEPT] > 0:
            camera[_SCENE] = camera[4 + np.int64(other >> np.uint64(11)) % camera[_KEPT]]
        if not scenes.familiar or camera[_KEPT] > 0:
            longer = np.int64(draw(key, counter + 2) >> np.uint64(11))
            camera[_LEFT] = scenes.shortest + longer % (scenes.longest - scenes.shortest + 1)
    if scenes.familiar:
        _pass_scene(scene_at(x, y, heading, scenes), reading, camera)
    if camera[_LEFT] > 0:
        camera[_LEFT] -= 1
        return -1 if is_missed else int(camera[_SCENE])
    if is_missed:
        return -1
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
