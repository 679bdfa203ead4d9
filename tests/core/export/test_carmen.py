"""CARMEN logs are read back as they were written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.export.carmen import write_carmen
from albot_core.logs.example import EXAMPLE
from albot_core.logs.log import Log, sick_laser
from albot_core.logs.reader import read_log


def made(beams: int, scans: int = 12) -> Log:
    """A log of a robot whose odometer drifts, with beams that return nothing."""
    rng = np.random.default_rng(beams)
    ranges = np.round(rng.uniform(0.3, 20.0, (scans, beams)), 2)
    ranges[rng.random(ranges.shape) < 0.1] = np.inf
    truth = np.cumsum(rng.uniform(0.0, 0.4, (scans, 3)), axis=0)
    return Log(
        name="made",
        geometry=sick_laser(beams),
        stamps=np.arange(scans) * 0.5,
        ranges=ranges,
        odometry=truth + np.linspace(0.0, 0.5, scans)[:, None],
        reference=truth,
    )


@pytest.mark.parametrize("beams", [180, 181, 360, 361])
@pytest.mark.parametrize("name", ["a.log", "a.log.gz"])
def test_a_log_reads_back(beams: int, name: str, tmp_path: Path) -> None:
    log = made(beams)
    write_carmen(log, tmp_path / name)
    found = read_log(tmp_path / name)
    assert found.geometry == log.geometry
    np.testing.assert_array_equal(found.ranges, log.ranges)
    np.testing.assert_array_equal(found.stamps, log.stamps)
    np.testing.assert_allclose(found.odometry, log.odometry, atol=6e-5)
    assert found.reference is not None
    np.testing.assert_allclose(found.reference, log.reference, atol=6e-5)
    write_carmen(replace(log, reference=None), tmp_path / name)
    assert read_log(tmp_path / name).reference is None
    before = (tmp_path / name).read_bytes()
    write_carmen(replace(log, reference=None), tmp_path / name)
    assert (tmp_path / name).read_bytes() == before


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"geometry": None, "ranges": None}, "made: expected a laser, found none"),
        ({"geometry": replace(sick_laser(181), mount=(0.1, 0.0, 0.0))}, r"at \(0\.1, 0\.0, 0\.0\)"),
        ({"geometry": replace(sick_laser(181), spacing=0.01)}, "181 beams, 0.57"),
    ],
)
def test_what_the_format_cannot_hold_is_refused(
    changes: dict[str, object], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=expected):
        write_carmen(replace(made(181), **changes), tmp_path / "a.log")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_the_example_is_a_drive_with_a_poor_odometer() -> None:
    log = read_log(EXAMPLE)
    assert log.reference is not None
    assert log.path_length > 100
    assert EXAMPLE.stat().st_size < 150_000
    assert np.hypot(*(log.odometry[-1] - log.reference[-1])[:2]) > 1.0
