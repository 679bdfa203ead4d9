"""Runs of mappers on logs, and what their figures of speed count."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from albot_cli import mapping_run
from albot_cli.mapper_runs import MapperChoice, MapperRun, Source, measure_run
from albot_core.evaluation.trajectory import Trajectory
from albot_core.logs.reader import read_log
from albot_core.mappers.registry import make_mapper


def test_the_time_to_load_a_mappers_code_does_not_count(
    corridor: tuple[Path, Trajectory], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first reading that the process ever takes in needs long, as code is loaded then."""
    kind, now, taken = type(make_mapper("odometry")), [0.0], []
    update = kind.update

    def updated(mapper, reading):
        now[0] += 0.004 if taken else 100.0
        taken.append(reading.stamp)
        return update(mapper, reading)

    monkeypatch.setattr(kind, "update", updated)
    monkeypatch.setattr(mapping_run, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    log = read_log(corridor[0])
    run = MapperRun(choice=MapperChoice(label="a", name="odometry"), source=Source(log=log, seed=0))
    figures = measure_run(run).figures
    assert figures["slowest_reading_ms"] == pytest.approx(4.0)
    assert figures["readings_per_second"] == pytest.approx(250.0)
    # What takes so long that it is loaded is not begun with another reading.
    stamps = [reading.stamp for reading in log.readings]
    assert taken == [stamps[0], *stamps]
