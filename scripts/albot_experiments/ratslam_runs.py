"""Runs of RatSLAM on a journey: the resulting maps, measured and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.evaluation.trajectory import align
from albot_core.geometry.poses import transform_points, wrap_angle
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.ratslam.config import CorrectionConfig, RatSlamConfig
from albot_core.mappers.ratslam.events import RELOCALISED
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.sensing.reading import Reading
from albot_experiments.drawing import FLOOR, MARK, PATH, SURFACE, draw_floor
from albot_maps.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CORRECTED = RatSlamConfig.scenes()
"""Config of the mapper that sees scenes."""
LETTER = RatSlamConfig.paper()
"""Config of the mapper that follows the paper to the letter, `ratslam-paper`."""
UNCORRECTED = replace(CORRECTED, correction=CorrectionConfig(passes=0))
"""The same config without map correction."""
SAME_PLACE = 2.0
"""Distance beyond which an experience counts as made at another place (m)."""
_NEAR, _ALIGNED = 0.5, np.radians(30.0)
"""Experiences made within this distance and turn represent one place (m, rad)."""
_SQUARE, _LEFT = 0.5, 100
"""Side of a square of the floor (m), and number of readings outside it before a revisit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """RatSLAM at the end of a journey."""

    mapper: RatSlam
    truth: Poses
    """(readings, 3): the robot's true poses."""
    packets: Float64[np.ndarray, "readings 3"]
    """The largest packet at every reading, in cells."""
    counts: Int64[np.ndarray, "readings"]
    """Number of experiences at every reading."""
    places: Int64[np.ndarray, "readings"]
    """The active experience at every reading."""
    grown: int
    """Number of times that a link from a view to a pose cell grew stronger."""
    weakened: int
    """Number of times that one grew weaker; Hebbian learning (section 3.4) weakens none."""

    @cached_property
    def made_at(self) -> Poses:
        """True pose of the robot at which each experience was made."""
        return np.asarray(self.truth[self.mapper.experiences.experiences.rows("reading")])

    @cached_property
    def frame(self) -> Pose:
        """Pose of the map's frame on the floor for which the experiences fit best."""
        return align(self.mapper.experiences.poses[:, :2], self.made_at[:, :2])

    @property
    def error(self) -> float:
        """Root mean squared distance of the experiences from where they were made (m)."""
        points = transform_points(self.frame, self.mapper.experiences.poses[:, :2])
        return _rms(points, self.made_at)

    @property
    def path_error(self) -> float:
        """Root mean squared distance of all corrected poses from the true ones (m)."""
        points = transform_points(self.frame, self.mapper.corrected_poses()[:, :2])
        return _rms(points, self.truth)

    def growth(self, readings: int) -> int:
        """Return the number of experiences made in the last `readings` readings."""
        return int(self.counts[-1] - self.counts[-1 - readings])

    @cached_property
    def is_elsewhere(self) -> Bool[np.ndarray, "readings"]:
        """Whether the robot was away from where its experience was made, at every reading."""
        away = np.hypot(*(self.truth - self.made_at[self.places])[:, :2].T)
        return np.asarray(away > SAME_PLACE)

    @property
    def longest_elsewhere(self) -> int:
        """Largest number of readings in a row at which the robot was elsewhere."""
        edges = np.flatnonzero(np.diff(self.is_elsewhere, prepend=False, append=False))
        return int(np.diff(edges)[::2].max(initial=0))

    @cached_property
    def revisits(self) -> Float64[np.ndarray, "revisits"]:
        """Distances of revisits from the first visits in the map, in excess of the truth (m).

        A revisit is when the robot enters a square of the floor that it left long before.
        """
        off = transform_points(self.frame, self.mapper.corrected_poses()[:, :2]) - self.truth[:, :2]
        squares = np.floor(self.truth[:, :2] / _SQUARE).astype(int).tolist()
        first: dict[tuple[int, ...], int] = {}
        last: dict[tuple[int, ...], int] = {}
        apart = []
        for k, square in enumerate(map(tuple, squares)):
            if k - last.get(square, k) > _LEFT:
                apart.append(np.hypot(*(off[k] - off[first[square]])))
            first.setdefault(square, k)
            last[square] = k
        return np.array(apart)

    @property
    def revisits_within_a_metre(self) -> float:
        """Share of the revisits below 1 m; 1 if there are none."""
        return float(np.mean(self.revisits < 1.0)) if len(self.revisits) else 1.0

    @property
    def relocalisations(self) -> int:
        """Number of re-localisations."""
        return sum(event.kind == RELOCALISED for event in self.mapper.events)

    @cached_property
    def represented(self) -> tuple[int, int]:
        """Numbers of multiple representations and of hash collisions.

        A multiple representation (section 3.6) is an experience made within 0.5 m and 30° of
        another, with other pose cells. A hash collision (section 3.7) is an experience whose zone
        contains the pose cells of another one that was made elsewhere.
        """
        config = self.mapper.config
        cells = self.mapper.experiences.experiences.rows("cell").copy()
        size = np.array(
            (config.pose_cells.columns, config.pose_cells.rows, config.pose_cells.headings)
        )
        multiple, collided = 0, 0
        for k in range(len(cells)):
            apart = np.abs(cells - cells[k])
            apart = np.minimum(apart, size - apart)
            same_cells = np.hypot(*apart[:, :2].T) * config.pose_cells.cell < (
                config.experiences.radius
            )
            same_cells &= apart[:, 2] * config.pose_cells.cell_turn < config.experiences.turn
            away = np.hypot(*(self.made_at - self.made_at[k])[:, :2].T)
            turned = np.abs(wrap_angle(self.made_at[:, 2] - self.made_at[k, 2]))
            multiple += bool(((away < _NEAR) & (turned < _ALIGNED) & ~same_cells).any())
            collided += bool(((away > SAME_PLACE) & same_cells).any())
        return multiple, collided


