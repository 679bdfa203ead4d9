"""Incremental scan matching: each scan is placed where it best fits the latest ones.

The method of CARMEN's `vasco` (Thrun, Burgard and Fox, A real-time algorithm for mobile robot
mapping with applications to multi-robot and 3D mapping, ICRA 2000, section 2; Montemerlo, Roy and
Thrun, CARMEN, IROS 2003): the likeliest pose given the odometry and the map of the latest scans. No
loop is closed, so errors are never corrected. Vasco climbs from the odometer's pose; here the pose
is the best of a window (Olson, ICRA 2009).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import Estimate, WayHome
from albot_core.mappers.schema import Field, Pack, Schema
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.local_map import LocalMap, MatchingConfig, scan_points
from albot_core.mappers.slam.way_home import Ground, RouteKeeper, WayHomeConfig
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, TrajectoryLayer
from albot_core.sensing.reading import LaserScan, Reading


@dataclass(frozen=True, kw_only=True)
class ScanMatchingConfig:
    """Parameters of incremental scan matching."""

    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Matching of a scan with the latest ones."""
    grid: GridConfig = field(default_factory=GridConfig)
    """The occupancy grid."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """Parameters of the search for the way home."""


class ScanMatching(StoredMapper):
    """The mapper incremental scan matching, which knows a way home (`RouteHome`).

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: ScanMatchingConfig
    SCHEMA = Schema(
        Field("pose", "3"),
        Field("poses", "readings 3"),
        Pack(
            "counts",
            int,
            Field("updates", least=0, most="readings"),
            Field("kept_at", least=-1, below="readings"),
            Field("is_localised", "", bool),
        ),
        parts=("_local", "_grid"),
    )

    def __init__(
        self, config: ScanMatchingConfig | None = None, name: str = "scan-matching"
    ) -> None:
        config = config or ScanMatchingConfig()
        self._local, self._route = LocalMap(config.matching), RouteKeeper(config.way_home)
        super().__init__(config, name)

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

    def resume(self, pose: Pose, scan: LaserScan) -> None:
        """Continue at a pose on the map; the next reading's motion begins there.

        As always, later scans are matched with the latest ones alone.
        """
        self._local.reset()
        self._local.keep(pose, scan_points(scan, self.config.matching).surface)
        self._pose, self._is_localised = pose, True

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over cells that are free in the map."""

        def ground() -> Ground:
            return self._grid.ground(self._trajectory()[: self._kept_at + 1, :2])

        return self._route.way_home(self._updates, self._pose, ground)

    def snapshot(self) -> MapSnapshot:
        """Return the grid and the trajectory."""
        return MapSnapshot(layers=(self._grid.layer(), TrajectoryLayer(poses=self._trajectory())))

    def _trajectory(self) -> Poses:
        return np.array(self._poses).reshape(-1, 3)
