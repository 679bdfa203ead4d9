"""The messages that are read and written, by the definitions that `rosbags` brings.

The definitions in a bag are not used: those of these messages have not changed, and code is made
of a definition.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from albot_core.errors import InputError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
KINDS = (SCAN, ODOMETRY, POSE, TRANSFORMS)
"""The types of messages, by their names in ROS 2."""
_OLD_TRANSFORMS = "tf/msg/tfMessage"
"""What `TRANSFORMS` was at first in ROS 1, with the same content."""
ENCODINGS = ("cdr", "ros1")
"""How messages are encoded in ROS 2 and in ROS 1."""
SECOND = 10**9
"""A second in nanoseconds."""
ROS_EXTRA = "pip install 'albot-env[ros]'"
"""The command that installs `rosbags`."""


def check_rosbags(source: object) -> None:
    """Check that `rosbags` is installed.

    Args:
        source: The bag, for the error.

    Raises:
        InputError: It is missing; the message says how to install it.
    """
    if find_spec("rosbags") is None:
        expected = f"the package rosbags, which the extra `ros` brings ({ROS_EXTRA})"
        raise InputError(source, expected, "none")


def kind_of_message(name: str) -> str:
    """Return a type by its name in ROS 2, given the one in a bag: `tf/tfMessage`."""
    package, _, rest = name.partition("/")
    kind = f"{package}/msg/{rest.removeprefix('msg/')}"
    return TRANSFORMS if kind == _OLD_TRANSFORMS else kind


@cache
def ros2_types() -> Typestore:
    """Return the types of Humble; of those used here, all releases of ROS 2 have the same."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


@cache
def _ros1_types() -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC)
    types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return types


def decode(data: bytes, kind: str, encoding: str) -> Any:
    """Return a message; `kind` is one of `KINDS`, `encoding` one of `ENCODINGS`.

    Raises as the library does; see `albot_core.ros.bag.DAMAGE`.
    """
    if encoding == "ros1":
        return _ros1_types().deserialize_ros1(data, kind)
    return ros2_types().deserialize_cdr(data, kind)


def stamp_of(header: Any) -> int:
    """Return a header's stamp (ns)."""
    return int(header.stamp.sec) * SECOND + int(header.stamp.nanosec)
