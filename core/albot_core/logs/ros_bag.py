"""Bags of ROS 1 and ROS 2: laser scans, with odometry or with transforms in its place.

Frames are as in REP 105, ranges that are no measurement as in REP 117. Of a message the stamp in
its header counts, not the time of its receipt.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.counts import many
from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.poses import interpolate
from albot_core.geometry.types import Poses
from albot_core.logs.log import Log
from albot_core.plain_data import LARGEST
from albot_core.ros.bag import METADATA, Bag, opened_bag
from albot_core.ros.frames import FrameTree, Transform, frame_name, planar_poses
from albot_core.ros.messages import ODOMETRY, POSE, SCAN, SECOND, TRANSFORMS, stamp_of
from albot_core.ros.scans import Scans

NAME = f"ROS bags (.bag, .mcap, .db3, or a folder with {METADATA})"
TRUTH = "ground_truth"
"""Part of the names of topics of true poses, such as Gazebo's and Stage's."""
_STATIC = "tf_static"
"""Last part of the name of the topic of transforms that never change."""
_MOST_POSES = 1 << 23
"""Most poses of a topic that are held; of 64 bytes each."""


@dataclass(frozen=True, kw_only=True)
class BagTopics:
    """Which topics of a bag are read; None for the only one of its type."""

    scan: str | None = None
    """The laser's topic."""
    odom: str | None = None
    """The odometer's topic: of odometry, or of transforms."""


def read_ros_bag(path: Path, topics: BagTopics | None = None) -> Log:
    """Read a bag of ROS 1 or ROS 2.

    The odometer's pose at a scan is interpolated; scans before its first message and after its
    last are left out. The laser's mount is that of the transforms which never change. The topic of
    a name with `ground_truth` holds the reference.

    Args:
        path: The file or folder.
        topics: The topics to read.

    Raises:
        InputError: `rosbags` is not installed; the bag is damaged; it has several topics to choose
            from, or none, or none of the name; or it holds no laser that scans the level from a
            fixed place on the robot.
    """
    with opened_bag(path) as bag:
        chosen = _choose(bag, topics or BagTopics())
        recorded = _Recorded(path, chosen)
        wanted = {chosen.scan, *chosen.transforms}
        wanted |= {topic for topic in (chosen.odometry, chosen.truth) if topic is not None}
        for message in bag.messages(wanted):
            recorded.add(message.topic, message.received, message.content)
    return recorded.to_log()


class _Chosen(NamedTuple):
    """The topics that are read."""

    scan: str
    odometry: str | None
    """None if the odometer's poses are among the transforms."""
    truth: str | None
    truths: tuple[str, ...]
    """All topics that could be the truth; of several none is."""
    transforms: tuple[str, ...]


def _choose(bag: Bag, asked: BagTopics) -> _Chosen:
    of_kind = {
        kind: [name for name, each in bag.topics.items() if each == kind]
        for kind in (SCAN, ODOMETRY, POSE, TRANSFORMS)
    }
    truths = [name for name in (*of_kind[ODOMETRY], *of_kind[POSE]) if TRUTH in name]
    scan = _only(bag, of_kind[SCAN], asked.scan, "scan", "of sensor_msgs/LaserScan")
    transforms = of_kind[TRANSFORMS]
    moving = [name for name in transforms if not _is_static(name)]
    odometries = [name for name in of_kind[ODOMETRY] if name not in truths]
    what = "of nav_msgs/Odometry, or of transforms from odom to the robot"
    known = odometries if asked.odom is None else [*of_kind[ODOMETRY], *moving]
    odometry = None
    if known or not moving:
        odometry = _only(bag, known, asked.odom, "odom", what)
    if odometry in moving:
        odometry = None
    others = [name for name in truths if name != odometry]
    truth = others[0] if len(others) == 1 else None
    return _Chosen(scan, odometry, truth, tuple(others), tuple(transforms))


