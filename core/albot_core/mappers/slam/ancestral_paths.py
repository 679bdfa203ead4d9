"""The paths of particles and their ancestors; common beginnings of paths are stored once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.tiles import NONE
from albot_core.mappers.stored_arrays import check_finite, check_shapes

_SLACK = 4096
"""Poses of dead particles are dropped once there are this many more poses than twice those kept."""


class AncestralPaths:
    """The poses of all particles at all updates, and the odometry between updates."""

    def __init__(self) -> None:
        self._poses = np.zeros((0, 3))
        self._before = np.zeros(0, np.int64)
        self._count = 0
        self._kept = 0
        self._last: Int64[np.ndarray, "particles"] = np.zeros(0, np.int64)
        self._reading_updates = np.zeros(0, np.int64)
        self._reading_motions = np.zeros((0, 3))
        self.updates = 0
        """Number of times that poses were added."""
        self.readings = 0
        """Number of readings that were added."""

    def add_poses(
        self, poses: Float64[np.ndarray, "particles 3"], parents: Int64[np.ndarray, "particles"]
    ) -> None:
        """Add the particles' poses at an update.

        `parents` holds the index of each one's parent at the update before; it is not used at the
        first update.
        """
        begin, end = self._count, self._count + len(poses)
        self._poses, self._before = _with_room(self._poses, end), _with_room(self._before, end)
        self._poses[begin:end] = poses
        self._before[begin:end] = self._last[parents] if self.updates else NONE
        self._last, self._count = np.arange(begin, end), end
        self.updates += 1
        if self._count > 2 * self._kept + _SLACK:
            self._drop_dead()

    def add_reading(self, motion: Pose) -> None:
        """Add a reading, at a pose relative to the latest update's pose."""
        end = self.readings + 1
        self._reading_updates = _with_room(self._reading_updates, end)
        self._reading_motions = _with_room(self._reading_motions, end)
        self._reading_updates[self.readings] = self.updates - 1
        self._reading_motions[self.readings] = motion
        self.readings = end

    def poses_of(self, particle: int) -> Poses:
        """Return the poses of a particle and its ancestors at all updates, (updates, 3)."""
        places = np.empty(self.updates, np.int64)
        if self.updates:
            climb(self._before, self._last[particle], places)
        return self._poses[places]

    def poses_at_readings(self, particle: int) -> Poses:
        """Return the poses of a particle and its ancestors at all readings, (readings, 3)."""
        at = self._reading_updates[: self.readings]
        return compose(self.poses_of(particle)[at], self._reading_motions[: self.readings])

    def state(self) -> dict[str, np.ndarray]:
        """Return the paths as arrays by name."""
        self._drop_dead()
        return {
            "path.poses": self._poses[: self._count].copy(),
            "path.before": self._before[: self._count].copy(),
            "path.last": self._last.copy(),
            "path.updates": np.array(self.updates, np.int64),
            "path.reading_updates": self._reading_updates[: self.readings].copy(),
            "path.reading_motions": self._reading_motions[: self.readings].copy(),
        }

    def restore(self, state: Mapping[str, np.ndarray], particles: int) -> None:
        """Restore the paths that `state` returned, for this number of particles.

        Raises:
            InputError: The arrays are not a valid state.
        """
        check_shapes(
            state,
            {
                "path.poses": ("poses", 3),
                "path.before": ("poses",),
                "path.last": ("particles",),
                "path.updates": (),
                "path.reading_updates": ("readings",),
                "path.reading_motions": ("readings", 3),
            },
        )
        check_finite(state, "path.poses", "path.reading_motions")
        poses, before, last = state["path.poses"], state["path.before"], state["path.last"]
        updates, readings = int(state["path.updates"]), state["path.reading_updates"]
        # The position of each pose in its path, from 0; a predecessor has a lower index.
        numbers = np.zeros(len(poses), np.int64)
        if (before < NONE).any() or (before >= np.arange(len(poses))).any():
            raise InputError("path.before", "poses that stand before", "others")
        count_steps(before, numbers)
        expected = particles if updates else 0
        if len(last) != expected or last.min(initial=0) < 0 or (last >= len(poses)).any():
            raise InputError("path.last", f"a pose for each of {expected} particles", "others")
        if (numbers[last] != updates - 1).any():
            raise InputError("path.updates", "the poses of every path", str(updates))
        if (
            (readings < 0).any()
            or (readings >= updates).any()
            or bool(updates) != bool(len(readings))
        ):
            raise InputError("path.reading_updates", f"numbers below {updates}", "others")
        self._poses, self._before, self._last = poses.copy(), before.copy(), last.copy()
        self._count = self._kept = len(poses)
        self._reading_updates = readings.copy()
        self._reading_motions = state["path.reading_motions"].copy()
        self.updates, self.readings = updates, len(readings)

    def _drop_dead(self) -> None:
        """Drop the poses that are on no particle's path. The others keep their order."""
        is_kept = np.zeros(self._count, np.bool_)
        mark_paths(self._before, self._last, is_kept)
        # The new index of each pose.
        places = np.cumsum(is_kept) - 1
        before = self._before[: self._count][is_kept]
        self._before = np.where(before == NONE, NONE, places[before])
        self._poses = self._poses[: self._count][is_kept]
        self._last = places[self._last]
        self._count = self._kept = len(self._poses)


def _with_room(array: np.ndarray, length: int) -> np.ndarray:
    """Return the array, or a longer copy if it is shorter than `length`."""
    if len(array) >= length:
        return array
    longer = np.zeros((max(length, 2 * len(array)), *array.shape[1:]), array.dtype)
    longer[: len(array)] = array
    return longer


@kernel()
def climb(before: np.ndarray, last: int, places: np.ndarray) -> None:
    """Fill in the indices of the poses on the path to `last`, oldest first."""
    for k in range(len(places) - 1, -1, -1):
        places[k] = last
        last = before[last]


@kernel()
def count_steps(before: np.ndarray, numbers: np.ndarray) -> None:
    """Fill in the number of poses before each pose on its path."""
    for k in range(len(before)):
        numbers[k] = 0 if before[k] == NONE else numbers[before[k]] + 1


@kernel()
def mark_paths(before: np.ndarray, last: np.ndarray, is_kept: np.ndarray) -> None:
    """Mark all poses on the paths to the poses `last`."""
    for k in last:
        while k != NONE and not is_kept[k]:
            is_kept[k] = True
            k = before[k]
