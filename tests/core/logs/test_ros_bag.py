"""Bags of ROS: what each beam hit lies on a wall of the room, however the laser is mounted."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from albot_core.errors import InputError
from albot_core.export.ros2_bag import write_ros2_bag
from albot_core.geometry.poses import transform_points
from albot_core.logs.example import EXAMPLE
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log
from albot_core.logs.ros_bag import BagTopics
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import LaserScan
from tests.core.ros.drives import (
    BEGIN,
    OLD_TRANSFORMS,
    ROOM,
    Drive,
    Sent,
    pose_at,
    write_ros1,
    write_ros2,
)

CONTAINERS: dict[str, Callable[[Any, Path], Path]] = {
    "ros1": lambda sent, folder: write_ros1(sent, folder / "a.bag"),
    "ros1-lz4": lambda sent, folder: write_ros1(sent, folder / "a.bag", "lz4"),
    "ros1-bz2": lambda sent, folder: write_ros1(sent, folder / "a.bag", "bz2"),
    "mcap": lambda sent, folder: write_ros2(sent, folder / "a"),
    "mcap-file": lambda sent, folder: write_ros2(sent, folder / "a", "mcap", "file"),
    "mcap-message": lambda sent, folder: write_ros2(sent, folder / "a", "mcap", "message"),
    "mcap-chunks": lambda sent, folder: write_ros2(sent, folder / "a", "mcap", "storage"),
    "bare mcap": lambda sent, folder: write_ros2(sent, folder / "a") / "a.mcap",
    "sqlite": lambda sent, folder: write_ros2(sent, folder / "a", "sqlite3"),
    "sqlite-file": lambda sent, folder: write_ros2(sent, folder / "a", "sqlite3", "file"),
    "sqlite-message": lambda sent, folder: write_ros2(sent, folder / "a", "sqlite3", "message"),
    "bare sqlite": lambda sent, folder: write_ros2(sent, folder / "a", "sqlite3") / "a.db3",
}


def check(log: Log, drive: Drive, hits: float = 1.0) -> None:
    """Poses and stamps are the true ones, and what the beams hit lies on the walls."""
    np.testing.assert_allclose(log.stamps, BEGIN + drive.stamps, atol=1e-6)
    truth = np.array([pose_at(time) for time in drive.stamps])
    np.testing.assert_allclose(log.odometry, truth, atol=2e-6)
    assert log.geometry is not None
    assert log.ranges is not None
    seen = 0
    for pose, ranges in zip(truth, log.ranges, strict=True):
        points = transform_points(pose, LaserScan(ranges=ranges, geometry=log.geometry).points)
        assert np.abs((np.abs(points) - ROOM).max(axis=1)).max() < 1e-5
        seen += len(points)
    assert seen == pytest.approx(hits * log.ranges.size, abs=1)


@pytest.mark.parametrize("container", CONTAINERS)
def test_all_containers_are_read(container: str, tmp_path: Path) -> None:
    drive = Drive(place=(0.2, -0.1), turned=(0.3, 0.0, 0.0))
    log = read_log(CONTAINERS[container](drive.messages(), tmp_path))
    check(log, drive)
    assert log.notes == ()
    assert log.geometry is not None
    assert log.geometry.mount == pytest.approx((0.2, -0.1, 0.3), abs=1e-6)
    assert log.geometry.max_range == 20.0


HALF, FULL = math.pi, 2 * math.pi
DRIVES = {
    "at the origin": Drive(),
    "ahead and turned": Drive(place=(0.3, 0.2), turned=(1.2, 0.0, 0.0)),
    "backwards": Drive(place=(-0.3, 0.0), turned=(HALF, 0.0, 0.0)),
    "upside down": Drive(turned=(0.0, 0.0, HALF)),
    "upside down, turned and ahead": Drive(place=(0.3, -0.2), turned=(0.8, 0.0, HALF)),
    "upside down by its pitch": Drive(place=(0.3, -0.2), turned=(0.8, HALF, 0.0)),
    "clockwise": Drive(first=HALF / 2, step=-math.radians(1), turned=(0.4, 0, 0)),
    "clockwise, upside down": Drive(first=1.0, step=-math.radians(1), turned=(0.4, 0, HALF)),
    "not symmetric": Drive(first=-0.3, step=0.01, beams=90, turned=(0, 0, HALF)),
    "a full circle from 0": Drive(first=0.0, step=FULL / 360, beams=360),
    "a full circle, its last beam the first": Drive(first=-HALF, step=FULL / 360, beams=361),
    "more than a circle": Drive(first=-HALF, step=FULL / 360, beams=400, turned=(0, 0, HALF)),
    "a chain of frames": Drive(chain=("base_link", "plate", "mast", "laser"), place=(0.3, 0.1)),
    "frames above": Drive(base="base_link", chain=("base_link", "laser"), slash="/"),
    "transforms": Drive(odometry="transforms", place=(0.3, 0.1), turned=(0.4, 0.0, HALF)),
    "old static transforms": Drive(static="/tf", odometry="transforms", turned=(0.4, 0.0, 0.0)),
    "odometry, old static transforms": Drive(static="/tf", turned=(0.4, 0.0, 0.0)),
    "quaternions not normalised": Drive(norm=1.004, turned=(0.4, 0.0, HALF)),
    "footprint": Drive(
        base="base_footprint", chain=("base_footprint", "base_link", "laser"), place=(0.3, 0.1)
    ),
    "unknown footprint": Drive(base="base_footprint", place=(0.3, 0.1)),
    "no child frame": Drive(base="", place=(0.3, 0.1), turned=(0.4, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", DRIVES)
def test_what_beams_hit_is_on_the_walls(name: str, tmp_path: Path) -> None:
    drive = DRIVES[name]
    write = CONTAINERS["ros1" if len(name) % 2 else "mcap"]
    log = read_log(write(drive.messages(), tmp_path))
    check(log, drive)
    taken = [note for note in log.notes if "taken for the same" in note]
    assert bool(taken) == (name == "unknown footprint")


def test_the_first_transforms_of_ros_1_are_read(tmp_path: Path) -> None:
    drive = Drive(odometry="transforms", transforms=OLD_TRANSFORMS, place=(0.2, 0.0))
    check(read_log(write_ros1(drive.messages(), tmp_path / "a.bag")), drive)


def test_without_a_mount_the_laser_is_at_the_origin_and_a_note_says_so(tmp_path: Path) -> None:
    drive = Drive(static="")
    log = read_log(write_ros2(drive.messages(), tmp_path / "a"))
    check(log, drive)
    (note,) = log.notes
    assert note.startswith("no transform leads from base_link to laser")


def test_frames_other_than_the_laser_and_a_corrected_frame_do_not_matter(tmp_path: Path) -> None:
    """A map frame over the odometer's, a wheel that turns, and another robot's frames."""
    drive = Drive(odometry="transforms", place=(0.2, 0.0), turned=(0.3, 0.0, 0.0))
    sent = list(drive.messages())
    (some,) = [each for each in sent if each.topic == "/tf"][:1]
    for number in range(20):
        for parent, child in (("map", "odom"), ("base_link", "wheel"), ("other", "thing")):
            fields = drive._transform(
                BEGIN + number / 10, parent, child, (number / 50, 0.0, 0.0), pose_rotation(number)
            )
            sent.append(some._replace(received=BEGIN + number / 10, fields=fields))
    sent.sort(key=lambda each: each.received)
    check(read_log(write_ros2(sent, tmp_path / "a")), drive)


def pose_rotation(number: int) -> Rotation:
    return Rotation.from_euler("z", number / 9)


def test_the_robots_frame_may_hang_below_the_one_that_holds_the_laser(tmp_path: Path) -> None:
    """Of a transform from base_footprint to base_link the inverse is published."""
    frames = ("base_footprint", "base_link", "laser")
    drive = Drive(base=frames[0], chain=frames, place=(0.3, 0.1), turned=(0.4, 0.0, math.pi))
    sent = list(drive.messages())
    (link,) = sent[0].fields["transforms"]
    assert link["child_frame_id"] == "base_link"
    moved = link["transform"]
    rotation = Rotation.from_quat([moved["rotation"][name] for name in "xyzw"]).inv()
    place = rotation.apply([-moved["translation"][name] for name in "xyz"])
    fields = drive._transform(0.0, "base_link", "base_footprint", place, rotation)
    check(read_log(write_ros2([sent[0]._replace(fields=fields), *sent[1:]], tmp_path / "a")), drive)


def test_what_is_no_measurement_is_no_return(tmp_path: Path) -> None:
    bad = (0.0, -1.0, 0.04, np.nan, np.inf, -np.inf, 20.0, 65.533)

    def spoil(_: int, scan: dict[str, Any]) -> dict[str, Any]:
        scan["ranges"][5:13] = bad
        return scan

    drive = Drive(edit=spoil)
    log = read_log(write_ros1(drive.messages(), tmp_path / "a.bag"))
    assert log.ranges is not None
    assert np.isinf(log.ranges[:, 5:13]).all()
    check(log, drive, hits=1 - 8 / 181)


@pytest.mark.parametrize("claimed", [0.0, math.inf, math.nan, -1.0])
def test_a_maximum_that_is_none_is_not_believed(claimed: float, tmp_path: Path) -> None:
    drive = Drive(edit=lambda _, scan: scan | {"range_max": claimed, "range_min": claimed})
    if claimed > 0:
        drive = replace(drive, edit=lambda _, scan: scan | {"range_max": claimed})
    check(read_log(write_ros2(drive.messages(), tmp_path / "a")), drive)


def test_numbers_of_beams_that_vary_are_led_back_to_the_commonest(tmp_path: Path) -> None:
    """As of lasers whose motor turns unevenly."""

    def uneven(number: int, scan: dict[str, Any]) -> dict[str, Any]:
        beams = 700 + (number == 2) - 3 * (number == 4)
        own = replace(Drive(), first=0.0, step=FULL / beams, beams=beams)
        return scan | {
            "angle_increment": own.step,
            "ranges": own.ranges(own.stamps[number]).astype(np.float32),
        }

    drive = Drive(first=0.0, step=FULL / 700, beams=700, edit=uneven)
    log = read_log(write_ros2(drive.messages(), tmp_path / "a"))
    assert log.ranges is not None
    assert log.ranges.shape == (8, 700)
    np.testing.assert_allclose(log.ranges[4], drive.ranges(drive.stamps[4]), atol=0.1)
    assert np.isfinite(log.ranges).all()
    assert "2 scans of 8 with other beams than the 700 of most" in log.notes[0]


def test_messages_may_come_late_and_the_stamp_in_the_header_counts(tmp_path: Path) -> None:
    drive = Drive(place=(0.2, 0.0))
    rng = np.random.default_rng(0)
    sent = sorted(drive.messages(), key=lambda each: each.received + rng.uniform(0, 0.5))
    sent = [each._replace(received=BEGIN + 100 + k / 100) for k, each in enumerate(sent)]
    log = read_log(write_ros2(sent, tmp_path / "a"))
    check(log, drive)
    assert "out of order and were sorted by stamp" in log.notes[0]


def test_messages_without_stamps_have_those_of_their_receipt(tmp_path: Path) -> None:
    drive = Drive()
    sent = []
    for each in drive.messages():
        fields = each.fields
        if "header" in fields:
            late = each.received - fields["header"]["stamp"]
            fields = fields | {"header": fields["header"] | {"stamp": 0.0}}
            each = each._replace(received=each.received - late)
        sent.append(each._replace(fields=fields))
    log = read_log(write_ros1(sorted(sent, key=lambda each: each.received), tmp_path / "a.bag"))
    check(log, drive)
    assert "49 messages without a stamp" in log.notes[0]


def test_scans_without_odometry_are_left_out_with_a_note(tmp_path: Path) -> None:
    drive = Drive()
    sent = [
        each
        for each in drive.messages()
        if each.topic != "/odom" or 0.4 <= each.fields["header"]["stamp"] - BEGIN <= 1.2
    ]
    log = read_log(write_ros2(sent, tmp_path / "a"))
    np.testing.assert_allclose(log.stamps, BEGIN + drive.stamps[2:6], atol=1e-6)
    truth = [pose_at(time) for time in drive.stamps[2:6]]
    np.testing.assert_allclose(log.odometry, truth, atol=2e-6)
    (note,) = log.notes
    assert note.endswith("2 scans before the first and 2 scans after the last")


def test_poses_that_are_none_are_left_out_with_a_note(tmp_path: Path) -> None:
    drive = Drive()
    sent = list(drive.messages())
    for number, each in enumerate(each for each in sent if each.topic == "/odom"):
        if number in (2, 7):
            pose = each.fields["pose"]["pose"]
            pose["position"] = {"x": math.nan, "y": 0.0, "z": 0.0}
        elif number == 10:
            pose = each.fields["pose"]["pose"]
            pose["orientation"] = dict.fromkeys("xyzw", 0.0)
    log = read_log(write_ros1(sent, tmp_path / "a.bag"))
    check(log, drive)
    assert log.notes == ("3 messages of /odom left out, without a finite pose",)


# The topics.


def twice(drive: Drive, topic: str, other: str) -> list[Sent]:
    """The messages of a drive, those of a topic on another one, too."""
    sent = list(drive.messages())
    return [
        copy
        for each in sent
        for copy in ((each, each._replace(topic=other)) if each.topic == topic else (each,))
    ]


@pytest.mark.parametrize(("topic", "option"), [("/scan", "scan"), ("/odom", "odom")])
def test_several_topics_are_listed_and_the_option_named(
    topic: str, option: str, tmp_path: Path
) -> None:
    drive = Drive()
    path = write_ros2(twice(drive, topic, f"/more{topic}"), tmp_path / "a")
    expected = rf"or --{option} TOPIC to say which, found /more{topic}, {topic}$"
    with pytest.raises(InputError, match=expected):
        read_log(path)
    for asked in (topic, f"more{topic}"):
        check(read_log(path, topics=BagTopics(**{option: asked})), drive)
    with pytest.raises(InputError, match=rf"as --{option} says, found /none; there is /more"):
        read_log(path, topics=BagTopics(**{option: "/none"}))


@pytest.mark.parametrize(
    ("left_out", "expected"),
    [
        ("/scan", r"expected a topic of sensor_msgs/LaserScan, found /odom, /tf_static$"),
        ("/odom", r"expected a topic of nav_msgs/Odometry, or of transforms .*, found /scan"),
    ],
)
def test_a_topic_that_is_missing_is_told(left_out: str, expected: str, tmp_path: Path) -> None:
    sent = [each for each in Drive().messages() if each.topic != left_out]
    with pytest.raises(InputError, match=expected):
        read_log(write_ros1(sent, tmp_path / "a.bag"))


def test_transforms_can_be_asked_for_where_there_is_odometry(tmp_path: Path) -> None:
    drive = Drive(place=(0.2, 0.0))
    moved = Drive(odometry="transforms", place=(0.2, 0.0))
    wrong = [
        each._replace(fields=each.fields | {"pose": {**each.fields["pose"]}})
        for each in drive.messages()
        if each.topic == "/odom"
    ]
    for each in wrong:
        each.fields["pose"]["pose"] = {
            "position": {"x": 0.0, "y": 0.0, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        }
    sent = sorted([*moved.messages(), *wrong], key=lambda each: each.received)
    path = write_ros2(sent, tmp_path / "a")
    check(read_log(path, topics=BagTopics(odom="/tf")), drive)
    assert read_log(path).is_odometry_constant


@pytest.mark.parametrize("topic", ["/ground_truth", "/base_pose_ground_truth"])
def test_true_poses_are_the_reference_and_no_odometry(topic: str, tmp_path: Path) -> None:
    drive = Drive()
    log = read_log(write_ros1(twice(drive, "/odom", topic), tmp_path / "a.bag"))
    check(log, drive)
    assert log.reference is not None
    np.testing.assert_allclose(log.reference, log.odometry, atol=1e-9)


def test_of_several_true_poses_none_is_used_and_a_note_says_so(tmp_path: Path) -> None:
    drive = Drive()
    more = twice(drive, "/odom", "/b/ground_truth2")
    truth = [each._replace(topic="/ground_truth") for each in more if each.topic == "/odom"]
    sent = sorted([*more, *truth], key=lambda each: each.received)
    log = read_log(write_ros2(sent, tmp_path / "a"))
    assert log.reference is None
    assert any("several topics of true poses" in note for note in log.notes)


def test_topics_of_what_is_no_bag_are_refused() -> None:
    with pytest.raises(InputError, match="expected a ROS bag, as topics are given, found a robot"):
        read_log(EXAMPLE, topics=BagTopics(scan="/scan"))


# What cannot be read.


def other_frame(number: int, scan: dict[str, Any]) -> dict[str, Any]:
    return scan | {"header": scan["header"] | {"frame_id": f"laser{number % 2}"}}


@pytest.mark.parametrize(
    ("drive", "expected"),
    [
        (Drive(turned=(0.0, 0.5, 0.0)), "scans the level, found one that is tilted by 29°"),
        (Drive(edit=other_frame), "scans of one laser, in the frame laser0, found laser1"),
        (Drive(beams=0), "scans of two beams or more"),
        (Drive(beams=5, step=0.0), "scans of two beams or more"),
        (Drive(beams=3, step=2.0), r"/scan: expected an angle within \(0, pi/2\], found 2"),
        (Drive(norm=0.0), "expected a pose, found 41 messages without one"),
        (Drive(scans=0), "expected a topic of sensor_msgs/LaserScan"),
    ],
)
def test_a_laser_that_is_none_is_refused(drive: Drive, expected: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=expected):
        read_log(write_ros2(drive.messages(), tmp_path / "a"))


def test_a_laser_that_turns_on_the_robot_is_refused(tmp_path: Path) -> None:
    drive = Drive(static="", odometry="transforms")
    sent = list(drive.messages())
    (some,) = [each for each in sent if each.topic == "/tf"][:1]
    for number in range(20):
        fields = drive._transform(
            BEGIN + number / 10, "base_link", "laser", (0.0, 0.0, 0.0), pose_rotation(number)
        )
        sent.append(some._replace(received=BEGIN + number / 10, fields=fields))
    with pytest.raises(InputError, match="a laser that is fixed to base_link, found laser, which"):
        read_log(write_ros2(sent, tmp_path / "a"))


def test_other_clocks_are_told(tmp_path: Path) -> None:
    sent = list(Drive().messages())
    for each in sent:
        if each.topic == "/scan":
            each.fields["header"]["stamp"] -= 1000.0
    with pytest.raises(InputError, match=r"scans during the odometry, found scans from 1699999000"):
        read_log(write_ros2(sent, tmp_path / "a"))


def test_a_missing_library_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_ros2(Drive().messages(), tmp_path / "a")
    monkeypatch.setattr("albot_core.ros.messages.find_spec", lambda _: None)
    with pytest.raises(InputError, match=re.escape("pip install 'albot-env[ros]'")):
        read_log(path)
    with pytest.raises(InputError, match=re.escape("pip install 'albot-env[ros]'")):
        write_ros2_bag(read_log(EXAMPLE), tmp_path / "b")
    assert not (tmp_path / "b").exists()


# There and back.


def test_the_farthest_hits_read_back_where_the_laser_tells_no_maximum(tmp_path: Path) -> None:
    drive = Drive(edit=lambda _, scan: scan | {"range_max": math.inf})
    log = read_log(write_ros2(drive.messages(), tmp_path / "a"))
    write_ros2_bag(log, tmp_path / "b")
    found = read_log(tmp_path / "b").ranges
    assert log.ranges is not None
    np.testing.assert_array_equal(found, log.ranges.astype(np.float32))


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_what_is_written_reads_back(storage: Any, tmp_path: Path) -> None:
    log = read_log(EXAMPLE)
    write_ros2_bag(log, tmp_path / "drive", storage=storage)
    found = read_log(tmp_path / "drive")
    assert log.ranges is not None
    np.testing.assert_array_equal(found.stamps, log.stamps)
    np.testing.assert_allclose(found.odometry, log.odometry, atol=1e-12)
    np.testing.assert_allclose(found.reference, log.reference, atol=1e-12)
    np.testing.assert_array_equal(found.ranges, log.ranges.astype(np.float32))
    assert log.geometry is not None
    assert found.geometry is not None
    assert found.notes == ()
    exact = replace(
        found.geometry, first_bearing=log.geometry.first_bearing, spacing=log.geometry.spacing
    )
    assert exact == log.geometry
    np.testing.assert_allclose(found.geometry.bearings, log.geometry.bearings, atol=1e-6)


def test_the_map_of_what_reads_back_is_the_same(tmp_path: Path) -> None:
    log = read_log(EXAMPLE).with_scans(np.arange(60))
    write_ros2_bag(log, tmp_path / "drive")
    maps = []
    for each in (log, read_log(tmp_path / "drive")):
        mapper = make_mapper("albot1")
        for reading in each.readings:
            mapper.update(reading)
        maps.append((mapper.estimate.pose, mapper.snapshot().segments))
    (pose, surfaces), (found_pose, found) = maps
    np.testing.assert_allclose(found_pose, pose, atol=1e-4)
    assert len(found) == len(surfaces)
    np.testing.assert_allclose(found, surfaces, atol=1e-3)
