"""ROS 2 bags, which `ros2 bag play` plays to slam_toolbox, nav2 and others.

- `/tf_static` (tf2_msgs/TFMessage): `base_link` to `laser`, the laser's mount; once, first.
- `/tf` (tf2_msgs/TFMessage): `odom` to `base_link`, at every scan and before it.
- `/odom` (nav_msgs/Odometry): the same pose, and the velocity since the scan before.
- `/ground_truth` (geometry_msgs/PoseStamped): the reference in the frame `world`, where the log
  has one.
- `/scan` (sensor_msgs/LaserScan): `inf` where nothing returned (REP 117).
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.files import new_folder, scratch_folder
from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose, Ranges
from albot_core.logs.log import Log
from albot_core.logs.ros_bag import TRUTH
from albot_core.ros.bag import METADATA
from albot_core.ros.messages import (
    ODOMETRY,
    POSE,
    SCAN,
    SECOND,
    TRANSFORMS,
    check_rosbags,
    ros2_types,
)
from albot_core.ros.scans import above
from albot_core.sensing.reading import LaserGeometry

if TYPE_CHECKING:
    from rosbags.interfaces import Qos

Storage = Literal["mcap", "sqlite3"]

ODOM, BASE, LASER, WORLD = "odom", "base_link", "laser", "world"
"""Names of the frames."""
_VERSION: Literal[8] = 8
"""Version of the metadata: the last whose quality of service Humble reads, and Jazzy, too."""
_SCAN, _ODOMETRY, _TRUTH, _MOVING, _STATIC = "/scan", "/odom", f"/{TRUTH}", "/tf", "/tf_static"
_LATEST = 2**31
"""Stamps (s) from this on do not fit in a ROS message."""


def write_ros2_bag(log: Log, folder: Path, *, storage: Storage = "mcap") -> None:
    """Write a log as a ROS 2 bag: a folder with `metadata.yaml` and one file of messages.

    Stamps are the log's `times`. Those of scans that share one are put a nanosecond apart, because
    ROS drops a transform that is not later than the last one. Ranges and angles have single
    precision, as in LaserScan. Sonars and scenes are left out.

    Args:
        log: The log, which must have a laser.
        folder: The bag's folder. It must not exist, or be empty.
        storage: Format of the file of messages.

    Raises:
        InputError: `rosbags` is not installed; the log has no laser, or has stamps that ROS cannot
            hold; the folder cannot be made, or holds files.
    """
    check_rosbags(folder)
    if log.geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    stamps = _nanoseconds(log)
    folder = folder.resolve()
    with new_folder(folder), scratch_folder() as scratch:
        if any(folder.iterdir()):
            raise InputError(folder, "a folder that is empty or does not exist", "one with files")
        bag = scratch / folder.name  # The library makes it, and names the file after it.
        _write(bag, storage, _messages(log, log.geometry, log.ranges, stamps))
        # The file that makes it a bag is the last.
        for path in sorted(bag.iterdir(), key=lambda path: path.name == METADATA):
            shutil.move(path, folder)


def _write(bag: Path, storage: Storage, messages: Iterator[tuple[str, int, Any]]) -> None:
    """Write messages to a folder that does not exist: of each the topic, stamp (ns) and content."""
    from rosbags.interfaces import Connection
    from rosbags.rosbag2 import StoragePlugin, Writer

    types = ros2_types()
    plugin = StoragePlugin[storage.upper()]
    connections: dict[str, Connection] = {}
    with Writer(bag, version=_VERSION, storage_plugin=plugin) as writer:
        for topic, stamp, content in messages:
            kind = content.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, kind, typestore=types, offered_qos_profiles=[_quality(topic)]
                )
            writer.write(connections[topic], stamp, types.serialize_cdr(content, kind))


def _messages(
    log: Log,
    geometry: LaserGeometry,
    ranges: Float64[np.ndarray, "scans beams"],
    stamps: Int64[np.ndarray, "scans"],
) -> Iterator[tuple[str, int, Any]]:
    """Yield all messages: what places a scan comes before it."""
    make = _Maker()
    seen = np.where(ranges < geometry.max_range, ranges, np.inf)
    durations = np.diff(stamps) / SECOND
    period = float(np.median(durations)) if len(durations) else 0.0
    velocities = np.zeros_like(log.odometry)
    velocities[1:] = relative(log.odometry[:-1], log.odometry[1:]) / durations[:, None]
    for scan, stamp in enumerate(stamps.tolist()):
        if scan == 0:
            yield _STATIC, stamp, make.transform(stamp, BASE, LASER, np.array(geometry.mount))
        pose = log.odometry[scan]
        yield _MOVING, stamp, make.transform(stamp, ODOM, BASE, pose)
        yield _ODOMETRY, stamp, make.odometry(stamp, pose, velocities[scan])
        if log.reference is not None:
            yield _TRUTH, stamp, make.truth(stamp, log.reference[scan])
        yield _SCAN, stamp, make.scan(stamp, geometry, seen[scan], period)


class _Maker:
    """Makes messages. Stamps are in nanoseconds, poses and ranges as everywhere."""

    def __init__(self) -> None:
        self._types = ros2_types().types

    def scan(self, stamp: int, laser: LaserGeometry, ranges: Ranges, period: float) -> Any:
        """Return a LaserScan; `period` is the time between scans (s)."""
        last = laser.first_bearing + (laser.beams - 1) * laser.spacing
        sent, reach = ranges.astype(np.float32), laser.max_range
        # Readers take a range of range_max for no return; single precision may round up to it.
        if (sent >= np.float32(reach)).any(where=np.isfinite(ranges)):
            reach = above(reach)
        return self._types[SCAN](
            header=self._header(stamp, LASER),
            angle_min=laser.first_bearing,
            angle_max=last,
            angle_increment=laser.spacing,
            time_increment=0.0,
            scan_time=period,
            range_min=0.0,
            range_max=reach,
            ranges=sent,
            intensities=np.empty(0, np.float32),
        )

    def odometry(self, stamp: int, pose: Pose, velocity: Pose) -> Any:
        """Return an Odometry; the velocity is in the robot's frame (m/s, rad/s)."""
        x, y, turn = velocity.tolist()
        twist = self._geometry(
            "Twist", linear=self._vector(x, y), angular=self._vector(0.0, 0.0, turn)
        )
        unknown = np.zeros(36)
        return self._types[ODOMETRY](
            header=self._header(stamp, ODOM),
            child_frame_id=BASE,
            pose=self._geometry("PoseWithCovariance", pose=self._pose(pose), covariance=unknown),
            twist=self._geometry("TwistWithCovariance", twist=twist, covariance=unknown),
        )

    def truth(self, stamp: int, pose: Pose) -> Any:
        """Return a PoseStamped of the true pose."""
        header = self._header(stamp, WORLD)
        return self._types[POSE](header=header, pose=self._pose(pose))

    def transform(self, stamp: int, parent: str, child: str, pose: Pose) -> Any:
        """Return a TFMessage with the pose of the frame `child` in the frame `parent`."""
        x, y, heading = pose.tolist()
        moved = self._geometry(
            "Transform", translation=self._vector(x, y), rotation=self._turn(heading)
        )
        header = self._header(stamp, parent)
        one = self._geometry(
            "TransformStamped", header=header, child_frame_id=child, transform=moved
        )
        return self._types[TRANSFORMS](transforms=[one])

    def _geometry(self, name: str, **fields: Any) -> Any:
        return self._types[f"geometry_msgs/msg/{name}"](**fields)

    def _header(self, stamp: int, frame: str) -> Any:
        seconds, rest = divmod(stamp, SECOND)
        time = self._types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
        return self._types["std_msgs/msg/Header"](stamp=time, frame_id=frame)

    def _pose(self, pose: Pose) -> Any:
        x, y, heading = pose.tolist()
        place = self._geometry("Point", x=x, y=y, z=0.0)
        return self._geometry("Pose", position=place, orientation=self._turn(heading))

    def _turn(self, heading: float) -> Any:
        sin, cos = math.sin(heading / 2), math.cos(heading / 2)
        return self._geometry("Quaternion", x=0.0, y=0.0, z=sin, w=cos)

    def _vector(self, x: float, y: float, z: float = 0.0) -> Any:
        return self._geometry("Vector3", x=x, y=y, z=z)