def _only(bag: Bag, known: list[str], asked: str | None, option: str, what: str) -> str:
    """Return the topic that was asked for, or the only one."""
    if asked is not None:
        for name in known:
            if name.strip("/") == asked.strip("/"):
                return name
        found = f"{asked}{did_you_mean(asked, known)}; there is {', '.join(known) or 'none'}"
        raise InputError(bag.path, f"a topic {what}, as --{option} says", found)
    if len(known) == 1:
        return known[0]
    if known:
        expected = f"one topic {what}, or --{option} TOPIC to say which"
        raise InputError(bag.path, expected, ", ".join(known))
    found = ", ".join(bag.topics) or "none that albot reads"
    raise InputError(bag.path, f"a topic {what}", found)


def _is_static(topic: str) -> bool:
    return topic.rpartition("/")[2] == _STATIC


class _Recorded:
    """What was read of a bag so far.

    Args:
        path: The bag.
        chosen: The topics.
    """

    def __init__(self, path: Path, chosen: _Chosen) -> None:
        self._path = path
        self._chosen = chosen
        self._scans = Scans(path, chosen.scan)
        self._odometry = _PoseList(path, chosen.odometry or "the transforms")
        self._truth = _PoseList(path, chosen.truth or "")
        self._frames = FrameTree(path)
        self._odom_frame = ""
        self._base_frame = ""
        self._unstamped = 0

    def add(self, topic: str, received: int, message: Any) -> None:
        """Add a message.

        Raises:
            InputError: There are too many, or the scans are of several lasers.
        """
        if topic in self._chosen.transforms:
            stamps = [self._stamp(each.header, received) for each in message.transforms]
            self._frames.add(message, stamps, static=_is_static(topic))
            return
        stamp = self._stamp(message.header, received)
        self._unstamped += stamp_of(message.header) == 0 != received
        if topic == self._chosen.scan:
            self._scans.add(stamp, message)
            return
        is_odometry = topic == self._chosen.odometry
        if is_odometry:
            self._odom_frame = frame_name(message.header.frame_id)
            self._base_frame = frame_name(message.child_frame_id)
        pose = message.pose if hasattr(message.pose, "position") else message.pose.pose
        (self._odometry if is_odometry else self._truth).add(stamp, pose)

    @staticmethod
    def _stamp(header: Any, received: int) -> float:
        """Return a stamp (s): when the message was received if its header has none."""
        stamp = stamp_of(header) or received
        # By parts, because nanoseconds of today are no exact numbers of double precision.
        return stamp // SECOND + stamp % SECOND / SECOND

    def to_log(self) -> Log:
        """Return the log.

        Raises:
            InputError: There is no scan during the odometry; or the laser moves on the robot, or
                does not scan the level.
        """
        laser = self._scans.laser()
        if self._chosen.odometry is None:
            self._take_odometry_of_transforms(laser.frame)
        odometry = self._odometry.trajectory()
        mount, mount_notes = self._mount(laser.frame)
        geometry, ranges = laser.mounted(self._path, mount)
        stamps = laser.stamps
        order = np.argsort(stamps, kind="stable")
        inside = (stamps[order] >= odometry.stamps[0]) & (stamps[order] <= odometry.stamps[-1])
        kept = order[inside]
        if not len(kept):
            expected = "scans during the odometry"
            found = f"scans from {_period(stamps[order])}, odometry from {_period(odometry.stamps)}"
            raise InputError(self._path, expected, found)
        reference, reference_notes = self._reference(stamps[kept])
        return Log(
            name=self._path.resolve().name,
            geometry=geometry,
            stamps=stamps[kept],
            ranges=ranges[kept],
            odometry=interpolate(odometry.stamps, odometry.poses, stamps[kept]),
            reference=reference,
            notes=(
                *laser.notes,
                *mount_notes,
                *self._time_notes(stamps, order, odometry),
                *odometry.notes,
                *reference_notes,
            ),
        )

    def _take_odometry_of_transforms(self, laser: str) -> None:
        moving = self._frames.odometer_frame(laser)
        if moving is None:
            expected = "a transform from odom to the robot, or a topic of nav_msgs/Odometry"
            raise InputError(self._path, expected, "none")
        self._base_frame = moving
        self._odometry.extend(self._frames.rows(moving))

    def _mount(self, laser: str) -> tuple[Transform, tuple[str, ...]]:
        """Return the laser's pose in the robot's frame, and notes on it."""
        fixed = self._frames.robot_frame(laser, self._odom_frame)
        base = self._base_frame or ("the robot" if fixed == laser else fixed)
        mount = self._frames.mount(base, laser)
        if mount is not None:
            return mount, ()
        mount = self._frames.mount(fixed, laser)
        if fixed == laser or mount is None:
            note = (
                f"no transform leads from {base} to {laser}; the laser is taken to be at its origin"
            )
            return np.eye(4), (note,)
        return mount, (f"no transform leads from {base} to {fixed}; they are taken for the same",)

    def _reference(self, stamps: Float64[np.ndarray, "scans"]) -> tuple[Poses | None, list[str]]:
        """Return the true poses at the scans, None if they are not known, and notes."""
        if len(self._chosen.truths) > 1:
            return None, [
                f"several topics of true poses, {', '.join(self._chosen.truths)}: none is used"
            ]
        if self._truth.is_empty:
            return None, []
        truth = self._truth.trajectory()
        if stamps[0] < truth.stamps[0] or stamps[-1] > truth.stamps[-1]:
            return None, [
                f"{self._chosen.truth} does not last as long as the scans, and is not used"
            ]
        return interpolate(truth.stamps, truth.poses, stamps), truth.notes

    def _time_notes(
        self,
        stamps: Float64[np.ndarray, "scans"],
        order: Int64[np.ndarray, "scans"],
        odometry: _Trajectory,
    ) -> Iterator[str]:
        if self._unstamped:
            messages = many(self._unstamped, "message")
            yield f"{messages} without a stamp; the time of receipt is taken for it"
        moved = np.flatnonzero(order != np.arange(len(order)))
        if len(moved):
            yield (
                f"{many(len(moved), 'scan')} of {len(order):,} stood out of order and were sorted "
                f"by stamp, the first of them scan {moved[0] + 1}"
            )
        early = int((stamps < odometry.stamps[0]).sum())
        late = int((stamps > odometry.stamps[-1]).sum())
        parts = [
            f"{many(count, 'scan')} {when}"
            for count, when in ((early, "before the first"), (late, "after the last"))
            if count
        ]
        if parts:
            yield f"left out, because the odometer's pose is not known: {' and '.join(parts)}"


