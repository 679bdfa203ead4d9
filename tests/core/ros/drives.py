"""Bags of a robot that drives on an arc in a rectangular room, written by `rosbags`.

All is known in closed form: the robot's pose at any time, and where each beam ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

ROOM = np.array((4.0, 3.0))
"""Half the sides of the room, whose middle is the origin (m)."""
SPEED, TURN = 0.4, 0.3
BEGIN = 1_700_000_000.0
SECOND = 10**9
TRANSFORMS = "tf2_msgs/msg/TFMessage"
OLD_TRANSFORMS = "tf/msg/tfMessage"


def pose_at(time: float) -> np.ndarray:
    """The robot's pose so long after the beginning: x, y, heading."""
    heading = TURN * time
    radius = SPEED / TURN
    return np.array((radius * math.sin(heading), radius * (1 - math.cos(heading)), heading))


class Sent(NamedTuple):
    """A message to be written."""

    topic: str
    kind: str
    received: float
    fields: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A drive, and how it is recorded."""

    place: tuple[float, float] = (0.0, 0.0)
    """Where the laser is on the robot (m)."""
    turned: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The laser's yaw, pitch and roll (rad)."""
    first: float = -math.pi / 2
    step: float = math.radians(1)
    beams: int = 181
    scans: int = 8
    poses: int = 41
    """Odometer's poses, one each 0.05 s."""
    odometry: Literal["odometry", "transforms"] = "odometry"
    base: str = "base_link"
    chain: tuple[str, ...] = ("base_link", "laser")
    """Frames of the static transforms; the first leads to the second, and so on."""
    static: str = "/tf_static"
    """Topic of the static transforms; empty for none."""
    transforms: str = TRANSFORMS
    norm: float = 1.0
    """Norm of all quaternions."""
    slash: str = ""
    """What precedes the names of frames."""
    edit: Callable[[int, dict[str, Any]], dict[str, Any]] = field(default=lambda _, scan: scan)
    """Changes a scan, given its number."""

    @property
    def stamps(self) -> np.ndarray:
        """Time of each scan since the beginning, between those of the poses."""
        return 0.13 + np.arange(self.scans) * 0.2

    def messages(self) -> Iterator[Sent]:
        """All messages, in the order of time."""
        sent = [*self._static(), *self._odometry(), *self._scans()]
        return iter(sorted(sent, key=lambda each: each.received))

    def ranges(self, time: float) -> np.ndarray:
        """The distance along each beam."""
        x, y, heading = pose_at(time)
        robot = Rotation.from_euler("z", heading)
        laser = robot * Rotation.from_euler("ZYX", self.turned)
        bearings = self.first + self.step * np.arange(self.beams)
        flat = np.stack((np.cos(bearings), np.sin(bearings), np.zeros(self.beams)), axis=1)
        directions = laser.apply(flat)[:, :2]
        origin = np.array((x, y)) + robot.apply((*self.place, 0.0))[:2]
        with np.errstate(divide="ignore"):
            walls = (np.sign(directions) * ROOM - origin) / directions
        return np.where(directions == 0, np.inf, walls).min(axis=1)

    def _static(self) -> Iterator[Sent]:
        if not self.static:
            return
        mount = _matrix((*self.place, 0.2), self.turned)
        for parent, child in zip(self.chain[:-1], self.chain[1:], strict=True):
            # The last one makes up for those before it.
            move = mount if child == self.chain[-1] else _matrix((0.5, -0.25, 0.1), (0.7, 0, 0))
            mount = np.linalg.solve(move, mount)
            rotation = Rotation.from_matrix(move[:3, :3])
            fields = self._transform(0.0, parent, child, move[:3, 3], rotation)
            yield Sent(self.static, self.transforms, BEGIN, fields)

    def _odometry(self) -> Iterator[Sent]:
        for number in range(self.poses):
            time = number * 0.05
            x, y, heading = pose_at(time)
            rotation = Rotation.from_euler("z", heading)
            if self.odometry == "transforms":
                fields = self._transform(BEGIN + time, "odom", self.base, (x, y, 0.0), rotation)
                yield Sent("/tf", self.transforms, BEGIN + time + 0.01, fields)
                continue
            pose = {"position": _point(x, y), "orientation": self._quaternion(rotation)}
            twist = {"linear": _point(SPEED, 0.0), "angular": _point(0.0, 0.0, TURN)}
            fields = {
                "header": self._header(BEGIN + time, "odom"),
                "child_frame_id": self.slash + self.base if self.base else "",
                "pose": {"pose": pose, "covariance": np.zeros(36)},
                "twist": {"twist": twist, "covariance": np.zeros(36)},
            }
            yield Sent("/odom", "nav_msgs/msg/Odometry", BEGIN + time + 0.01, fields)

    def _scans(self) -> Iterator[Sent]:
        for number, time in enumerate(self.stamps):
            fields = {
                "header": self._header(BEGIN + time, self.chain[-1]),
                "angle_min": self.first,
                "angle_max": self.first + self.step * (self.beams - 1),
                "angle_increment": self.step,
                "time_increment": 0.0,
                "scan_time": 0.2,
                "range_min": 0.05,
                "range_max": 20.0,
                "ranges": self.ranges(time).astype(np.float32),
                "intensities": np.empty(0, np.float32),
            }
            yield Sent(
                "/scan",
                "sensor_msgs/msg/LaserScan",
                BEGIN + time + 0.04,
                self.edit(number, fields),
            )

    def _transform(
        self, stamp: float, parent: str, child: str, move: Iterable[float], rotation: Rotation
    ) -> dict[str, Any]:
        moved = {"translation": _point(*move), "rotation": self._quaternion(rotation)}
        header = self._header(stamp, parent)
        one = {"header": header, "child_frame_id": self.slash + child, "transform": moved}
        return {"transforms": [one]}

    def _header(self, stamp: float, frame: str) -> dict[str, Any]:
        return {"seq": 0, "stamp": stamp, "frame_id": self.slash + frame}

    def _quaternion(self, rotation: Rotation) -> dict[str, float]:
        names = ("x", "y", "z", "w")
        return dict(zip(names, (self.norm * rotation.as_quat()).tolist(), strict=True))