def _quality(topic: str) -> Qos:
    """Return a topic's quality of service: `/tf_static` is kept for those that subscribe later."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    unlimited = QosTime(2**63 // SECOND, 2**63 % SECOND - 1)
    is_static = topic == _STATIC
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if is_static else 100,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if is_static else QosDurability.VOLATILE,
        deadline=unlimited,
        lifespan=unlimited,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=unlimited,
        avoid_ros_namespace_conventions=False,
    )


def _nanoseconds(log: Log) -> Int64[np.ndarray, "scans"]:
    """Return the time of every scan (ns), each later than the one before.

    Raises:
        InputError: One is negative, or does not fit in a message.
    """
    for scan in (int(log.times.argmin()), int(log.times.argmax())):
        if not 0 <= log.times[scan] < _LATEST:
            found, place = f"{log.times[scan]:g}", f"scan {scan + 1}"
            raise InputError(log.name, f"stamps from 0 to {_LATEST} s", found, place=place)
    seconds = np.floor(log.times)
    # By parts, because the product of a whole stamp of today is exact to 256 ns only.
    whole = seconds.astype(np.int64) * SECOND
    stamps = whole + np.round((log.times - seconds) * SECOND).astype(np.int64)
    count = np.arange(len(stamps))
    return np.asarray(np.maximum.accumulate(stamps - count) + count)