class _Trajectory(NamedTuple):
    """Poses in the order of time."""

    stamps: Float64[np.ndarray, "poses"]
    """Times (s), each later than the one before."""
    poses: Poses
    notes: list[str]
    """What was left out."""


class _PoseList:
    """Poses in the order of a bag.

    Args:
        path: The bag, for errors.
        topic: Where they are from.
    """

    def __init__(self, path: Path, topic: str) -> None:
        self._path = path
        self._topic = topic
        self._held = array("d")

    @property
    def is_empty(self) -> bool:
        """Whether there is no pose."""
        return not self._held

    def add(self, stamp: float, pose: Any) -> None:
        """Add a pose of ROS."""
        at, turned = pose.position, pose.orientation
        self._held.extend((stamp, at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w))
        if len(self._held) > 8 * _MOST_POSES:
            raise InputError(
                self._path, f"{_MOST_POSES:,} poses at most", "more", place=self._topic
            )

    def extend(self, rows: Float64[np.ndarray, "n 8"]) -> None:
        """Add rows of stamp, position and quaternion."""
        self._held.extend(rows.ravel().tolist())

    def trajectory(self) -> _Trajectory:
        """Return the poses by stamp; of those that share one, the last.

        Raises:
            InputError: There is no pose.
        """
        rows = np.array(self._held).reshape(-1, 8)
        poses = planar_poses(rows[:, 1:])
        good = (np.abs(poses) <= LARGEST).all(axis=1)  # False of NaN.
        if not good.any():
            found = f"{many(len(rows), 'message')} without one"
            raise InputError(self._path, "a pose", found, place=self._topic)
        notes = []
        if not good.all():
            bad = many(int((~good).sum()), "message")
            notes.append(f"{bad} of {self._topic} left out, without a finite pose")
        stamps, last = np.unique(rows[good, 0][::-1], return_index=True)
        return _Trajectory(stamps, poses[good][::-1][last], notes)


def _period(stamps: Float64[np.ndarray, "moments"]) -> str:
    return f"{stamps[0]:.3f} to {stamps[-1]:.3f} s"
