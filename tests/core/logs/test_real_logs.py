"""The real logs, held against what is known of them."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from albot_core.evaluation.trajectory import read_relations, relation_error, trajectory_error
from albot_core.geometry.poses import relative
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log


@pytest.fixture(scope="module")
def read(data: Path) -> Callable[[str], Log]:
    """Reads a log of a name, each but once."""
    return cache(lambda name: read_log(data / "logs" / name))


@pytest.mark.parametrize(
    ("name", "scans", "beams", "path", "mount"),
    [
        ("intel_raw.json.gz", 910, 180, 501.1, 0.0),
        ("intel-corrected.log.gz", 910, 180, 501.1, 0.0),
        ("aces-corrected.log.gz", 440, 180, 322.1, 0.0),
        ("freiburg-101-corrected.log.gz", 292, 360, 209.0, 0.0),
        ("wean_robotdata1.log.xz", 713, 180, 41.2, 0.25),
        ("wean_robotdata2.log.xz", 2251, 180, 87.2, 0.25),
        ("duke_loop5.log.xz", 551, 181, 56.1, 0.4),
    ],
)
def test_the_size_of_every_log(name, scans, beams, path, mount, read):
    log = read(name)
    assert len(log.readings) == scans
    assert log.ranges.shape == (scans, beams)
    assert log.path_length == pytest.approx(path, abs=0.1)
    assert log.geometry.mount == (mount, 0, 0)
    assert (log.reference is not None) == ("corrected" in name)
    assert (np.diff(log.times) >= 0).all()
    assert bool(log.notes) == (name == "intel-corrected.log.gz")
    finite = log.ranges[np.isfinite(log.ranges)]
    assert finite.size > 0.5 * log.ranges.size
    assert 0 < finite.min() <= finite.max() < log.geometry.max_range


def test_the_odometry_recovered_on_intel_is_the_raw_logs(read):
    raw = read("intel_raw.json.gz")
    recovered = read("intel-corrected.log.gz")
    # Four scans bear later stamps than the next ones, by which the raw log is sorted.
    order = np.argsort(recovered.stamps)
    assert (order != np.arange(910)).sum() == 8
    np.testing.assert_array_equal(recovered.ranges[order], raw.ranges)
    stamps = recovered.stamps[order]
    np.testing.assert_allclose(stamps - raw.stamps, stamps[0] - raw.stamps[0], atol=0.01)
    motions = [
        relative(poses[:-1], poses[1:]) for poses in (raw.odometry, recovered.odometry[order])
    ]
    differences = np.abs(relative(*motions))
    assert differences[:, :2].max() < 0.001
    assert differences[:, 2].max() < 0.001


def test_the_corrected_poses_on_intel_are_near_the_reference(read):
    reference = read("intel_reference.json.gz").odometry_trajectory
    corrected = read("intel-corrected.log.gz").reference_trajectory
    assert corrected is not None
    shift = corrected.stamps[0] - reference.stamps[0]
    moved = type(reference)(stamps=reference.stamps + shift, poses=reference.poses)
    error = trajectory_error(moved, corrected)
    assert error is not None
    assert error.count == 910
    assert error.rmse < 0.5


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("intel-corrected.log.gz", 24.0),
        ("aces-corrected.log.gz", 5.4),
        ("freiburg-101-corrected.log.gz", 8.6),
    ],
)
def test_the_error_of_raw_odometry(name, error, read):
    log = read(name)
    assert log.reference_trajectory is not None
    measured = trajectory_error(log.odometry_trajectory, log.reference_trajectory)
    assert measured is not None
    assert measured.rmse == pytest.approx(error, abs=0.1)


@pytest.mark.parametrize(
    ("name", "metres", "degrees"),
    [("intel_raw.json.gz", 3.3, 17.2), ("intel_reference.json.gz", 0.036, 0.42)],
)
def test_the_relations_on_intel(name, metres, degrees, data, read):
    relations = read_relations(data / "logs" / "intel.relations")
    assert len(relations.poses) == 2984
    trajectory = read(name).odometry_trajectory
    error = relation_error(trajectory, relations)
    assert error is not None
    assert error.count == 90
    assert error.translation_mean == pytest.approx(metres, rel=0.02)
    assert np.rad2deg(error.rotation_mean) == pytest.approx(degrees, rel=0.02)
    assert relation_error(trajectory, relations, tolerance=0.01).count == 148


def _in_six_digits(text: str, epoch: float) -> str:
    """A corrected log with the stamps of a program that prints `%g`."""
    lines = []
    for line in text.splitlines():
        words = line.split()
        if words and words[0] in ("ODOM", "FLASER") and words[-3] != "0":
            words[-3] = f"{epoch + float(words[-3]):g}"
        lines.append(" ".join(words))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("epoch", [1134860000.0, 113486000.0, 1134860.0])
def test_six_digits_change_no_figure(epoch, data, read, tmp_path):
    whole = read("aces-corrected.log.gz")
    text = gzip.decompress((data / "logs" / "aces-corrected.log.gz").read_bytes()).decode()
    path = tmp_path / "six.log"
    path.write_text(_in_six_digits(text, epoch))
    log = read_log(path)
    assert "440 scans share" in log.notes[0]
    np.testing.assert_array_equal(log.ranges, whole.ranges)
    np.testing.assert_allclose(log.odometry, whole.odometry, atol=1e-9)
    assert log.reference_trajectory is not None
    error = trajectory_error(log.odometry_trajectory, log.reference_trajectory)
    assert error is not None
    assert (error.count, error.rmse) == (440, pytest.approx(5.42, abs=0.01))


@pytest.mark.parametrize("which", ["before", "after"])
@pytest.mark.parametrize("name", ["aces", "freiburg-101", "intel"])
def test_odom_lines_lost_at_random_lose_no_more_than_their_steps(name, which, data, read, tmp_path):
    rng = np.random.default_rng(5)
    packed = data / "logs" / f"{name}-corrected.log.gz"
    lines = [*gzip.decompress(packed.read_bytes()).decode().splitlines(), ""]
    beside = 1 if which == "before" else -1
    kept = [
        line
        for number, line in enumerate(lines)
        if not (
            line.startswith("ODOM")
            and lines[number + beside].startswith("FLASER")
            and rng.random() < 0.3
        )
    ]
    path = tmp_path / "lost.log"
    path.write_text("\n".join(kept) + "\n")
    whole, log = read(packed.name), read_log(path)
    np.testing.assert_array_equal(log.reference, whole.reference)
    motions = [relative(each.odometry[:-1], each.odometry[1:]) for each in (whole, log)]
    errors = np.abs(relative(*motions))
    if which == "after":
        assert errors.max() < 1e-9
        return
    assert "motions of the odometer are continued" in log.notes[0]
    assert (errors.max(axis=1) < 1e-9).mean() == pytest.approx(0.7, abs=0.15)
    assert errors[:, :2].mean() < 0.01
    assert np.rad2deg(errors[:, 2].mean()) < 1.0


def test_no_return_on_duke_is_told_from_far_walls(read):
    log = read("duke_loop5.log.xz")
    none = np.isinf(log.ranges).sum()
    # 6472 readings of 8.183 m and 258 of 8.187 m and more, but few between 8.1 and 8.18 m.
    assert none == pytest.approx(6730, abs=10)
    assert (log.ranges[np.isfinite(log.ranges)] > 8.1).sum() < 200
