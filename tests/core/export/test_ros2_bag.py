"""ROS 2 bags as the libraries `rosbags` and `mcap` read them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from albot_core.errors import InputError
from albot_core.export import ros2_bag
from albot_core.export.ros2_bag import write_ros2_bag
from albot_core.geometry.poses import compose
from albot_core.logs.log import Log
from albot_core.sensing.reading import LaserGeometry

LASER = LaserGeometry(beams=9, first_bearing=-1.0, spacing=0.25, mount=(0.2, -0.1, 0.3))
SPEED, TURN = 0.5, 0.2


def made(**changes: Any) -> Log:
    """A robot that drives along an arc at a constant speed, with a scan each half a second."""
    motions = np.tile((SPEED / 2, 0.0, TURN / 2), (6, 1))
    odometry = [np.array((1.0, 2.0, 3.0))]
    for motion in motions[1:]:
        odometry.append(compose(odometry[-1], motion))
    ranges = np.arange(54.0).reshape(6, 9) + 0.25
    log = Log(
        name="made",
        geometry=LASER,
        stamps=1_700_000_000 + np.arange(6) / 2,
        ranges=ranges,
        odometry=np.array(odometry),
        reference=np.array(odometry) + 0.5,
    )
    return replace(log, **changes)


def contents(folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """The stamps (ns) and messages of each topic."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder]) as reader:
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    return found


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_holds_what_the_log_holds(
    storage: Literal["mcap", "sqlite3"], tmp_path: Path
) -> None:
    log = made()
    write_ros2_bag(log, tmp_path / "drive", storage=storage)
    found = contents(tmp_path / "drive")
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/tf_static": 1, "/tf": 6, "/odom": 6, "/ground_truth": 6, "/scan": 6,
    }  # fmt: skip
    for scan in range(6):
        for topic in ("/tf", "/odom", "/ground_truth", "/scan"):
            assert found[topic][scan][0] == 1_700_000_000 * 10**9 + scan * 10**9 // 2
        message = found["/scan"][scan][1]
        assert message.header.frame_id == "laser"
        assert message.header.stamp.sec + message.header.stamp.nanosec / 1e9 == log.stamps[scan]
        assert len(message.ranges) == 9
        hit = log.ranges is not None and log.ranges[scan] < 30.0
        np.testing.assert_array_equal(np.isfinite(message.ranges), hit)
        assert message.angle_max == pytest.approx(1.0)
        odometry = found["/odom"][scan][1]
        assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
        x, y, heading = log.odometry[scan]
        at, turned = odometry.pose.pose.position, odometry.pose.pose.orientation
        assert (at.x, at.y) == (x, y)
        assert 2 * np.arctan2(turned.z, turned.w) % (2 * np.pi) == pytest.approx(
            heading % (2 * np.pi)
        )
        (moved,) = found["/tf"][scan][1].transforms
        assert (moved.header.frame_id, moved.child_frame_id) == ("odom", "base_link")
        assert moved.transform.rotation == turned
        assert moved.transform.translation.x == x
        twist = odometry.twist.twist
        assert twist.linear.x == pytest.approx(SPEED if scan else 0.0)
        assert twist.angular.z == pytest.approx(TURN if scan else 0.0)
        assert found["/ground_truth"][scan][1].pose.position.x == x + 0.5
    (mount,) = found["/tf_static"][0][1].transforms
    assert (mount.header.frame_id, mount.child_frame_id) == ("base_link", "laser")
    assert mount.transform.translation.x == 0.2


def test_players_keep_the_mount_for_late_subscribers(tmp_path: Path) -> None:
    write_ros2_bag(made(), tmp_path / "drive")
    with AnyReader([tmp_path / "drive"]) as reader:
        durable = {
            connection.topic: connection.ext.offered_qos_profiles[0].durability
            for connection in reader.connections
        }
    assert durable.pop("/tf_static") is QosDurability.TRANSIENT_LOCAL
    assert set(durable.values()) == {QosDurability.VOLATILE}
    said = yaml.safe_load((tmp_path / "drive" / "metadata.yaml").read_text())
    information = said["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == ["drive.mcap"]
    assert information["message_count"] == 25
    profile = information["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"]
    assert yaml.safe_load(profile)[0]["deadline"] == {"sec": 9223372036, "nsec": 854775807}


def test_the_library_mcap_reads_it_and_transforms_come_before_scans(tmp_path: Path) -> None:
    write_ros2_bag(made(reference=None), tmp_path / "drive")
    with (tmp_path / "drive" / "drive.mcap").open("rb") as stream:
        topics = [
            channel.topic
            for _, channel, _ in make_reader(stream, validate_crcs=True).iter_messages()
        ]
    assert topics == ["/tf_static", *(["/tf", "/odom", "/scan"] * 6)]


def test_stamps_rise_whatever_the_clock(tmp_path: Path) -> None:
    stamps = np.array((5.0, 6.0, 6.0, 3.0, 4.0, 5.0))
    log = made(stamps=stamps)
    write_ros2_bag(log, tmp_path / "drive")
    found = [stamp for stamp, _ in contents(tmp_path / "drive")["/scan"]]
    assert (np.diff(found) > 0).all()
    np.testing.assert_allclose(np.array(found) / 1e9, log.times, atol=1e-8)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"geometry": None, "ranges": None}, "made: expected a laser, found none"),
        ({"stamps": np.arange(6) - 2.0}, "made, scan 1: expected stamps from 0 .*, found -2"),
        ({"stamps": np.arange(6) + 3e9}, r"made, scan 1: expected stamps .*, found 3e\+09"),
    ],
)
def test_what_ros_cannot_hold_is_refused(
    changes: dict[str, Any], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=expected):
        write_ros2_bag(made(**changes), tmp_path / "drive")
    assert not list(tmp_path.iterdir())


def test_a_folder_with_files_is_kept(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").touch()
    with pytest.raises(InputError, match="empty or does not exist"):
        write_ros2_bag(made(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_broken_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(ros2_bag.shutil, "move", fail)
    with pytest.raises(OSError, match="disk full"):
        write_ros2_bag(made(), tmp_path / "new" / "drive")
    assert not list(tmp_path.iterdir())
