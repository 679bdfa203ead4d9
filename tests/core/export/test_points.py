"""Points of scans as PLY and CSV, read back by numpy from what the formats say."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.export.points import PointCloud, laser_points, write_ply, write_points_csv
from albot_core.logs.log import Log
from albot_core.sensing.reading import LaserGeometry

GEOMETRY = LaserGeometry(
    beams=3, first_bearing=-np.pi / 2, spacing=np.pi / 2, max_range=10.0, mount=(0.1, 0.0, 0.0)
)


def _log() -> Log:
    ranges = np.array(((1.0, 2.0, np.inf), (10.0, 3.0, 4.0)))
    return Log(
        name="two.log",
        geometry=GEOMETRY,
        stamps=np.array((0.5, 1 / 3)),
        ranges=ranges,
        odometry=np.zeros((2, 3)),
    )


def _read_ply(path: Path) -> np.ndarray:
    head, _, body = path.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in head.decode().splitlines()]
    assert words[:2] == [["ply"], ["format", "binary_little_endian", "1.0"]]
    (count,) = (int(line[2]) for line in words if line[:2] == ["element", "vertex"])
    names = [line[2] for line in words if line[:2] == ["property", "double"]]
    return np.frombuffer(body, [(name, "<f8") for name in names], count)


def test_hits_lie_where_pose_mount_and_beam_say():
    poses = np.array(((0, 0, 0), (5, 1, np.pi / 2)), float)
    cloud = laser_points(_log(), poses)
    # The second robot faces up: ahead is +y, its left is -x. A range of 10 is no return.
    expected = ((0.1, -1), (2.1, 0), (5, 1 + 3.1), (5 - 4, 1.1))
    np.testing.assert_allclose(cloud.points, expected, atol=1e-12)
    assert cloud.stamps is not None
    assert cloud.stamps.tolist() == [0.5, 0.5, 1 / 3, 1 / 3]


def test_both_formats_read_back_exactly(tmp_path):
    cloud = laser_points(_log(), np.array(((1 / 3, 2, 0.1), (0, 0, 2))))
    write_ply(cloud, tmp_path / "a.ply")
    found = _read_ply(tmp_path / "a.ply")
    assert np.array_equal(np.stack((found["x"], found["y"]), axis=-1), cloud.points)
    assert np.array_equal(found["time"], cloud.stamps)
    assert not found["z"].any()
    write_points_csv(cloud, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(float(row["x"]), float(row["y"])) for row in rows] == [*map(tuple, cloud.points)]
    assert [float(row["time"]) for row in rows] == [*cloud.stamps]


def test_points_without_time_and_no_points(tmp_path):
    write_ply(PointCloud(points=np.ones((2, 2))), tmp_path / "a.ply")
    assert _read_ply(tmp_path / "a.ply").dtype.names == ("x", "y", "z")
    write_points_csv(PointCloud(points=np.empty((0, 2))), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text() == "x,y\n"


def test_a_log_without_a_laser_has_no_points():
    blind = Log(
        name="a.log", geometry=None, stamps=np.zeros(1), ranges=None, odometry=np.eye(3)[:1]
    )
    with pytest.raises(InputError, match=r"a\.log: expected a laser"):
        laser_points(blind, blind.odometry)
