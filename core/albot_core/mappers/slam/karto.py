"""An adapter for OpenKarto, a SLAM system that none of us wrote: the yardstick.

K. Konolige, G. Grisetti, R. Kümmerle, W. Burgard, B. Limketkai and R. Vincent, Efficient sparse
pose adjustment for 2D mapping, IROS 2010. OpenKarto is packaged for Python as `yag-slam` and
`karto-scanmatcher` (LGPL), which the extra `peers` brings. Its thresholds are the package's own
defaults. What is ours is only how readings go in and poses come out, and the grid, which is drawn
of the scans at its poses.
"""

from __future__ import annotations

import importlib
import logging
import math
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import Estimate, MapperSpec, WayHome
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.scan_matching import believed_motion
from albot_core.mappers.slam.way_home import Ground, RouteKeeper, WayHomeConfig
from albot_core.mappers.stored_arrays import check_finite, check_shapes
from albot_core.maps.layers import MapSnapshot, TrajectoryLayer
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading

_log = logging.getLogger(__name__)
_FROM_ONE = Range("a whole number from 1", 1.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class KartoConfig:
    """Thresholds of OpenKarto: the defaults of yag-slam 0.3.0 (`GraphSlam`, `default_config`)."""

    scan_buffer_len: int = 10
    """So many of the latest scans are matched with."""
    loop_search_dist: float = 3.0
    """Earlier scans so near are tried for a loop (m)."""
    loop_search_min_chain_size: int = 10
    """So many in a row make a chain to match with."""
    min_response_coarse: float = 0.35
    """Least response of the coarse match that closes a loop…"""
    min_response_fine: float = 0.45
    """…and of the fine one."""
    range_threshold: float = 20.0
    """Beams that are longer are not matched (m)."""
    minimum_travel_distance: float = 0.0
    """A scan is handed over once the odometer has gone so far since the last (m)…"""
    minimum_travel_heading: float = 0.0
    """…or has turned so far (rad). OpenKarto's own are 0.2 m and 10°; the package takes every
    scan."""
    grid: GridConfig = field(default_factory=GridConfig)
    """The occupancy grid that is drawn: ours."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """How the way home is found over it: ours."""
    longest_step: float = 10.0
    """A longer motion between two readings is not believed (m): ours."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "loop_search_dist", "min_response_coarse", "min_response_fine",
            "range_threshold", "longest_step",
        )  # fmt: skip
        check_fields(self, NOT_NEGATIVE, "minimum_travel_distance", "minimum_travel_heading")
        check_fields(self, _FROM_ONE, "scan_buffer_len", "loop_search_min_chain_size")


