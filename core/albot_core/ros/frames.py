"""The frames of a robot in ROS, and their transforms: which moves with the odometer, which never.

Transforms are 4 × 4 matrices, of the pose of a frame in its parent.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.types import Poses
from albot_core.plain_data import LARGEST

Transform = Float64[np.ndarray, "4 4"]

_PLAY = 0.01
"""Largest change of a transform that is taken for constant (m, and rad of rotation)."""
_NORM = 0.1
"""Largest deviation of a quaternion's norm from 1."""
_MOST_TRANSFORMS = 1 << 23
"""Most transforms that are held; of 64 bytes each."""
_ODOM = "odom"
"""Beginning of the name of the odometer's frame (REP 105)."""
_FIELDS = 8
"""Numbers of a held transform: stamp (s), x, y, z, and the quaternion x, y, z, w."""


def frame_name(name: str) -> str:
    """Return a frame's name without the slash that ROS 1 allowed before it."""
    return name.removeprefix("/")


def unit_quaternions(quaternions: Float64[np.ndarray, "n 4"]) -> Float64[np.ndarray, "n 4"]:
    """Return quaternions with norm 1; NaN for what is none, by more than rounding."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        norms = np.linalg.norm(quaternions, axis=1, keepdims=True)
        return np.where(np.abs(norms - 1) <= _NORM, quaternions / norms, np.nan)


def planar_poses(rows: Float64[np.ndarray, "n 7"]) -> Poses:
    """Return the poses in the plane of positions and quaternions; NaN where there is none."""
    x, y, z, w = unit_quaternions(rows[:, 3:]).T
    headings = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack((rows[:, 0], rows[:, 1], headings), axis=1)


def _matrix(row: Float64[np.ndarray, "7"]) -> Transform:
    (x, y, z, w) = unit_quaternions(row[None, 3:])[0].tolist()
    moved = np.eye(4)
    moved[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    moved[:3, 3] = row[:3]
    return moved


class FrameTree:
    """The frames of a bag.

    Args:
        source: The bag, for errors.
    """

    def __init__(self, source: object) -> None:
        self._source = source
        self._parents: dict[str, str] = {}
        self._static: set[str] = set()
        self._held: dict[str, array[float]] = {}
        self._count = 0

    def add(self, message: Any, stamps: list[float], *, static: bool) -> None:
        """Add the transforms of a message, with the stamp of each (s).

        What is published as static keeps its parent.

        Raises:
            InputError: There are too many to hold.
        """
        for stamp, each in zip(stamps, message.transforms, strict=True):
            child = frame_name(each.child_frame_id)
            if child in self._static and not static:
                continue
            if static:
                self._static.add(child)
                self._held.pop(child, None)
            self._parents[child] = frame_name(each.header.frame_id)
            moved, turned = each.transform.translation, each.transform.rotation
            held = self._held.setdefault(child, array("d"))
            held.extend((stamp, moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w))
            self._count += 1
            if self._count > _MOST_TRANSFORMS:
                expected = f"{_MOST_TRANSFORMS:,} transforms at most"
                raise InputError(self._source, expected, "more")

    def rows(self, child: str) -> Float64[np.ndarray, "n 8"]:
        """Return the transforms of a frame in its parent: stamp, position and quaternion."""
        return np.array(self._held[child]).reshape(-1, _FIELDS)

    def is_constant(self, child: str) -> bool:
        """Return whether a frame never moves in its parent."""
        if child in self._static:
            return True
        rows = self.rows(child)
        with np.errstate(invalid="ignore"):
            moved = np.abs(rows[:, 1:4] - rows[0, 1:4]).max()
        turned = unit_quaternions(rows[:, 4:])
        # The scalar product of unit quaternions is the cosine of half the angle between them.
        aligned = np.abs(turned @ turned[0]).min()
        return bool(moved <= _PLAY and aligned >= math.cos(_PLAY / 2))

    def ancestors(self, frame: str) -> Iterator[str]:
        """Yield a frame and those above it."""
        seen = set()
        while frame not in seen:
            yield frame
            seen.add(frame)
            if frame not in self._parents:
                return
            frame = self._parents[frame]
        raise InputError(self._source, "frames that form a tree", f"a loop through {frame}")

    def odometer_frame(self, laser: str) -> str | None:
        """Return the frame that moves with the odometer; None if there is none.

        That is the first frame above the laser whose parent is called `odom`, or else that moves.
        Where nothing leads up from the laser, all frames are candidates.
        """
        chain = [frame for frame in self.ancestors(laser) if frame in self._parents]
        for candidates in (chain, sorted(self._parents)):
            named = [each for each in candidates if _is_odom(self._parents[each])]
            moving = [each for each in candidates if not self.is_constant(each)]
            found = named or moving
            if found and (candidates is chain or len(found) == 1):
                return found[0]
        return None

    def robot_frame(self, laser: str, odom: str) -> str:
        """Return the topmost frame that is fixed to the laser, below the odometer's frame."""
        for frame in self.ancestors(laser):
            parent = self._parents.get(frame)
            if parent is None or parent == odom or _is_odom(parent) or not self.is_constant(frame):
                break
        return frame

    def mount(self, base: str, laser: str) -> Transform | None:
        """Return the pose of the laser's frame in the robot's; None if nothing leads to it.

        Raises:
            InputError: The laser moves on the robot, or a transform is none.
        """
        above_base = self._transforms(base)
        above_laser = self._transforms(laser)
        for common, laser_in_common in above_laser.items():
            if common in above_base:
                return np.asarray(np.linalg.solve(above_base[common], laser_in_common))
        if base in self.ancestors(laser):
            expected = f"a laser that is fixed to {base}"
            raise InputError(self._source, expected, f"{laser}, which moves")
        return None

    def _transforms(self, frame: str) -> dict[str, Transform]:
        """Return a frame's pose in itself and in each frame above that it is fixed to."""
        found = {frame: np.eye(4)}
        reached = np.eye(4)
        for each in self.ancestors(frame):
            parent = self._parents.get(each)
            if parent is None or not self.is_constant(each):
                break
            row = self.rows(each)[-1, 1:]
            is_turned = np.isfinite(unit_quaternions(row[None, 3:])).all()
            if not (is_turned and (np.abs(row[:3]) <= LARGEST).all()):
                expected, place = "a finite position and a unit quaternion", f"{parent} to {each}"
                raise InputError(self._source, expected, str(row.tolist()), place=place)
            reached = _matrix(row) @ reached
            found[parent] = reached
        return found


def _is_odom(frame: str) -> bool:
    return frame.rpartition("/")[2].startswith(_ODOM)
