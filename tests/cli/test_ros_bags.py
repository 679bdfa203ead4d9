"""`albot map` and `albot compare` on ROS bags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.export.ros2_bag import write_ros2_bag
from albot_core.logs.reader import read_log
from tests.cli.conftest import expect_error, figures
from tests.core.ros.drives import Drive, write_ros1, write_ros2

DRIVE = Drive(place=(0.2, 0.1), turned=(0.3, 0.0, np.pi), scans=9)


def test_a_bag_of_ros_1_is_mapped(call, tmp_path):
    path = write_ros1(DRIVE.messages(), tmp_path / "drive.bag", "lz4")
    found = figures(call("map", path, "--mapper", "odometry", "--out", tmp_path / "out", "--json"))
    assert found["scans"] == 9
    assert found["notes"] == []
    assert (tmp_path / "out" / "trajectory.tum").exists()


def test_the_topics_can_be_chosen(call, tmp_path):
    sent = list(DRIVE.messages())
    sent += [each._replace(topic="/rear") for each in sent if each.topic == "/scan"]
    path = write_ros2(sent, tmp_path / "drive")
    words = ("map", path, "--mapper", "odometry", "--json")
    expect_error(call(*words), "or --scan TOPIC to say which, found /rear, /scan")
    assert figures(call(*words, "--scan", "/rear", "--odom", "/odom"))["scans"] == 9
    expect_error(call(*words, "--scan", "/rea"), "found /rea (did you mean /rear?)")


def test_the_scores_of_a_log_and_of_its_bag_are_the_same(call, corridor, tmp_path):
    log = read_log(corridor[0])
    write_ros2_bag(log, tmp_path / "drive")
    ours, theirs = (
        figures(call("map", path, "--mapper", "odometry", "--json"))
        for path in (corridor[0], tmp_path / "drive")
    )
    assert ours["scans"] == theirs["scans"]
    assert theirs["map_entropy"] == pytest.approx(ours["map_entropy"], abs=1e-3)


def test_mappers_are_compared_on_a_bare_file(call, tmp_path):
    bag = write_ros2(DRIVE.messages(), tmp_path / "drive")
    words = ("compare", bag / "drive.mcap", "--mappers", "odometry", "--jobs", "1", "--json")
    (row,) = figures(call(*words))["rows"]
    assert [run["error"] for run in row["runs"]] == [None]
    expect_error(call(*words[:1], "square-loop", *words[2:], "--scan", "/scan"), "found a world")


def test_topics_of_an_episode_and_of_other_logs_are_refused(call, episode_file, corridor):
    for path, kind in ((episode_file, "a recorded episode"), (corridor[0], "a robot's log")):
        expect_error(call("map", path, "--scan", "/scan"), "expected a ROS bag", kind)


def test_a_torn_bag_and_a_folder_that_is_none_are_one_line(call, tmp_path):
    path = write_ros1(DRIVE.messages(), tmp_path / "drive.bag")
    path.write_bytes(path.read_bytes()[:-500])
    expect_error(call("map", path), "drive.bag: expected an intact ROS bag")
    Path(tmp_path / "empty").mkdir()
    expect_error(call("map", tmp_path / "empty"), "metadata.yaml")