class Karto:
    """OpenKarto as a mapper: a reading whose robot has moved enough is a scan of its graph.

    Its memory cannot be written down as arrays and taken back. So the state is the scans, and
    restoring is running it again over them, which comes to the same since it is deterministic.

    Args:
        config: All thresholds.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: KartoConfig | None = None, name: str = "karto") -> None:
        self.config = config or KartoConfig()
        self._name = name
        self._route = RouteKeeper(self.config.way_home)
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """What is known of it by its name."""
        return mapper_spec(self._name)

    @property
    def estimate(self) -> Estimate:
        """Where OpenKarto believes that the latest scan was taken, and the odometer's way since."""
        return Estimate(
            pose=compose(self._pose_of(-1), self._offsets[-1]) if self._scans else np.zeros(3),
            home=np.zeros(3),
            updates=len(self._scans),
            map_version=len(self._scans),
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. It draws no random number."""
        self._route.forget()
        self._scans: list[LaserScan] = []
        self._odometry: list[Pose] = []  # Of each scan.
        self._offsets: list[Pose] = []  # Of each reading, by the odometer from the scan…
        self._followed: list[int] = []  # …which is this.
        self._karto = self._fresh()
        self._drawn: tuple[Poses, LogOddsGrid] | None = None

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where its scan was handed over.

        Raises:
            InputError: The reading lacks a laser scan, or its laser is another one than before.
        """
        laser = reading.required_laser(self._name)
        if self._scans and laser.geometry != self._scans[0].geometry:
            raise InputError("Reading.laser", "the same laser at each reading", "another one")
        offset, is_due = np.zeros(3), True
        if self._scans:
            motion, _ = believed_motion(reading, self.config.longest_step, self._name)
            offset = compose(self._offsets[-1], motion)
            is_due = self._has_moved_enough(offset)
        if is_due:
            before = self._odometry[-1] if self._scans else np.zeros(3)
            self._process(laser, compose(before, offset))
            offset = np.zeros(3)
        self._followed.append(len(self._scans) - 1)
        self._offsets.append(offset)
        return is_due

    def _has_moved_enough(self, offset: Pose) -> bool:
        """Whether the robot has gone or turned so far since the last scan, by the odometer."""
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
        """Let OpenKarto take in a scan, by the odometer's pose of the laser."""
        models = importlib.import_module("yag_slam.models")
        geometry = laser.geometry
        at = compose(pose, np.array(geometry.mount))
        # It passes over ranges of 0. As infinity or as the laser's greatest, its loops close worse.
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
        # It tells its doubts by `print`, among what is meant for standard output.
        with redirect_stdout(StringIO()) as told:
            self._karto.process_scan(scan)
        for line in told.getvalue().splitlines():
            _log.info("%s: %s", self._name, line)
        self._scans.append(laser)
        self._odometry.append(pose)

    def _pose_of(self, number: int) -> Pose:
        """Where OpenKarto believes that the robot was at a scan, the first being the origin."""
        at = self._karto.graph.vertices[number].obj.corrected_pose
        mount = np.array(self._scans[number].geometry.mount)
        laser = np.array((at.x, at.y, at.euler[-1]))
        return compose(laser, relative(mount, np.zeros(3)))

    def corrected_poses(self) -> Poses:
        """The robot's pose at every reading since the reset, as believed now."""
        if not self._followed:
            return np.empty((0, 3))
        return compose(self._scan_poses()[self._followed], np.array(self._offsets))

    def _scan_poses(self) -> Poses:
        """The robot's pose at every scan, as believed now."""
        return np.array([self._pose_of(k) for k in range(len(self._scans))]).reshape(-1, 3)

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over cells that are believed to be free."""

        def ground() -> Ground:
            return self._grid().ground(self._scan_poses()[:, :2])

        return self._route.way_home(len(self._scans), self.estimate.pose, ground)

    def snapshot(self) -> MapSnapshot:
        """The grid of all scans, and the corrected way."""
        way = TrajectoryLayer(poses=self.corrected_poses())
        return MapSnapshot(layers=(self._grid().layer(), way))

    def _grid(self) -> LogOddsGrid:
        """The grid, drawn of all scans; only what is new, where no earlier pose has moved."""
        poses = self._scan_poses()
        drawn, grid = self._drawn or (poses[:0], LogOddsGrid(self.config.grid))
        done = len(drawn)
        if not np.array_equal(drawn, poses[:done]):
            done, grid = 0, LogOddsGrid(self.config.grid)
        for pose, scan in zip(poses[done:], self._scans[done:], strict=True):
            grid.integrate(pose, scan)
        self._drawn = poses, grid
        return grid

    def state(self) -> dict[str, np.ndarray]:
        """The scans that were handed over, and the readings' ways from them, as arrays by name."""
        laser = self._scans[0].geometry if self._scans else LaserGeometry(beams=2)
        numbers = (laser.first_bearing, laser.spacing, laser.max_range, *laser.mount)
        ranges = [scan.ranges for scan in self._scans]
        return {
            "laser": np.array(numbers),
            "ranges": np.array(ranges).reshape(-1, laser.beams),
            "odometry": np.array(self._odometry).reshape(-1, 3),
            "readings.offset": np.array(self._offsets).reshape(-1, 3),
            "readings.followed": np.array(self._followed, np.int64),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`, by taking in its scans again.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        shapes: dict[str, tuple[str | int, ...]] = {
            "laser": (6,),
            "ranges": ("scans", "beams"),
            "odometry": ("scans", 3),
            "readings.offset": ("readings", 3),
            "readings.followed": ("readings",),
        }
        check_shapes(state, shapes)
        check_finite(state, "laser", "odometry", "readings.offset")
        followed, scans = state["readings.followed"], len(state["ranges"])
        # From the first scan to the last, each followed by its own reading at least.
        if (
            not np.array_equal(np.unique(followed), np.arange(scans))
            or (np.diff(followed) < 0).any()
        ):
            raise InputError(
                "readings.followed", f"numbers that grow from 0 to {scans - 1}", "others"
            )
        first_bearing, spacing, most, *mount = state["laser"].tolist()
        try:
            laser = LaserGeometry(
                beams=state["ranges"].shape[1],
                first_bearing=first_bearing,
                spacing=spacing,
                max_range=most,
                mount=(mount[0], mount[1], mount[2]),
            )
        except InputError as error:
            raise InputError("laser", error.expected, error.found) from None
        self.reset(np.random.default_rng(0))
        for ranges, pose in zip(state["ranges"].copy(), state["odometry"].copy(), strict=True):
            self._process(LaserScan(ranges=ranges, geometry=laser), pose)
        self._followed = followed.tolist()
        self._offsets = list(state["readings.offset"].copy())

    def __getstate__(self) -> dict[str, Any]:
        """The readings; OpenKarto's own memory cannot be copied."""
        return {"config": self.config, "name": self._name, "state": self.state()}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        Karto.__init__(self, kept["config"], kept["name"])
        self.restore(kept["state"])
