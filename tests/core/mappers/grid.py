"""A small grid mapper: particles by the odometer's noise, and one occupancy grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from albot_core.geometry.poses import compose, transform_points
from albot_core.geometry.types import Poses
from albot_core.mappers.mapper import Estimate, MapperSpec
from albot_core.mappers.random_state import generator_of, generator_state
from albot_core.mappers.registry import mapper_spec, register_mapper
from albot_core.maps.layers import (
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    TrajectoryLayer,
)
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, POSITIVE, check_fields
from albot_core.sensing.reading import Reading


@dataclass(frozen=True, kw_only=True)
class GridConfig:
    """Thresholds of the grid mapper."""

    particles: int = 20
    """How many samples of the pose are kept."""
    noise: float = 0.01
    """Standard deviation of a step's error, of its length (m) and of its turn (rad)."""
    side: int = 128
    """Cells along each side of the grid."""
    resolution: float = 0.25
    """Side of a cell (m)."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "particles", "side")
        check_fields(self, NOT_NEGATIVE, "noise")
        check_fields(self, POSITIVE, "resolution")


class GridMapper:
    """Marks the cells in which beams end. The pose is the particles' mean."""

    def __init__(self, config: GridConfig | None = None, name: str = "grid") -> None:
        self.config = config or GridConfig()
        self._name = name
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        return mapper_spec(self._name)

    def reset(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._particles = np.zeros((self.config.particles, 3))
        self._log_odds = np.zeros((self.config.side, self.config.side), np.float32)
        self._poses = np.empty((0, 3))

    @property
    def estimate(self) -> Estimate:
        pose = self._poses[-1] if len(self._poses) else np.zeros(3)
        count = len(self._poses)
        return Estimate(pose=pose.copy(), home=np.zeros(3), updates=count, map_version=count)

    def update(self, reading: Reading) -> bool:
        laser = reading.required_laser(self._name)
        if len(self._poses):
            noise = self._rng.normal(0, self.config.noise, self._particles.shape)
            self._particles = compose(self._particles, reading.motion + noise)
        self._poses = np.concatenate((self._poses, self._particles.mean(axis=0)[None]))
        points = transform_points(self._poses[-1], laser.points)
        cells = np.floor(points / self.config.resolution).astype(int) + self.config.side // 2
        column, row = cells[((cells >= 0) & (cells < self.config.side)).all(axis=1)].T
        self._log_odds[row, column] += 0.4
        return True

    def snapshot(self) -> MapSnapshot:
        corner = -0.5 * self.config.side * self.config.resolution
        chances = 1 - 1 / (1 + np.exp(self._log_odds))
        grid = OccupancyGridLayer(
            origin=np.array((corner, corner, 0.0)),
            resolution=self.config.resolution,
            occupancy=np.where(self._log_odds == 0, np.nan, chances).astype(np.float32),
        )
        count = self.config.particles
        particles = ParticlesLayer(poses=self._particles.copy(), weights=np.full(count, 1 / count))
        return MapSnapshot(layers=(grid, TrajectoryLayer(poses=self._poses.copy()), particles))

    def corrected_poses(self) -> Poses:
        return self._poses.copy()

    def state(self) -> dict[str, np.ndarray]:
        return {
            "particles": self._particles.copy(),
            "log_odds": self._log_odds.copy(),
            "poses": self._poses.copy(),
            "rng": generator_state(self._rng),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        self._particles = state["particles"].copy()
        self._log_odds = state["log_odds"].copy()
        self._poses = state["poses"].copy()
        self._rng = generator_of(state["rng"])


register_mapper(
    MapperSpec(
        name="grid",
        summary="Particles by the odometer's noise, and one occupancy grid.",
        paper="none",
        sensors=frozenset({"laser"}),
        layers=("occupancy_grid", "trajectory", "particles"),
        factory=f"{__name__}:GridMapper",
        config=f"{__name__}:GridConfig",
    )
)
