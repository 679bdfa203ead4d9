"""The program that maps disturbed logs, and its page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner

from albot_studies.disturbed_logs import command, table


def test_errors_are_told_by_those_of_the_undisturbed_log() -> None:
    noise = {"disturbance": "noise", "ate_m": [0.1, 0.2, 0.3], "odometer_ate_m": [2.0, 2.0, 2.0]}
    turns = {"disturbance": "turns", "ate_m": [0.5, 0.5, 9.0], "odometer_ate_m": [4.0, 5.0, 6.0]}
    beams = {"disturbance": "beams", "ate_m": [0.1, 0.1, 0.1], "odometer_ate_m": [2.0, 2.0, 2.0]}
    frozen = {"disturbance": "frozen", "ate_m": [9.0] * 3, "odometer_ate_m": [9.0] * 3}
    found = {"rows": [noise, turns, beams, frozen]}
    rows = table({"logs": {"duke": found}}).splitlines()[2:]
    assert rows == [
        "| duke | noise | 0.20 m | 0.10-0.30 m | 1.00 | 2.00 m | 0 of 3 |",
        # Among its resamples are those of only 0.5 m or 9 m, by 0.3 m or 0.1 m.
        "| duke | turns | 0.50 m | 0.50-9.00 m | 2.50 (1.67-90.00) | 5.00 m | 1 of 3 |",
        "| duke | beams | 0.10 m | 0.10-0.10 m | 0.50 (0.33-1.00) | 2.00 m | 0 of 3 |",
        "| duke | frozen | 9.00 m | 9.00-9.00 m | 45.00 (30.00-90.00) | 9.00 m | 0 of 3 |",
        # Turns and beams together, without the frozen odometer. Half of six drawn may be 9 m.
        "| duke | pooled | 0.30 m | 0.10-9.00 m | 1.50 (0.33-23.75) | 3.00 m | 1 of 6 |",
    ]


def test_a_log_is_mapped_under_every_disturbance(data: Path, tmp_path: Path) -> None:
    options = "--log", "freiburg", "--mapper", "odometry", "--runs", "2", "--out", str(tmp_path)
    printed = CliRunner().invoke(command, [str(data / "logs"), *options], catch_exceptions=False)
    measured = json.loads((tmp_path / "robustness.json").read_text())
    rows = measured["logs"]["freiburg"]["rows"]
    assert [row["disturbance"] for row in rows][:3] == ["noise", "turns", "lengths"]
    # The mapper is the odometer.
    for row in rows:
        np.testing.assert_allclose(row["ate_m"], row["odometer_ate_m"], rtol=1e-9)
    written = (tmp_path / "robustness.md").read_text()
    assert table(measured) in written
    assert "No worse than its own odometer: 20 of 20 runs" in written
    assert table(measured) in printed.output


def test_no_runs_are_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tmp_path), "--runs", "0"])
    assert result.exit_code == 2
    assert "--runs" in result.output
