"""Incremental scan matching: each scan is placed where it best fits the latest ones.

The method of CARMEN's `vasco` (Thrun, Burgard and Fox, A real-time algorithm for mobile robot
mapping with applications to multi-robot and 3D mapping, ICRA 2000, section 2; Montemerlo, Roy and
Thrun, CARMEN, IROS 2003): the likeliest pose given the odometry and the map of the latest scans. No
loop is closed, so errors are never corrected. Vasco climbs from the odometer's pose; here the pose
is the best of a window (Olson, ICRA 2009).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import Estimate, MapperSpec, WayHome
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.local_map import LocalMap, MatchingConfig, scan_points
from albot_core.mappers.slam.way_home import Ground, RouteKeeper, WayHomeConfig
from albot_core.mappers.stored_arrays import check_finite, check_shapes
from albot_core.maps.layers import MapSnapshot, TrajectoryLayer
from albot_core.sensing.reading import Reading


@dataclass(frozen=True, kw_only=True)
class ScanMatchingConfig:
    """Parameters of incremental scan matching."""

    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Matching of a scan with the latest ones."""
    grid: GridConfig = field(default_factory=GridConfig)
    """The occupancy grid."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """Parameters of the search for the way home."""


class ScanMatching:
    """The mapper incremental scan matching, which knows a way home (`RouteHome`).

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    def __init__(
        self, config: ScanMatchingConfig | None = None, name: str = "scan-matching"
    ) -> None:
        self.config = config or ScanMatchingConfig()
        self._name = name
        self._local = LocalMap(self.config.matching)
        self._route = RouteKeeper(self.config.way_home)
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """The mapper's entry in the registry."""
        return mapper_spec(self._name)

    @property
    def estimate(self) -> Estimate:
        """The robot's pose by the latest match; the robot counts as lost if there was none."""
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3),
            localised=self._is_localised,
            updates=self._updates,
            map_version=self._updates,
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._local.reset()
        self._grid = LogOddsGrid(self.config.grid)
        self._pose = np.zeros(3)
        self._poses: list[Pose] = []
        self._updates = 0
        self._kept_at = -1  # The latest reading whose scan was added to the map.
        self._is_localised = True
        self._route.forget()

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its scan was added to the map.

        Raises:
            InputError: The reading lacks a laser scan, or the map would become larger than any
                building.
        """
        laser = reading.required_laser(self._name)
        scan = scan_points(laser, self.config.matching)
        if self._poses:
            match = self._local.match(scan, compose(self._pose, reading.motion))
            self._pose, self._is_localised = match.pose, match.is_good
            is_kept = self._local.is_due(match.pose)
        else:
            is_kept = True
        if is_kept:
            self._grid.integrate(self._pose, laser)
            self._local.keep(self._pose, scan.surface)
            self._updates += 1
            self._kept_at = len(self._poses)
        self._poses.append(self._pose)
        return is_kept

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over cells that are free in the map."""

        def ground() -> Ground:
            return self._grid.ground(self._trajectory()[: self._kept_at + 1, :2])

        return self._route.way_home(self._updates, self._pose, ground)

    def snapshot(self) -> MapSnapshot:
        """Return the grid and the trajectory."""
        return MapSnapshot(layers=(self._grid.layer(), TrajectoryLayer(poses=self._trajectory())))

    def state(self) -> dict[str, np.ndarray]:
        """Return the mapper's state as arrays by name."""
        return {
            "pose": self._pose.copy(),
            "poses": self._trajectory(),
            "counts": np.array((self._updates, self._kept_at, self._is_localised), np.int64),
            **self._local.state(),
            **self._grid.state(),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the state that `state` returned.

        Raises:
            InputError: The arrays are not a valid state.
        """
        check_shapes(state, {"pose": (3,), "poses": ("readings", 3), "counts": (3,)})
        check_finite(state, "pose", "poses")
        updates, kept_at, localised = state["counts"].tolist()
        readings = len(state["poses"])
        is_possible = 0 <= updates <= readings and -1 <= kept_at < readings
        if not is_possible or localised not in (0, 1):
            raise InputError("counts", "a count, a reading, 0 or 1", str(state["counts"].tolist()))
        grid = LogOddsGrid(self.config.grid)
        grid.restore(state)
        self._local.restore(state)
        self._grid = grid
        self._pose, self._poses = state["pose"].copy(), list(state["poses"].copy())
        self._updates, self._kept_at, self._is_localised = updates, kept_at, bool(localised)
        self._route.forget()

    def _trajectory(self) -> Poses:
        return np.array(self._poses).reshape(-1, 3)
