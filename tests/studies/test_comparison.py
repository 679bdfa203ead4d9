"""The comparison of mappers runs each only where its sensors are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from albot_core.mappers.registry import mapper_spec
from albot_studies import comparison


@pytest.mark.parametrize(
    ("sensors", "run"),
    [
        ({"laser"}, ["odometry", "sahabot-wheels"]),
        ({"laser", "compass"}, ["odometry", "sahabot", "sahabot-wheels"]),
        ({"sonar"}, []),
    ],
)
def test_a_mapper_without_its_sensors_is_left_out(
    sensors: set[str], run: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def compare(choices: Sequence[Any], *_: object) -> Iterator[Any]:
        asked.extend(choice.name for choice in choices)
        yield from ()

    monkeypatch.setattr(comparison, "compare_mappers", compare)
    monkeypatch.setattr(comparison, "rows_of", lambda *_: [])
    log = SimpleNamespace(sensors=frozenset(sensors), readings=(), path_length=0.0)
    source: Any = SimpleNamespace(log=log)
    comparison._measure(tmp_path / "x", [source], ["odometry", "sahabot", "sahabot-wheels"], 1)
    assert asked == run
    assert (tmp_path / "x" / comparison.FIGURES).exists() == bool(run)


def test_all_mappers_of_the_comparison_are_registered() -> None:
    assert all("laser" in mapper_spec(name).sensors for name in comparison.MAPPERS)