def _rms(points: Points, truth: Poses) -> float:
    off = points - truth[:, :2]
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def follow(readings: Sequence[Reading], truth: Poses, config: RatSlamConfig) -> Run:
    """Run a fresh mapper on the readings."""
    mapper = RatSlam(config, "ratslam" if config.sees == "laser" else "ratslam-scenes")
    packets, counts = np.empty((len(readings), 3)), np.zeros(len(readings), np.int64)
    grown = weakened = 0
    for k, reading in enumerate(readings):
        strengths = mapper.link_strengths.copy()
        mapper.update(reading)
        now = mapper.link_strengths[: len(strengths)]
        grown += int((now > strengths).sum())
        weakened += int((now < strengths).sum())
        packets[k] = mapper.packet[:3]
        counts[k] = mapper.experiences.count
    places = np.array([mapper.place_at(k) for k in range(len(readings))])
    return Run(
        mapper=mapper,
        truth=truth,
        packets=packets,
        counts=counts,
        places=places,
        grown=grown,
        weakened=weakened,
    )


def draw_pose_cells(axes: Axes, run: Run) -> None:
    """Draw the packet's path in (x', y'): re-localisations thin, jumps by wrapping left out."""
    cells = run.packets[:, :2]
    leaps = np.abs(np.diff(cells, axis=0)).max(axis=1)
    size = run.mapper.config.pose_cells
    for least, most, width in ((0.0, 2.0, 1.2), (2.0, min(size.columns, size.rows) / 2, 0.3)):
        here = np.where(((leaps >= least) & (leaps < most))[:, None], cells[1:], np.nan)
        there = np.where(((leaps >= least) & (leaps < most))[:, None], cells[:-1], np.nan)
        pairs = np.stack((there, here, np.full_like(here, np.nan)), axis=1).reshape(-1, 2)
        axes.plot(pairs[:, 0], pairs[:, 1], color=PATH if most == 2.0 else SURFACE, lw=width)
    axes.set(aspect="equal", xlim=(0, size.columns), ylim=(0, size.rows), xlabel="x'", ylabel="y'")


def draw_experiences(axes: Axes, run: Run, world: World | None) -> None:
    """Draw the experience map, on the floor if there is one."""
    poses = transform_points(run.frame, run.mapper.experiences.poses[:, :2])
    if world is not None:
        draw_floor(axes, world.walls, FLOOR)
    links = run.mapper.experiences.links
    ends = np.stack(
        (
            poses[links.rows("source")],
            poses[links.rows("target")],
            np.full((links.count, 2), np.nan),
        ),
        axis=1,
    ).reshape(-1, 2)
    axes.plot(ends[:, 0], ends[:, 1], color=SURFACE, lw=0.5, label="transitions")
    axes.plot(poses[:, 0], poses[:, 1], ".", color=MARK, ms=3, ls="none", label="experiences")
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()
