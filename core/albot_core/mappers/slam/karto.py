"""An adapter for OpenKarto, an independent SLAM system, as a baseline for comparison.

K. Konolige, G. Grisetti, R. Kümmerle, W. Burgard, B. Limketkai and R. Vincent, Efficient sparse
pose adjustment for 2D mapping, IROS 2010. OpenKarto is packaged for Python as `yag-slam` and
`karto-scanmatcher` (LGPL), which the extra `peers` installs. Its parameters are the package's
defaults. Only the input of readings, the output of poses, and the grid, which is drawn from the
scans at its poses, are ours.
"""

from __future__ import annotations

import importlib
import logging
import math
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import Estimate, WayHome
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.laser_state import check_laser, laser_numbers, laser_of
from albot_core.mappers.slam.way_home import Ground, RouteKeeper, WayHomeConfig
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, TrajectoryLayer
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, POSITIVE, check_fields
from albot_core.sensing.reading import LaserScan, Reading

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class KartoConfig:
    """Parameters of OpenKarto: the defaults of yag-slam 0.3.0 (`GraphSlam`, `default_config`)."""

    scan_buffer_len: int = 10
    """Number of latest scans that a scan is matched with."""
    loop_search_dist: float = 3.0
    """Largest distance of an earlier scan that is tried for a loop closure (m)."""
    loop_search_min_chain_size: int = 10
    """Smallest number of successive scans in a chain that is matched."""
    min_response_coarse: float = 0.35
    """Smallest response of the coarse match that closes a loop."""
    min_response_fine: float = 0.45
    """Smallest response of the fine match that closes a loop."""
    range_threshold: float = 20.0
    """Largest length of a beam that is matched (m)."""
    minimum_travel_distance: float = 0.0
    """Distance of the odometer since the last used scan after which a scan is used (m)."""
    minimum_travel_heading: float = 0.0
    """Turn of the odometer since the last used scan after which a scan is used (rad). OpenKarto's
    own defaults are 0.2 m and 10°; the package uses every scan."""
    grid: GridConfig = field(default_factory=GridConfig)
    """The occupancy grid that is drawn; not in OpenKarto."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """Parameters of the search for the way home; not in OpenKarto."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "loop_search_dist", "min_response_coarse", "min_response_fine",
            "range_threshold",
        )  # fmt: skip
        check_fields(self, NOT_NEGATIVE, "minimum_travel_distance", "minimum_travel_heading")
        check_fields(self, FROM_ONE, "scan_buffer_len", "loop_search_min_chain_size")


