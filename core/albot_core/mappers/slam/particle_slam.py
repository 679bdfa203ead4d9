"""SLAM by particles with a map each: the common part of `grid-slam`, `gmapping` and `fastslam`.

The filter of D. Hähnel, W. Burgard, D. Fox and S. Thrun, An efficient FastSLAM algorithm for
generating maps of large-scale cyclic environments from raw laser range measurements, IROS 2003.
Between scans, the robot's motion is found by matching each scan with the latest ones. At an update,
the particles move by the motion since the last update, each is weighed by how well its own map
explains the scan, and if necessary they are resampled. Subclasses define the motion and weighing.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses
from albot_core.mappers.mapper import Estimate, WayHome
from albot_core.mappers.schema import Field, Schema, generator
from albot_core.mappers.slam.grid import GridConfig
from albot_core.mappers.slam.local_map import LocalMap, MatchingConfig, scan_points
from albot_core.mappers.slam.particle_paths import ParticlePaths
from albot_core.mappers.slam.way_home import Ground, RouteKeeper, WayHomeConfig
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, ParticlesLayer, TrajectoryLayer
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields
from albot_core.sensing.reading import LaserScan, Reading

_PARTICLES = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)


@dataclass(frozen=True, kw_only=True)
class ParticleSlamConfig:
    """Parameters of SLAM by particles."""

    grid: GridConfig = field(default_factory=lambda: GridConfig(reach=15.0))
    """The maps: log odds in cells of 5 cm, as in GMapping's program."""
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Matching of a scan with the latest ones, which gives the motion."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """Parameters of the search for the way home."""
    particles: int = 30
    """Number of particles, 100,000 at most."""
    step: float = 1.0
    """Distance since the last update after which a scan is used (m)."""
    turn: float = 0.5
    """Turn since the last update after which a scan is used (rad)."""
    drift: float = 0.1
    """Standard deviation of the position per distance (m/m)."""
    drift_by_turn: float = 0.1
    """Standard deviation of the position per turn (m/rad)."""
    twist: float = 0.2
    """Standard deviation of the heading per turn (rad/rad)."""
    twist_by_way: float = 0.2
    """Standard deviation of the heading per distance (rad/m)."""
    resample_below: float = 0.5
    """Particles are resampled if their effective number is below this share of all."""

    def __post_init__(self) -> None:
        check_fields(self, _PARTICLES, "particles")
        check_fields(self, NOT_NEGATIVE, "step", "turn")
        check_fields(self, POSITIVE, "drift", "drift_by_turn", "twist", "twist_by_way")
        check_fields(self, SHARE, "resample_below")


class ParticleSlam(StoredMapper, ABC):
    """SLAM by particles with a map each; it knows a way home and corrects earlier poses.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
        particles: The particles, with empty maps.
    """

    config: ParticleSlamConfig
    SCHEMA = Schema(
        Field("pose", "3"),
        Field("motion", "3"),
        Field("way", "2"),
        Field("updates_of", "readings", int, least=0, below="updates"),
        Field("offsets", "readings 3"),
        Field("localised", "", int, at="_is_localised", least=0, most=1),
        generator("random"),
        parts=("_particles", "_local"),
    )

    def __init__(self, config: ParticleSlamConfig, name: str, particles: ParticlePaths) -> None:
        self._particles = particles
        self._local = LocalMap(config.matching)
        self._route = RouteKeeper(config.way_home)
        super().__init__(config, name)

    @property
    def estimate(self) -> Estimate:
        """The pose of the particle with the largest weight, moved since the last update."""
        particles = self._particles
        return Estimate(
            pose=compose(particles.poses[particles.best], self._motion),
            home=np.zeros(3),
            localised=self._is_localised,
            updates=particles.updates,
            map_version=particles.updates,
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first."""
        self._rng = rng
        self._particles.clear()
        self._local.reset()
        self._route.forget()
        self._pose = np.zeros(3)  # From matching with the latest scans alone, in its own frame.
        self._motion = np.zeros(3)
        self._way = np.zeros(2)
        self._is_localised = True
        self._updates_of: list[int] = []
        self._offsets: list[Pose] = []

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its scan was entered into the maps.

        Raises:
            InputError: The reading lacks a laser scan, or the map would become larger than any
                building.
        """
        scan = reading.required_laser(self._name)
        particles, config = self._particles, self.config
        self._match(reading, scan)
        is_due = not particles.updates or self._has_moved_on()
        if is_due:
            if particles.updates:
                self._move_and_weigh(scan, self._motion, self._deviations())
            particles.integrate(scan)
            particles.remember()
            self._motion, self._way = np.zeros(3), np.zeros(2)
            weights = particles.weights(self._weight_gain)
            if 1.0 / np.sum(weights**2) < config.resample_below * config.particles:
                particles.resample(weights, self._rng)
        self._updates_of.append(particles.updates - 1)
        self._offsets.append(self._motion.copy())
        return is_due

    def resume(self, pose: Pose, scan: LaserScan) -> None:
        """Continue at a pose on the map; the next reading's motion begins there.

        All particles begin there. Their maps differ by less than the next scans correct.
        """
        self._local.reset()
        self._pose, self._is_localised = np.zeros(3), True
        self._local.keep(self._pose, scan_points(scan, self.config.matching).surface)
        self._particles.poses[:] = pose
        self._motion, self._way = np.zeros(3), np.zeros(2)

    @property
    @abstractmethod
    def _weight_gain(self) -> float:
        """Factor of the log-weights when weights are computed."""

    @abstractmethod
    def _move_and_weigh(
        self, scan: LaserScan, motion: Pose, deviations: Float64[np.ndarray, "3"]
    ) -> None:
        """Move each particle, and add the log-likelihood of the scan to its log-weight.

        Args:
            scan: The scan.
            motion: The motion since the last update, in the robot's frame at that update.
            deviations: Its standard deviations, along the robot's axes now (m, m, rad).
        """

    def _match(self, reading: Reading, scan: LaserScan) -> None:
        """Find the robot's motion: by scan matching if it succeeds, otherwise by the odometer."""
        points = scan_points(scan, self.config.matching)
        if not self._particles.updates:
            self._local.keep(self._pose, points.surface)
            return
        match = self._local.match(points, compose(self._pose, reading.motion))
        self._add_motion(relative(self._pose, match.pose))
        self._pose, self._is_localised = match.pose, match.is_good
        if self._local.is_due(match.pose):
            self._local.keep(match.pose, points.surface)

    def _add_motion(self, motion: Pose) -> None:
        """Add a motion, in the robot's frame before it, to that since the last update."""
        self._motion = compose(self._motion, motion)
        self._way += (math.hypot(motion[0], motion[1]), abs(float(motion[2])))

    def _has_moved_on(self) -> bool:
        """Return whether the robot moved or turned far enough since the last update."""
        return bool(self._way[0] >= self.config.step or self._way[1] >= self.config.turn)

    def _deviations(self) -> Float64[np.ndarray, "3"]:
        """Return the standard deviations of the motion since the last update.

        As in GMapping's program, except that the program's sideways deviation is a third of the
        forward one; here both are equal.
        """
        config, (way, turned) = self.config, self._way.tolist()
        slip = config.drift * way + config.drift_by_turn * turned
        twist = config.twist * turned + config.twist_by_way * way
        return np.maximum((slip, slip, twist), 1e-6)

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over cells that are free in the best particle's map."""
        particles = self._particles

        def ground() -> Ground:
            best = particles.best
            return particles.grid(best).ground(particles.trajectory(best)[:, :2])

        pose = compose(particles.poses[particles.best], self._motion)
        return self._route.way_home(particles.updates, pose, ground)

    def corrected_poses(self) -> Poses:
        """Return the best particle's path, at every reading, (readings, 3)."""
        particles = self._particles
        if not self._offsets:
            return np.empty((0, 3))
        way = particles.trajectory(particles.best)
        poses: Poses = compose(way[self._updates_of], np.array(self._offsets))
        return poses

    def snapshot(self) -> MapSnapshot:
        """Return the best particle's map and path, and the poses of all particles."""
        particles = self._particles
        spread = ParticlesLayer(
            poses=compose(particles.poses, self._motion[None]),
            weights=particles.weights(self._weight_gain),
        )
        way = TrajectoryLayer(poses=particles.trajectory(particles.best))
        return MapSnapshot(layers=(particles.grid(particles.best).layer(), way, spread))
