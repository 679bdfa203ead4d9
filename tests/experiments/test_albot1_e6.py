"""Experiment 6: the logs are held against what is known, and asked for where they are not there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_cli.group import albot
from albot_core.errors import InputError
from albot_core.logs.log import with_noise
from albot_experiments import albot1_e6 as e6
from albot_experiments.mapping import surface_points
from albot_experiments.real_logs import LOGS, KnownLog, read_real_log

FREIBURG = LOGS[2]


@pytest.mark.parametrize("name", ["albot1-e6", "all"])
def test_without_data_it_says_what_it_needs(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.delenv("ALBOT_DATA", raising=False)
    with pytest.raises(InputError, match=r"^ALBOT_DATA: expected the folder .* found not set$"):
        albot.main(["experiment", "run", name], standalone_mode=False)


def test_a_folder_without_logs_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ALBOT_DATA", str(tmp_path))
    with pytest.raises(InputError, match="a folder that holds logs/"):
        e6.run(range(1))


@pytest.fixture(scope="module")
def known(data: Path) -> KnownLog:
    return read_real_log(FREIBURG)


def test_freiburg_keeps_a_reasonable_shape_and_its_odometer_none(known: KnownLog) -> None:
    noisy = [with_noise(known.log, np.random.default_rng(1))]
    ours, odometer = (e6.map_log(name, FREIBURG, known, noisy) for name in ("albot1", "odometry"))
    assert ours.reasonable
    assert max(ours.path_errors) < 0.5 and len(ours.path_errors) == 2
    assert ours.walls[0].precision > 0.7
    assert not odometer.reasonable
    assert odometer.walls[0].precision < 0.3 < odometer.walls[0].doubled


def test_walls_beside_themselves_are_doubled() -> None:
    wall = np.array([[0.0, 0.0, 10.0, 0.0]])
    reference = e6.thinned(surface_points(wall))
    beside = np.concatenate((wall, wall + np.array([0.0, 1.0, 0.0, 1.0])))
    errors = e6.wall_errors(beside, np.zeros(3), reference)
    assert (errors.precision, errors.recall, errors.doubled) == (0.5, 1.0, 0.5)
    # Alone it is only wrong; and so far away it is another wall.
    for walls in (beside[1:], wall + np.array([0.0, 5.0, 0.0, 5.0])):
        assert e6.wall_errors(walls, np.zeros(3), reference).doubled == 0.0


def test_noise_is_small_and_its_own_each_time(known: KnownLog) -> None:
    log = known.log
    first, second = (with_noise(log, np.random.default_rng(seed)) for seed in (1, 2))
    finite = np.isfinite(log.ranges)
    off = first.ranges[finite] - log.ranges[finite]
    assert off.std() == pytest.approx(0.005, rel=0.05)
    assert not np.array_equal(first.odometry, second.odometry)
    assert np.array_equal(first.ranges == np.inf, log.ranges == np.inf)
