"""The slow way to observe, one robot at a time: the oracle of the compiled observation builder.

An observation is a function of the readings alone: the laser and the motion come from the
reading, the rest from the mapper, which saw nothing but readings.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Float32, Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, Mapper, RouteHome, require
from albot_core.sensing.reading import LaserScan, Reading
from albot_env.tasks.core.coverage import CoverageConfig, empty_coverage, with_coverage
from albot_env.tasks.core.coverage_kernels import (
    CoverageGrid,
    accumulate_motion,
    cover,
    cut_patch,
    find_frontier,
)
from albot_env.tasks.core.observation import PART_NAMES, ObservationConfig, Parts
from albot_env.tasks.core.onward_kernels import find_onward, pick_onward
from albot_env.tasks.core.parts.beliefs import (
    observe_confidence,
    observe_exit,
    observe_home,
    observe_time,
    observe_way,
)
from albot_env.tasks.core.parts.part import Need
from albot_env.tasks.core.parts.scales import scale_ranges
from albot_env.tasks.core.parts.sensors import find_nearest, observe_motion
from albot_env.tasks.core.wayfinding import WayfindingConfig, empty_occupancy, with_occupancy
from albot_env.tasks.core.wayfinding_kernels import (
    find_path,
    find_shortcut,
    pick_shortcut,
    update_occupancy,
)


def observe(
    config: ObservationConfig,
    reading: Reading,
    mapper: Mapper,
    coverage: Coverage,
    time_left: float = math.inf,
    wayfinding: Wayfinding | None = None,
) -> Parts:
    """The observation after a reading, with so much time left (s).

    What the parts are, see `ObservationConfig`.

    Raises:
        InputError: There is no wayfinding, and ways over the ground are shown.
    """
    if config.needs(Need.OCCUPANCY) and wayfinding is None:
        raise InputError("observe", "a Wayfinding that has followed the robot", "None")
    way = np.full(7, np.nan)
    if config.needs(Need.WAY_HOME):
        way = require(mapper, RouteHome).way_home
    estimate = mapper.estimate
    home, pose = estimate.home_from_robot, estimate.pose
    flags = estimate.matched_reading is not None, not estimate.localised
    laser = reading.required_laser("observe")
    scale = config.scales.home
    parts = {name: np.empty(shape, np.float32) for name, shape in config.shapes.items()}
    shown = parts | {name: np.empty(6, np.float32) for name in PART_NAMES if name not in parts}
    observe_motion(reading.motion, config.step_length, config.step_turn, shown["motion"])
    shown["heading"][:2] = np.cos(home[2]), -np.sin(home[2])
    observe_home(home, scale, shown["home"])
    shown["confidence"][0] = observe_confidence(way[TRAVEL], config.home_drift, config.home_near)
    shown["place"][:2] = np.where(flags, 1, -1)
    observe_exit(pose, way[EXIT], scale, shown["exit"])
    observe_way(pose, way[POINT], scale, shown["way"])
    if wayfinding is not None:
        shortcut = wayfinding.shortcut(way[TRAVEL])
        observe_way(pose, shortcut, scale, shown["shortcut"])
        observe_way(pose, wayfinding.path, scale, shown["path"])
        observe_way(pose, wayfinding.onward, scale, shown["onward"])
    if "laser" in parts:
        parts["laser"] = observe_ranges(config, laser.ranges)
    if "sonar" in parts and reading.sonar is not None:
        echoes = reading.sonar.ranges
        scale_ranges(echoes, config.scales.sonar, parts["sonar"])
    if "coverage" in parts:
        parts["coverage"] = coverage.patch(pose)
    if "frontier" in parts:
        found = coverage.frontier(pose, laser, len(parts["frontier"]))
        scale_ranges(found, config.scales.laser, parts["frontier"])
    shown["time_left"][0] = observe_time(time_left, config.scales.time)
    return parts


def observe_ranges(
    config: ObservationConfig, ranges: Float[np.ndarray, "beams"]
) -> Float32[np.ndarray, "shown"]:
    """Ranges (m) as the `laser` part shows them: 1 at 0, -1 at `laser_range` and beyond."""
    shown = np.asarray(ranges, np.float64)
    if config.laser_sectors is not None:
        beams, shown = shown, np.empty(config.laser_sectors)
        find_nearest(beams, shown)
    scaled = np.empty(len(shown), np.float32)
    scale_ranges(shown, config.scales.laser, scaled)
    return scaled


class Coverage:
    """A square of ground, covered cell by cell.

    Kept once in the map's frame with the believed pose, for the agent to see, and once in
    the world's with the true one, for the reward. CoverageGrid beyond the square is never covered.

    Args:
        config: When ground counts as covered.
        extent: Half the side of the square (m).
        centre: The middle of the square x, y (m).
    """

    def __init__(
        self, config: CoverageConfig, extent: float, centre: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._config = config
        self._ground = with_coverage(empty_coverage(1, config.cell), 0, config.side(extent), centre)
        self._cells = 0
        self._moved = np.full(2, np.inf)

    @property
    def ground(self) -> CoverageGrid:
        """The ground as the compiled loops take it."""
        return self._ground

    @property
    def area(self) -> float:
        """Ground covered (m²)."""
        return self._cells * self._config.cell**2

    def clear(self) -> None:
        """Uncover everything."""
        self._ground.grids.fill(0)
        self._cells = 0
        self._moved[:] = np.inf

    def add(self, pose: Pose, scan: LaserScan) -> float:
        """Cover the ground that a scan taken at `pose` shows; return how much is new (m²)."""
        config = self._config
        sensor = config.sensor(scan.geometry)
        new = cover(self._ground, 0, pose, _turn(pose), sensor, scan.ranges)
        self._cells += new
        return new * config.cell**2

    def follow(self, motion: Pose, pose: Pose, scan: LaserScan) -> None:
        """Cover the ground that a scan shows where the robot has moved enough since the last.

        Args:
            motion: How it has moved since it was last followed.
            pose: Where it is.
            scan: What it sees there.
        """
        config = self._config
        if accumulate_motion(motion, config.spacing, config.turn, self._moved):
            self.add(pose, scan)

    def patch(self, pose: Pose) -> Float32[np.ndarray, "1 side side"]:
        """The cells around `pose`, turned with it: 1 covered, -1 not.

        Row 0 lies farthest ahead, column 0 farthest to the left.
        """
        config, width = self._config, self._config.patch_cells
        patch = np.empty(width * width, np.float32)
        cut_patch(self._ground, 0, pose, _turn(pose), config.patch_cell, width, patch)
        return patch.reshape(1, width, width)

    def frontier(self, pose: Pose, scan: LaserScan, sectors: int) -> Float64[np.ndarray, "sectors"]:
        """How far it is (m) in each sector of a scan, taken at `pose`, to ground not covered.

        As far as the middle beam of the sector shows: infinity where it shows none (B. Yamauchi,
        A frontier-based approach for autonomous exploration, CIRA 1997).
        """
        found = np.empty(sectors)
        sensor = self._config.sensor(scan.geometry)
        find_frontier(self._ground, 0, pose, sensor, scan.ranges, found)
        return found


def _turn(pose: Pose) -> tuple[float, float]:
    """The cosine and sine of its heading."""
    return math.cos(pose[2]), math.sin(pose[2])


class Wayfinding:
    """The ways that one robot finds (see `WayfindingConfig`).

    Args:
        config: How they are searched for.
        coverage: Which ground counts as covered, and how often the robot looks.
        extent: How far from its origin the map may reach (m).
    """

    def __init__(self, config: WayfindingConfig, coverage: CoverageConfig, extent: float) -> None:
        self._coverage, self._search = coverage, config.search(0.25)
        self._params = config.occupancy(coverage)
        self._occupancy = with_occupancy(empty_occupancy(1), 0, config.side(extent))

    def follow(
        self,
        motion: Pose,
        pose: Pose,
        scan: LaserScan,
        home: Pose,
        covered: Coverage,
        known: Float[np.ndarray, "7"],
    ) -> None:
        """Take in a scan.

        Args:
            motion: How the odometer says that the robot has moved since the last.
            pose: Where it believes to be (map frame).
            scan: What it sees there.
            home: Where it believes home to be (map frame).
            covered: The ground that it believes to have covered, this scan's included.
            known: The way home that it knows (`RouteHome`).
        """
        occupancy, search, sensor = (
            self._occupancy,
            self._search,
            self._coverage.sensor(scan.geometry),
        )
        if update_occupancy(occupancy, 0, self._params, sensor, motion, pose, scan.ranges):
            find_shortcut(occupancy, 0, search, home)
            find_path(occupancy, 0, search, known[POINT], known[TRAVEL])
            find_onward(occupancy, 0, search, covered.ground)

    def shortcut(self, known: float) -> Points:
        """The point ahead on the way home that is not known to be barred (map frame, m).

        NaN where the known way home, so long (m), is not worth leaving for it.
        """
        return np.array(pick_shortcut(self._occupancy, 0, self._search, known))

    @property
    def path(self) -> Points:
        """The point ahead on the way home that the robot had better take (map frame, m)."""
        return np.array(self._occupancy.paths[0, :2])

    @property
    def onward(self) -> Points:
        """The point ahead on the way to ground not covered (map frame, m); NaN for none."""
        return np.array(pick_onward(self._occupancy, 0))
