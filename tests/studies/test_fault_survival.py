"""The program that counts the mappers that survive faults."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from albot_core.errors import InputError
from albot_env.faults.registry import FAULTS
from albot_studies import fault_survival
from albot_studies.fault_survival import (
    GOES_ON,
    MAPPERS,
    NOTHING,
    RECOVERS,
    Survival,
    command,
    figures,
    measure_all,
    page,
    promise,
    table,
)


def _survival(**changed: object) -> Survival:
    usual = {
        "fault": "kidnap", "mapper": "albot1", "seed": 1, "struck": True, "error_before": 0.1,
        "error": 0.2, "right_again": 3.0, "said_lost": True, "lost": False, "false_home": False,
    }  # fmt: skip
    return Survival(**(usual | changed))  # type: ignore[arg-type]


def test_each_fault_has_a_promise_for_each_mapper() -> None:
    promises = {fault: [promise(fault, mapper) for mapper in MAPPERS] for fault in FAULTS}
    assert promises["laser-dropout"] == [GOES_ON] * len(MAPPERS)
    assert promises["kidnap"][0] == RECOVERS and promises["kidnap"][1] == NOTHING
    assert promises["odometer-jump"][MAPPERS.index("odometry")] == NOTHING


@pytest.mark.parametrize(
    ("changed", "kept"),
    [
        ({}, (True, True)),
        ({"right_again": 10.5}, (False, True)),
        ({"right_again": 30.5}, (False, False)),
        ({"right_again": None, "error": 9.0}, (False, False)),
        ({"right_again": None, "error": 9.0, "lost": True}, (False, True)),
        ({"false_home": True}, (False, False)),
    ],
)
def test_a_promise_is_kept_or_not(changed: dict[str, object], kept: tuple[bool, bool]) -> None:
    found = _survival(**changed)
    assert (found.keeps(GOES_ON), found.keeps(RECOVERS)) == kept
    assert found.mistaken == ("error" in changed and "lost" not in changed)


def test_the_table_counts_what_was_kept_and_leaves_out_what_could_not_strike() -> None:
    runs = [_survival(), _survival(seed=2, right_again=None, error=5.0), _survival(struck=False)]
    measured = figures(runs, range(1, 4))
    (row,) = measured["rows"]
    assert (row["runs"], row["kept"], row["mistaken_after_lost"]) == (2, 1, 1)
    assert "**1 of 2** (9% to 91%), lost 2" in table(measured)
    text = page(measured, "albot experiment study fault-survival")
    assert "- `kidnap`: `albot1` is right again within 30 m, or says that it is lost." in text


def test_faults_strike_in_short_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(fault_survival, "BEFORE", 1.0)
    monkeypatch.setattr(fault_survival, "AFTER", 1.5)
    options = ["--fault", "kidnap", "--fault", "laser-dropout", "--mapper", "odometry"]
    options += ["--worlds", "random:office:SEED?rooms=4", "--seeds", "1..2", "--out", str(tmp_path)]
    result = CliRunner().invoke(command, options, catch_exceptions=False)
    assert result.exit_code == 0
    measured = json.loads((tmp_path / "fault_survival.json").read_text())
    runs = {(run["fault"], run["seed"]): run for run in measured["runs"]}
    assert len(runs) == 4 and all(run["struck"] for run in runs.values())
    assert all(run["error_before"] < 0.5 for run in runs.values())
    assert all(runs["kidnap", seed]["error"] > 2.0 for seed in (1, 2))
    assert all(runs["laser-dropout", seed]["error"] < 0.5 for seed in (1, 2))
    assert "| `kidnap` | (right at the end 0 of 2) |" in result.output


def test_an_unknown_fault_or_mapper_is_refused() -> None:
    with pytest.raises(InputError, match="--fault: expected one of"):
        measure_all(("earthquake",), ("odometry",), range(1))
    with pytest.raises(InputError, match="albot2"):
        measure_all(("kidnap",), ("albot2",), range(1))