def _point(x: float, y: float, z: float = 0.0) -> dict[str, float]:
    return {"x": float(x), "y": float(y), "z": float(z)}


def _matrix(place: tuple[float, ...], turned: tuple[float, ...]) -> np.ndarray:
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_euler("ZYX", turned).as_matrix()
    moved[:3, 3] = place
    return moved


def nanoseconds(seconds: float) -> int:
    """Seconds as whole nanoseconds, to a microsecond."""
    return round(seconds * 1e6) * 1000


_ROS1 = get_typestore(Stores.ROS1_NOETIC)
for _kind in (TRANSFORMS, OLD_TRANSFORMS):
    _ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _kind))
_ROS2 = get_typestore(Stores.ROS2_HUMBLE)


def _content(types: Any, kind: str, value: Any) -> Any:
    """A message of a type, of plain values."""
    if kind == "builtin_interfaces/msg/Time":
        seconds, rest = divmod(nanoseconds(value), SECOND)
        return types.types[kind](sec=seconds, nanosec=rest)
    fields = {}
    for name, (node, inner) in types.fielddefs[kind][1]:
        each = value[name]
        if node.name == "NAME":
            fields[name] = _content(types, inner, each)
        elif isinstance(each, list):
            fields[name] = [_content(types, inner[0][1], one) for one in each]
        else:
            fields[name] = each
    return types.types[kind](**fields)


def write_ros1(messages: Iterable[Sent], path: Path, compression: str = "") -> Path:
    """Write a bag of ROS 1."""
    writer = rosbag1.Writer(path)
    if compression:
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression.upper()])
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, received, fields in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=_ROS1)
            data = _ROS1.serialize_ros1(_content(_ROS1, kind, fields), kind)
            writer.write(connections[topic], nanoseconds(received), data)
    return path


def write_ros2(
    messages: Iterable[Sent], folder: Path, storage: str = "mcap", compression: str = ""
) -> Path:
    """Write a bag of ROS 2; its compression is a mode of `rosbags`: file, message or storage."""
    writer = rosbag2.Writer(folder, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compression:
        mode = rosbag2.CompressionMode[compression.upper()]
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, received, fields in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=_ROS2)
            data = _ROS2.serialize_cdr(_content(_ROS2, kind, fields), kind)
            writer.write(connections[topic], nanoseconds(received), data)
    return folder