def _check_followed(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless every scan is followed by at least one reading, its own."""
    followed, scans = state["readings.followed"], sizes["scans"]
    is_right = np.array_equal(np.unique(followed), np.arange(scans))
    refuse_unless(is_right, "readings.followed", f"numbers that grow from 0 to {scans - 1}")


class Karto(StoredMapper):
    """OpenKarto as a mapper. A reading's scan is used once the robot has moved far enough.

    OpenKarto's memory cannot be saved as arrays. So the state holds the scans, and a restore runs
    OpenKarto on them again; the result is the same, since it is deterministic.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: KartoConfig
    SCHEMA = Schema(
        Field("laser", "6", at=None),
        Field("ranges", "scans beams", at=None, least=0, finite=False),
        Field("odometry", "scans 3", at=None),
        Field("readings.offset", "readings 3", at="_offsets"),
        Field("readings.followed", "readings", int, least=0, below="scans", rising=True),
        rules=(_check_followed, check_laser),
    )

    def __init__(self, config: KartoConfig | None = None, name: str = "karto") -> None:
        config = config or KartoConfig()
        self._route = RouteKeeper(config.way_home)
        super().__init__(config, name)

    @property
    def estimate(self) -> Estimate:
        """OpenKarto's pose of the latest scan, moved by the odometry since then."""
        return Estimate(
            pose=compose(self._pose_of(-1), self._offsets[-1]) if self._scans else np.zeros(3),
            home=np.zeros(3),
            updates=len(self._scans),
            map_version=len(self._scans),
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._route.forget()
        self._scans: list[LaserScan] = []
        self._odometry: list[Pose] = []  # Of each scan.
        self._offsets: list[Pose] = []  # Of each reading: the odometry since its scan.
        self._followed: list[int] = []  # Of each reading: the index of its scan.
        self._karto = self._fresh()
        self._drawn: tuple[Poses, LogOddsGrid] | None = None

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its scan was passed to OpenKarto.

        Raises:
            InputError: The reading lacks a laser scan, or its laser differs from earlier ones.
        """
        laser = reading.required_laser(self._name)
        if self._scans and laser.geometry != self._scans[0].geometry:
            raise InputError("Reading.laser", "the same laser at each reading", "another one")
        offset, is_due = np.zeros(3), True
        if self._scans:
            offset = compose(self._offsets[-1], reading.motion)
            is_due = self._has_moved_enough(offset)
        if is_due:
            before = self._odometry[-1] if self._scans else np.zeros(3)
            self._process(laser, compose(before, offset))
            offset = np.zeros(3)
        self._followed.append(len(self._scans) - 1)
        self._offsets.append(offset)
        return is_due

    def _has_moved_enough(self, offset: Pose) -> bool:
        """Return whether the odometer moved or turned far enough since the last scan."""
        x, y, turn = offset.tolist()
        far = math.hypot(x, y) >= self.config.minimum_travel_distance
        return far or abs(turn) >= self.config.minimum_travel_heading

    def _fresh(self) -> Any:
        graph_slam = importlib.import_module("yag_slam.graph_slam")
        matching = importlib.import_module("yag_slam.scan_matching")
        thresholds = {"range_threshold": self.config.range_threshold}
        config = self.config
        return graph_slam.GraphSlam(
            matching.Scan2DMatcherCpp(thresholds),
            matching.Scan2DMatcherCpp(thresholds, loop=True),
            scan_buffer_len=config.scan_buffer_len,
            loop_search_dist=config.loop_search_dist,
            loop_search_min_chain_size=config.loop_search_min_chain_size,
            min_response_coarse=config.min_response_coarse,
            min_response_fine=config.min_response_fine,
        )

    def _process(self, laser: LaserScan, pose: Pose) -> None:
        """Pass a scan to OpenKarto, at the odometer's pose of the robot."""
        models = importlib.import_module("yag_slam.models")
        geometry = laser.geometry
        at = compose(pose, np.array(geometry.mount))
        # OpenKarto ignores ranges of 0. With infinity or the maximum range, loops close worse.
        ranges = np.where(laser.ranges < geometry.max_range, laser.ranges, 0.0)
        last = geometry.first_bearing + geometry.spacing * (geometry.beams - 1)
        scan = models.LocalizedRangeScan(
            ranges.tolist(),
            geometry.first_bearing,
            last,
            geometry.spacing,
            0.0,
            geometry.max_range,
            self.config.range_threshold,
            *at.tolist(),
        )
        # OpenKarto prints its warnings to standard output, which would mix with our own output.
        with redirect_stdout(StringIO()) as output:
            self._karto.process_scan(scan)
        for line in output.getvalue().splitlines():
            _log.info("%s: %s", self._name, line)
        self._scans.append(laser)
        self._odometry.append(pose)

    def _pose_of(self, number: int) -> Pose:
        """Return OpenKarto's pose of the robot at a scan; the first pose is the origin."""
        at = self._karto.graph.vertices[number].obj.corrected_pose
        mount = np.array(self._scans[number].geometry.mount)
        laser = np.array((at.x, at.y, at.euler[-1]))
        return compose(laser, relative(mount, np.zeros(3)))

    def corrected_poses(self) -> Poses:
        """Return the robot's pose at every reading since the reset, as estimated now."""
        if not self._followed:
            return np.empty((0, 3))
        return compose(self._scan_poses()[self._followed], np.array(self._offsets))

    def _scan_poses(self) -> Poses:
        """Return the robot's pose at every scan, as estimated now."""
        return np.array([self._pose_of(k) for k in range(len(self._scans))]).reshape(-1, 3)

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over cells that are free in the map."""

        def ground() -> Ground:
            return self._grid().ground(self._scan_poses()[:, :2])

        return self._route.way_home(len(self._scans), self.estimate.pose, ground)

    def snapshot(self) -> MapSnapshot:
        """Return the grid of all scans, and the corrected trajectory."""
        way = TrajectoryLayer(poses=self.corrected_poses())
        return MapSnapshot(layers=(self._grid().layer(), way))

    def _grid(self) -> LogOddsGrid:
        """Return the grid of all scans; only new ones are added if no pose was corrected."""
        poses = self._scan_poses()
        drawn, grid = self._drawn or (poses[:0], LogOddsGrid(self.config.grid))
        done = len(drawn)
        if not np.array_equal(drawn, poses[:done]):
            done, grid = 0, LogOddsGrid(self.config.grid)
        for pose, scan in zip(poses[done:], self._scans[done:], strict=True):
            grid.integrate(pose, scan)
        self._drawn = poses, grid
        return grid

    def _stored(self) -> dict[str, Any]:
        laser, ranges = laser_numbers(self._scans)
        return {"laser": laser, "ranges": ranges, "odometry": self._odometry}

    def _restored(self, state: Arrays) -> None:
        """Run OpenKarto over the scans anew."""
        laser = laser_of(state["laser"], state["ranges"].shape[1])
        for ranges, pose in zip(state["ranges"].copy(), state["odometry"].copy(), strict=True):
            self._process(LaserScan(ranges=ranges, geometry=laser), pose)

    def __getstate__(self) -> dict[str, Any]:
        """Return config, name and state; OpenKarto's own memory cannot be copied."""
        return {"config": self.config, "name": self._name, "state": self.state()}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        Karto.__init__(self, kept["config"], kept["name"])
        self.restore(kept["state"])
