"""DP-SLAM: a particle filter over maps that stores only one map.

A. Eliazar and R. Parr, DP-SLAM, IJCAI 2003, and DP-SLAM 2.0, ICRA 2004. The authors' program later
added a hierarchy of two maps (Hierarchical linear/constant time SLAM, NIPS 2005); it is not part of
this mapper.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int16, Int64

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import Estimate, WayHome
from albot_core.mappers.schema import (
    Arrays,
    Field,
    Schema,
    Sizes,
    generator,
    refuse_unless,
)
from albot_core.mappers.slam.ancestral_paths import AncestralPaths
from albot_core.mappers.slam.ancestry import (
    ParticleMaps,
    add_node,
    clear_particle_maps,
    make_particle_maps,
    order_nodes,
    prune,
)
from albot_core.mappers.slam.distributed_map import DistributedMap
from albot_core.mappers.slam.dp_slam_config import MOST_DEVIATIONS, DpSlamConfig
from albot_core.mappers.slam.observations import release_empty_tiles
from albot_core.mappers.slam.opacity import Beams, slots_needed, used_beams, weigh_samples
from albot_core.mappers.slam.scan_entry import enter_scan
from albot_core.mappers.slam.tiles import NONE
from albot_core.mappers.slam.way_home import Ground, RouteKeeper
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import (
    MapSnapshot,
    OccupancyGridLayer,
    ParticlesLayer,
    TrajectoryLayer,
)
from albot_core.sensing.reading import Reading

_LEAST_WAY = 1e-6
"""Smallest distance through a square in the drawn map (m)."""
_SCANS = 4
"""Number of scans whose squares the particles' maps can hold."""


