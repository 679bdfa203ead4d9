"""Particles with landmarks: each has its own, and a Kalman filter for each of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Points, Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.fastslam_config import FastSlamConfig
from albot_core.mappers.slam.grid import LogOddsGrid
from albot_core.mappers.slam.landmark_filter import (
    NEW,
    XX,
    XY,
    YY,
    X,
    Y,
    move_and_weigh,
    update_landmarks,
)
from albot_core.mappers.slam.laser_state import check_laser, laser_numbers, laser_of
from albot_core.mappers.slam.line_ends import SeenLandmarks, find_line_ends
from albot_core.mappers.slam.particle_paths import ParticlePaths
from albot_core.sensing.reading import LaserScan

_COLUMNS = 5
_ROOM = 64
"""Room for landmarks at first; it is doubled where needed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Landmarks:
    """The landmarks of a particle, map frame."""

    points: Points
    """Their positions (m), (n, 2)."""
    covariances: Float64[np.ndarray, "n 2 2"]
    """The covariances of the positions (m²)."""


def _check_landmarks(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless all covariances are positive definite and no particle has too many.

    And unless there is a scan for each update.
    """
    rows, most = state["landmarks.rows"], sizes["most_landmarks"]
    is_right = (rows[:, XX] > 0.0) & (rows[:, XX] * rows[:, YY] > rows[:, XY] ** 2)
    refuse_unless(is_right.all(), "landmarks.rows", "positive definite covariances", "others")
    largest = int(state["landmarks.counts"].max(initial=0))
    refuse_unless(largest <= most, "landmarks.counts", f"at most {most} each", largest)


class LandmarkParticles(ParticlePaths):
    """Particles with landmarks, which start at the origin of the map.

    The scans are kept: along the path of a particle they make the grid that is drawn, and in which
    the way home is found. The filter does not use it.

    Args:
        config: Parameters of the mapper.
    """

    SCHEMA = Schema(
        *ParticlePaths.SCHEMA.fields,
        Field("landmarks.counts", "particles", int, at="counts", least=0, sums="landmarks"),
        Field("landmarks.rows", f"landmarks {_COLUMNS}", at=None),
        Field("landmarks.refused", "", int, at="refused", least=0),
        Field("scans.ranges", "updates beams", at=None, least=0, finite=False),
        Field("laser", "6", at=None),
        rules=(_check_landmarks, check_laser),
    )

    def __init__(self, config: FastSlamConfig) -> None:
        self.config = config
        super().__init__(config.particles)

    def clear(self) -> None:
        """Reset all particles to the origin, with no landmarks."""
        super().clear()
        self.landmarks = np.zeros((self.count, min(_ROOM, self.config.landmarks), _COLUMNS))
        """The landmarks of each particle (particles, room, 5), see `landmark_filter`."""
        self.counts: Int64[np.ndarray, "particles"] = np.zeros(self.count, np.int64)
        """Number of landmarks of each particle."""
        self.refused = 0
        """Number of landmarks that were not added because a particle had as many as it may."""
        self.scans: list[LaserScan] = []
        """The scan of each update."""
        self._seen: SeenLandmarks = np.zeros((0, 5))
        self._matched = np.zeros((self.count, 0), np.int64)
        self._common = LogOddsGrid(self.config.grid)
        self._common_length = 0
        self._drawn: LogOddsGrid | None = None

    def look(self, scan: LaserScan) -> None:
        """Find the landmarks in a scan; until they are matched, all are new."""
        self.observe(find_line_ends(scan, self.config.line_ends))

    def observe(self, seen: SeenLandmarks) -> None:
        """Take what is seen now; until it is matched, all is new."""
        self._seen = np.ascontiguousarray(seen)
        self._matched = np.full((self.count, len(seen)), NEW)

    def move_and_weigh(
        self,
        motion: Pose,
        deviations: Float64[np.ndarray, "3"],
        noise: Float64[np.ndarray, "particles 3"],
    ) -> None:
        """Move each particle, match what is seen with its landmarks, and weigh it by that.

        Args:
            motion: The motion since the last update, in the robot's frame at that update.
            deviations: Its standard deviations, along the robot's axes now (m, m, rad).
            noise: Standard normal numbers.
        """
        config = self.config
        move_and_weigh(
            self.landmarks,
            self.counts,
            self._seen,
            motion,
            deviations,
            noise,
            config.proposal == "landmarks",
            (float(config.gate), float(np.log(config.new_landmark))),
            self.poses,
            self.log_weights,
            self._matched,
        )
        self.log_weights -= self.log_weights.max()

    def update_landmarks(self) -> None:
        """Update the landmarks of each particle by what is seen at its pose."""
        config = self.config
        needed = min(int(self.counts.max()) + len(self._seen), config.landmarks)
        if needed > self.landmarks.shape[1]:
            room = min(max(needed, 2 * self.landmarks.shape[1]), config.landmarks)
            longer = np.zeros((self.count, room, _COLUMNS))
            longer[:, : self.landmarks.shape[1]] = self.landmarks
            self.landmarks = longer
        self.refused += update_landmarks(
            self.landmarks, self.counts, self._seen, self._matched, self.poses
        )

    def integrate(self, scan: LaserScan) -> None:
        """Update the landmarks of each particle by a scan, and keep the scan."""
        if not self.updates:
            self.look(scan)
        self.update_landmarks()
        self.scans.append(scan)

    def landmarks_of(self, particle: int) -> Landmarks:
        """Return the landmarks of a particle (copies)."""
        rows = self.landmarks[particle, : self.counts[particle]]
        covariances = rows[:, [XX, XY, XY, YY]].reshape(-1, 2, 2)
        return Landmarks(points=rows[:, [X, Y]], covariances=covariances)

    def grid(self, particle: int) -> LogOddsGrid:
        """Return the grid of all scans along a particle's path; valid until the next call.

        Particles share the beginning of their paths, and so does what was drawn of it: only the
        rest is drawn anew.
        """
        common, path = self._shared_length(), self.trajectory(particle)
        if self._drawn is not None:
            self._drawn.clear()
        for k in range(self._common_length, common):
            self._common.integrate(path[k], self.scans[k])
        self._common_length = common
        grid = self._common.fork()
        for k in range(common, len(path)):
            grid.integrate(path[k], self.scans[k])
        self._drawn = grid
        return grid

    def _shared_length(self) -> int:
        """Return the number of poses that all particles' paths share."""
        alive = np.unique(self._parents)
        for update in range(self.updates - 1, -1, -1):
            if len(alive) == 1 or update < self._common_length:
                return update + 1
            alive = np.unique(self._lineage[update][alive])
        return 0

    def _take_maps(self, chosen: Int64[np.ndarray, "particles"]) -> None:
        self.landmarks, self.counts = take(self.landmarks, self.counts, chosen), self.counts[chosen]

    def _sizes(self) -> dict[str, Any]:
        return {**super()._sizes(), "most_landmarks": self.config.landmarks}

    def _stored(self) -> dict[str, Any]:
        laser, ranges = laser_numbers(self.scans)
        rows = [mine[:count] for mine, count in zip(self.landmarks, self.counts, strict=True)]
        return {
            **super()._stored(),
            "landmarks.rows": np.concatenate(rows),
            "scans.ranges": ranges,
            "laser": laser,
        }

    def _restored(self, state: Arrays) -> None:
        super()._restored(state)
        room = max(int(self.counts.max()), self.landmarks.shape[1])
        self.landmarks = np.zeros((self.count, room, _COLUMNS))
        ends = np.cumsum(self.counts)[:-1]
        for k, rows in enumerate(np.split(state["landmarks.rows"], ends)):
            self.landmarks[k, : len(rows)] = rows
        ranges = state["scans.ranges"].copy()
        laser = laser_of(state["laser"], ranges.shape[1])
        self.scans = [LaserScan(ranges=row, geometry=laser) for row in ranges]


@kernel(arrays=True, nogil=True)
def take(landmarks: np.ndarray, counts: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the landmarks of the chosen particles, (particles, room, 5); only those in use."""
    taken = np.zeros(landmarks.shape)
    for k in range(len(chosen)):
        count = counts[chosen[k]]
        taken[k, :count] = landmarks[chosen[k], :count]
    return taken
