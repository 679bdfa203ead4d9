"""The adapter for OpenKarto, with a program in its place that stays where the odometer says."""

from __future__ import annotations

import logging
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.mappers.slam.karto import Karto, KartoConfig
from albot_core.sensing.reading import LaserGeometry
from tests.core.mappers.slam.rooms import ROOM, reading_from


class Program:
    """What the adapter uses of yag-slam's `GraphSlam`."""

    def __init__(self) -> None:
        self.graph, self.scans = SimpleNamespace(vertices=[]), []

    def process_scan(self, scan: SimpleNamespace) -> None:
        print("WARN: the loop is doubtful")
        self.scans.append(scan)
        self.graph.vertices.append(SimpleNamespace(obj=SimpleNamespace(corrected_pose=scan.pose)))


@pytest.fixture
def karto(monkeypatch) -> Karto:
    def scan(ranges, first, last, spacing, least, most, threshold, x, y, heading):
        pose = SimpleNamespace(x=x, y=y, euler=(0.0, 0.0, heading))
        return SimpleNamespace(ranges=ranges, first=first, last=last, pose=pose)

    monkeypatch.setitem(sys.modules, "yag_slam.models", SimpleNamespace(LocalizedRangeScan=scan))
    monkeypatch.setattr(Karto, "_fresh", lambda self: Program())
    return Karto()


def test_what_the_program_prints_is_logged(karto, capsys, caplog):
    with caplog.at_level(logging.INFO):
        karto.update(reading_from(np.zeros(3), np.zeros(3)))
    assert capsys.readouterr().out == ""
    assert "karto: WARN: the loop is doubtful" in caplog.text


def test_the_laser_s_poses_go_in_and_the_robot_s_come_out(karto):
    laser = LaserGeometry(beams=90, mount=(0.2, 0.0, 0.0))
    pose, motion = np.zeros(3), np.array((0.5, 0.1, 0.3))
    for k in range(4):
        karto.update(reading_from(pose, motion if k else np.zeros(3), ROOM, laser))
        pose = compose(pose, motion)
    expected = [np.zeros(3)]
    for _ in range(3):
        expected.append(compose(expected[-1], motion))
    np.testing.assert_allclose(karto.corrected_poses(), expected, atol=1e-12)
    x, y, _ = compose(expected[-1], np.array((0.2, 0.0, 0.0)))
    last = karto._karto.scans[-1].pose
    assert (last.x, last.y) == pytest.approx((x, y))
    restored = Karto()
    restored.restore(karto.state())
    np.testing.assert_array_equal(restored.corrected_poses(), karto.corrected_poses())


def test_scans_are_handed_over_once_the_robot_has_moved_enough(karto):
    own = KartoConfig(minimum_travel_distance=0.2, minimum_travel_heading=0.17)
    karto = Karto(own)
    step = np.array((0.09, 0.0, 0.0))
    for k in range(8):
        assert karto.update(reading_from(k * step, step if k else np.zeros(3))) == (k in (0, 3, 6))
    np.testing.assert_allclose(karto.corrected_poses(), np.arange(8)[:, None] * step, atol=1e-12)
    np.testing.assert_allclose(karto.estimate.pose, 7 * step, atol=1e-12)
    assert karto.estimate.updates == 3
    restored = Karto(own)
    restored.restore(karto.state())
    np.testing.assert_array_equal(restored.corrected_poses(), karto.corrected_poses())
    turned = np.array((0.0, 0.0, 0.2))
    assert restored.update(reading_from(8 * step, turned))
    with pytest.raises(InputError, match="numbers that grow from 0 to 2"):
        restored.restore(karto.state() | {"readings.followed": np.zeros(8, np.int64)})


def test_no_return_goes_in_as_a_range_of_nothing(karto):
    laser = LaserGeometry(beams=90, max_range=5.0)
    karto.update(reading_from(np.zeros(3), np.zeros(3), ROOM, laser))
    ranges = np.array(karto._karto.scans[0].ranges)
    assert ((ranges == 0) | (ranges < 5.0)).all()
    assert (ranges == 0).sum() > 5
