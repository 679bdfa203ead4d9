"""The paths of particles and their ancestors; common beginnings of paths are stored once."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.schema import Arrays, Field, Schema, Sizes, refuse_unless
from albot_core.mappers.slam.tiles import NONE
from albot_core.mappers.stored import Stored

_SLACK = 4096
"""Poses of dead particles are dropped once there are this many more poses than twice those kept."""


def _check_paths(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the path of each particle has a pose at each update."""
    before, last, updates = state["path.before"], state["path.last"], sizes["path.updates"]
    particles = sizes["particles"] if updates else 0
    refuse_unless(
        len(last) == particles, "path.last", f"a pose for each of {particles} particles", len(last)
    )
    numbers = np.zeros(len(before), np.int64)
    count_steps(before, numbers)  # A predecessor has a lower index.
    is_right = (numbers[last] == updates - 1).all()
    refuse_unless(is_right, "path.updates", "the poses of every path", updates)
    is_right = bool(updates) == bool(sizes["readings"])
    refuse_unless(is_right, "path.reading_updates", f"numbers below {updates}")


class AncestralPaths(Stored):
    """The poses of all particles at all updates, and the odometry between updates."""

    SCHEMA = Schema(
        Field("path.poses", "poses 3", used="_count"),
        Field("path.before", "poses", int, used="_count", least=NONE, below="row"),
        Field("path.last", "last", int, least=0, below="poses"),
        Field("path.updates", "", int, at="updates", least=0),
        Field(
            "path.reading_updates", "readings", int, used="readings", least=0, below="path.updates"
        ),
        Field("path.reading_motions", "readings 3", used="readings"),
        rules=(_check_paths,),
    )

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

    def _stored(self) -> dict[str, Any]:
        self._drop_dead()
        return {}

    def _restored(self, state: Arrays) -> None:
        self._kept = self._count

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