def _check_particles(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless there are few enough particles, and they are the tree's leaves."""
    nodes, most = state["particles.nodes"], sizes["most_particles"]
    refuse_unless(1 <= len(nodes) <= most, "particles.poses", f"1 to {most} particles", len(nodes))
    parents = state["tree.parents"]
    children = np.bincount(parents[parents >= 0], minlength=len(parents))
    is_inner = parents >= NONE
    refuse_unless(
        is_inner[nodes].all() and not children[nodes].any(), "particles.nodes", "leaves of the tree"
    )
    is_inner[nodes] = False
    expected = "a tree, of whose nodes each has two children or is a particle's"
    refuse_unless((children[is_inner] >= 2).all(), "tree.parents", expected)


class DpSlam(StoredMapper):
    """DP-SLAM's particles, and the one map that they share.

    It knows a way home (`RouteHome`) and corrects earlier poses (`CorrectedTrajectory`): both use
    the path of the best particle's ancestors.

    Args:
        config: All parameters.
        name: The mapper's name in the registry.
    """

    config: DpSlamConfig
    _maps: ParticleMaps | None
    SCHEMA = Schema(
        generator("rng"),
        Field("moved", "3"),
        Field("best", "", int, least=0, below="particles"),
        Field("localised", "", int, at="_is_localised", least=0, most=1),
        Field("particles.poses", "particles 3"),
        Field("particles.nodes", "particles", np.int16, least=0, below="nodes", once=True),
        Field("particles.draws", "particles", int, least=1, sums="samples"),
        parts=("_paths", "_map"),
        rules=(_check_particles,),
    )

    def __init__(self, config: DpSlamConfig | None = None, name: str = "dp-slam") -> None:
        config = config or DpSlamConfig()
        self._model, self._maps = config.laser_model, None
        self._route = RouteKeeper(config.way_home)
        super().__init__(config, name)

    def _sizes(self) -> dict[str, Any]:
        return {"samples": self.config.sample_count, "most_particles": self.config.particles}

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._rng = rng
        self._map = DistributedMap(self.config.particles, self.config.cell)
        self._paths = AncestralPaths()
        self._poses: Poses = np.zeros((1, 3))
        self._nodes: Int16[np.ndarray, "particles"] = np.zeros(1, np.int16)
        self._draws: Int64[np.ndarray, "particles"] = np.array((self.config.sample_count,))
        self._best = 0
        self._moved = np.zeros(3)
        self._is_localised = True
        self._route.forget()

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its scan was used.

        Raises:
            InputError: The reading lacks a laser scan, or the map would become larger than any
                building; the mapper is then unchanged.
        """
        scan = reading.required_laser(self._name)
        is_first = self._paths.readings == 0
        moved = np.zeros(3) if is_first else compose(self._moved, reading.motion)
        if not is_first and not self._has_moved_on(moved):
            self._moved = moved
            self._paths.add_reading(moved)
            return False
        beams = used_beams(scan, self.config.beams, self.config.reach)
        self._check_ground(moved, beams)
        parents = np.zeros(1, np.int64)
        if not is_first:
            # Sample motions, weigh the samples by the scan, and resample.
            samples, origins = self._move_particles(moved)
            weights = self._weigh(samples, origins, beams)
            chosen, self._draws = self._resample(weights)
            self._poses, parents = samples[chosen], origins[chosen]
            self._best = int(np.argmax(weights[chosen]))
        self._nodes = self._update_ancestry(parents)
        self._map.reserve_ground(self._poses, self._sight(beams))
        self._enter(parents, beams)
        self._paths.add_poses(self._poses, parents)
        self._paths.add_reading(np.zeros(3))
        self._moved, self._is_localised = np.zeros(3), bool(beams.stopped.any())
        return True

    def _has_moved_on(self, moved: Pose) -> bool:
        """Return whether the robot moved or turned far enough for the next update."""
        far = math.hypot(moved[0], moved[1]) >= self.config.step
        return far or abs(moved[2]) >= self.config.turn

    def _move_particles(
        self, moved: Pose
    ) -> tuple[Float64[np.ndarray, "samples 3"], Int64[np.ndarray, "samples"]]:
        """Sample poses after a motion; return them, and the particle that each comes from."""
        origins = np.repeat(np.arange(len(self._poses)), self._draws)
        along, across, turn = self.config.motion.draw(moved, len(origins), self._rng).T
        samples = self._poses[origins]
        middle = samples[:, 2] + 0.5 * turn
        samples[:, 0] += along * np.cos(middle) - across * np.sin(middle)
        samples[:, 1] += along * np.sin(middle) + across * np.cos(middle)
        samples[:, 2] = np.arctan2(np.sin(samples[:, 2] + turn), np.cos(samples[:, 2] + turn))
        return samples, origins

    def _weigh(
        self,
        samples: Float64[np.ndarray, "samples 3"],
        origins: Int64[np.ndarray, "samples"],
        beams: Beams,
    ) -> Float64[np.ndarray, "samples"]:
        """Return the samples' weights for a scan; they sum to 1."""
        logs = np.zeros(len(samples))
        arrays, tree, maps = self._map.arrays, self._map.tree, self._room(beams)
        maps.nodes[:] = NONE
        maps.nodes[: len(self._nodes)] = self._nodes
        count = order_nodes(tree)
        if beams.stopped.any():  # Without a hit the scan holds no information on the pose.
            weigh_samples(arrays, tree, maps, count, samples, origins, beams, self._model, logs)
        weights = np.exp(logs - logs.max())
        return np.asarray(weights / weights.sum())

    def _resample(
        self, weights: Float64[np.ndarray, "samples"]
    ) -> tuple[Int64[np.ndarray, "chosen"], Int64[np.ndarray, "chosen"]]:
        """Return the samples that become particles, and each one's number of draws."""
        draws = np.zeros(len(weights), np.int64)
        uniforms, sums = self._rng.random(self.config.sample_count), np.empty(len(weights))
        resample(weights, uniforms, self.config.particles, sums, draws)
        chosen = np.flatnonzero(draws)
        return chosen, draws[chosen]

    def _update_ancestry(self, parents: Int64[np.ndarray, "chosen"]) -> Int16[np.ndarray, "chosen"]:
        """Prune the tree; return the nodes of the particles with these parents."""
        tree = self._map.tree
        if self._paths.readings == 0:
            return self._nodes
        maps = self._maps
        assert maps is not None  # `_weigh` has made it.
        nodes, count = maps.nodes, len(self._nodes)
        descendants = np.bincount(parents, minlength=count)
        is_removed = np.empty(len(tree.parent), np.uint8)
        prune(self._map.arrays, tree, nodes[:count], descendants, is_removed)
        return np.array([add_node(tree, nodes[parent]) for parent in parents], np.int16)

    def _enter(self, parents: Int64[np.ndarray, "chosen"], beams: Beams) -> None:
        """Enter what each particle saw from its own pose."""
        maps, lacking = self._room(beams), np.zeros(2, np.int64)
        if self._paths.readings == 0:
            maps.nodes[:] = NONE
            maps.nodes[0] = self._nodes[0]
        count = order_nodes(self._map.tree)
        for k, (pose, node) in enumerate(zip(self._poses, self._nodes, strict=True)):
            while not enter_scan(
                self._map.arrays,
                self._map.tree,
                maps,
                count,
                int(parents[k]),
                int(node),
                pose,
                beams,
                self._model,
                self._seen,
                self._touched,
                lacking,
            ):
                self._map.reserve_observations(int(lacking[0]), int(lacking[1]))
        clear_particle_maps(self._map.arrays, maps)
        release_empty_tiles(self._map.arrays)

    def _room(self, beams: Beams) -> ParticleMaps:
        """Return the particles' maps, with room for scans of this many beams."""
        slots = _SCANS * int(slots_needed(len(beams.lengths), self._model))
        if self._maps is None or len(self._maps.squares) < slots:
            self._maps = make_particle_maps(slots, self.config.particles)
            self._seen = np.zeros((slots, 2))
            self._touched = np.empty(slots, np.int32)
        return self._maps

    def _check_ground(self, moved: Pose, beams: Beams) -> None:
        """Raise InputError if a motion leads farther than the map can extend."""
        distance = math.hypot(moved[0], moved[1])
        deviations = self.config.motion.deviations(distance, moved[2])
        radius = distance + MOST_DEVIATIONS * float(deviations[:2].sum())
        self._map.check_ground(self._poses, radius + self._sight(beams))

    def _sight(self, beams: Beams) -> float:
        """Return the largest distance from the robot to the end of a beam (m)."""
        return self.config.reach + math.hypot(*beams.eye)

    @property
    def estimate(self) -> Estimate:
        """The best particle's pose, moved by the odometry since the last update.

        The robot counts as lost if no beam of the latest scan hit anything.
        """
        return Estimate(
            pose=compose(self._poses[self._best], self._moved),
            home=np.zeros(3),
            localised=self._is_localised,
            updates=self._paths.updates,
            map_version=self._paths.updates,
        )

    @property
    def memory(self) -> dict[str, int]:
        """Memory of the one map, and what a map for each particle would hold.

        `observations`: number of observations in the shared map; `squares`: number of squares with
        observations; `copied`: number of known squares summed over all particles, each with its
        own map; `bytes`: size of the shared map's arrays.
        """
        return {
            "observations": self._map.observations,
            "squares": self._map.squares,
            "copied": self._map.count_known(self._nodes),
            "bytes": self._map.bytes,
        }

    @property
    def way_home(self) -> WayHome:
        """The shortest way home over squares that are free in the best particle's map."""

        def ground() -> Ground:
            crossed, corner = self._crossed()
            # Above 0 if a beam that crosses the square is more likely to stop in it than not.
            belief = np.nan_to_num(crossed - np.float32(0.5))
            path = self._paths.poses_of(self._best)
            return Ground(belief, corner, self.config.cell, path[:, :2])

        return self._route.way_home(self._paths.updates, self.estimate.pose, ground)

    def snapshot(self) -> MapSnapshot:
        """Return the best particle's map and path, and all particles."""
        crossed, corner = self._crossed()
        grid = OccupancyGridLayer(
            origin=np.array((*corner, 0.0)), resolution=self.config.cell, occupancy=crossed
        )
        weights = self._draws / self._draws.sum()
        return MapSnapshot(
            layers=(
                grid,
                TrajectoryLayer(poses=self._paths.poses_of(self._best)),
                ParticlesLayer(poses=self._poses.copy(), weights=weights),
            )
        )

    def _crossed(self) -> tuple[Float32[np.ndarray, "rows columns"], Float64[np.ndarray, "2"]]:
        """Return the occupancy of each square in the best particle's map.

        This is the probability that the square stops a beam that crosses it along its diagonal.
        Only the beams that reached the square count: the prior, which lowers the effect of few
        beams, would hide walls. NaN where nothing is known.

        Returns:
            The probabilities, and x, y of the outer corner of the first square (m).
        """
        beams, corner = self._map.known_by(int(self._nodes[self._best]))
        stopped, distance = beams[:, :, 0], beams[:, :, 1]
        passed = np.maximum(distance - self._model.prior_distance, _LEAST_WAY)
        crossed = 1.0 - np.exp(-math.sqrt(2) * self.config.cell * stopped / passed)
        known = np.where(distance > 0, crossed, np.nan).astype(np.float32)
        return known, corner[::-1] * self.config.cell

    def corrected_poses(self) -> Poses:
        """Return the poses at all readings, along the best particle's ancestors."""
        return self._paths.poses_at_readings(self._best)


@kernel()
def resample(
    weights: np.ndarray, uniforms: np.ndarray, most: int, sums: np.ndarray, draws: np.ndarray
) -> None:
    """Draw one sample per uniform number, with replacement; at most `most` are different.

    Once that many different samples have been drawn, the rest is drawn among them.

    Args:
        weights: The samples' weights (samples,).
        uniforms: Numbers within [0, 1), one for each draw.
        most: Largest number of different samples.
        sums: Scratch buffer, one number per weight.
        draws: Number of times that each sample is drawn (samples,); zeros at first.
    """
    kinds, total = 0, 0.0
    for i in range(len(weights)):
        total += weights[i]
        sums[i] = total
    for uniform in uniforms:
        # The first sample whose cumulative weight exceeds the number drawn.
        i = np.searchsorted(sums, uniform * total, side="right")
        if draws[i] == 0:
            kinds += 1
            draws[i] = 1
            if kinds == most:
                total = 0.0
                for j in range(len(weights)):
                    total += weights[j] if draws[j] > 0 else 0.0
                    sums[j] = total
        else:
            draws[i] += 1
