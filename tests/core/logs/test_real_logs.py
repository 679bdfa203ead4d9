"""The real logs, held against what is known of them."""

from __future__ import annotations

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
    assert (np.diff(log.stamps) >= 0).all()
    finite = log.ranges[np.isfinite(log.ranges)]
    assert finite.size > 0.5 * log.ranges.size
    assert 0 < finite.min() <= finite.max() < log.geometry.max_range


def test_the_odometry_recovered_on_intel_is_the_raw_logs(read):
    raw = read("intel_raw.json.gz")
    recovered = read("intel-corrected.log.gz")
    np.testing.assert_array_equal(recovered.ranges, raw.ranges)
    np.testing.assert_allclose(
        recovered.stamps - raw.stamps, recovered.stamps[0] - raw.stamps[0], atol=0.01
    )
    motions = [np.array([reading.motion for reading in log.readings]) for log in (raw, recovered)]
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


def test_no_return_on_duke_is_told_from_far_walls(read):
    log = read("duke_loop5.log.xz")
    none = np.isinf(log.ranges).sum()
    # 6472 readings of 8.183 m and 258 of 8.187 m and more, but few between 8.1 and 8.18 m.
    assert none == pytest.approx(6730, abs=10)
    assert (log.ranges[np.isfinite(log.ranges)] > 8.1).sum() < 200
