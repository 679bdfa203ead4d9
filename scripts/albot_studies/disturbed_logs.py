"""Errors of a mapper on disturbed logs, over many runs, as a table.

Maps every log of the data folder as recorded, and then, in each of `--runs` runs, with each of the
disturbances of `albot_core.logs.disturbed`. An error is the ATE against the log's reference; for a
log without a reference, the path that `graph-slam` corrects on the log as recorded is used instead.
The files `robustness.json` and `robustness.md` are written to `--out`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_cli.mapping_run import run_mapper
from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.errors import InputError
from albot_core.evaluation.intervals import bootstrap_ratio
from albot_core.evaluation.trajectory import Trajectory, trajectory_error
from albot_core.files import make_folder, write_text
from albot_core.logs.disturbed import DISTURBANCES, disturbed
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log, read_reference
from albot_core.sensing.faults.registry import READING_FAULTS, parse_faults

LOGS = {
    "intel": ("intel_raw.json.gz", "intel_reference.json.gz"),
    "wean1": ("wean_robotdata1.log.xz", None),
    "wean2": ("wean_robotdata2.log.xz", None),
    "aces": ("aces-corrected.log.gz", None),
    "freiburg": ("freiburg-101-corrected.log.gz", None),
    "duke": ("duke_loop5.log.xz", None),
}
"""The logs of the data folder, and the files of their references."""
DEVELOPED_ON = ("intel", "wean1", "wean2")
"""The logs on which the mappers' parameters were chosen; the others are test logs."""
POOLED = ("turns", "lengths", "beams", "views", "range")
"""The disturbances whose runs also count as one sample; `all` applies them together."""
SAME = 1e-3
"""Errors that differ by at most this (m) are the same."""


def known_log(folder: Path, name: str) -> tuple[Log, Trajectory]:
    """Return a log of the data folder, and the robot's true path."""
    file, reference = LOGS[name]
    log = read_log(folder / file)
    truth = read_reference(folder / reference) if reference else log.reference_trajectory
    if truth is None:
        run = run_mapper("graph-slam", None, log, lambda _: None)
        truth = run.corrected
    if truth is None:
        raise InputError(folder / file, "a reference, or a path that is corrected", "none")
    return log, truth


def ate(trajectory: Trajectory, truth: Trajectory, log: Log) -> float:
    """Return the ATE of a trajectory (m)."""
    error = trajectory_error(trajectory, truth)
    if error is None:
        raise InputError(log.name, "a reference with moments of the log", "stamps of another log")
    return error.rmse


def measure(
    log: Log, truth: Trajectory, mapper: str, runs: int, faults: tuple[str, ...] = ()
) -> list[dict[str, Any]]:
    """Return one row per disturbance: the errors of mapper and odometer over `runs` runs (m).

    With `faults`, specs of faults of readings, these strike instead; `noise` is always the first.
    """
    rows: list[dict[str, Any]] = []
    for disturbance in ("noise", *faults) if faults else DISTURBANCES:
        errors, odometers = [], []
        for seed in range(runs):
            worse = disturbed(log, disturbance, seed)
            run = run_mapper(mapper, None, worse, lambda _: None)
            errors.append(ate(run.corrected or run.believed, truth, log))
            odometers.append(ate(worse.odometry_trajectory, truth, log))
        rows.append({"disturbance": disturbance, "ate_m": errors, "odometer_ate_m": odometers})
    return rows


def pooled(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return one row for the runs of all `POOLED` disturbances, taken as one sample."""
    chosen = [row for row in rows if row["disturbance"] in POOLED]
    keys = "ate_m", "odometer_ate_m"
    errors = {key: [error for row in chosen for error in row[key]] for key in keys}
    return {"disturbance": "pooled", **errors}


def table(measured: dict[str, Any]) -> str:
    """Return the figures as a table in Markdown."""
    lines = [
        "| log | disturbance | ATE, median | least-largest | by that of `noise` | odometer "
        "| worse than it |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for name, found in measured["logs"].items():
        base = np.array(found["rows"][0]["ate_m"])
        rows = found["rows"]
        pool = [pooled(rows)] if any(row["disturbance"] in POOLED for row in rows) else []
        for row in [*rows, *pool]:
            errors, odometers = np.array(row["ate_m"]), np.array(row["odometer_ate_m"])
            worse = int((errors > odometers + SAME).sum())
            ratio = f"{np.median(errors) / np.median(base):.2f}"
            if row["ate_m"] != found["rows"][0]["ate_m"]:
                low, high = bootstrap_ratio(errors, base, np.median, np.random.default_rng(0))
                ratio += f" ({low:.2f}-{high:.2f})"
            lines.append(
                f"| {name} | {row['disturbance']} | {np.median(errors):.2f} m "
                f"| {errors.min():.2f}-{errors.max():.2f} m | {ratio} "
                f"| {np.median(odometers):.2f} m | {worse} of {len(errors)} |"
            )
    return "\n".join(lines) + "\n"


def page(measured: dict[str, Any], command: str) -> str:
    """Return the whole page in Markdown."""
    logs = measured["logs"]
    rows = [row for found in logs.values() for row in found["rows"]]
    runs = [pair for row in rows for pair in zip(row["ate_m"], row["odometer_ate_m"], strict=True)]
    no_worse = sum(error <= odometer + SAME for error, odometer in runs)
    as_recorded = ", ".join(f"{name} {found['ate_m']:.2f} m" for name, found in logs.items())
    return (
        f"# Disturbed logs\n\n`{measured['mapper']}`, {measured['runs']} runs of each disturbance. "
        "Every run adds 5 mm of noise to ranges, 3 mm and 0.1° to motions; `noise` is nothing "
        "but that. `turns`: each turn is off by Student's t of 2 degrees of freedom times 4°, cut "
        "at 30°. `lengths`: each motion's length is off by a factor of 0.85 to 1.15. `odometer`: "
        "turns are off by up to 25°, lengths by up to a tenth. `beams`: every second beam. "
        "`views`: every third reading is left out. `range`: the laser sees 8 m. `fine`: a beam "
        "between any two, and turns off by up to 24°. `frozen`: the odometer reports no motion. "
        f"`all`: {', '.join(POOLED[:-1])} and {POOLED[-1]} together; `pooled`: the runs of these "
        "five, each disturbed in one way, as one sample. Beside each ratio of medians stands its "
        "95 % interval (bootstrap).\n\n"
        f"Values of `albot1` and `association` were set on {', '.join(DEVELOPED_ON)}; the errors "
        "on the other logs, which are for the test, were watched meanwhile. Wean Hall's and "
        "Duke's logs have no reference: the error is that against the path that `graph-slam` makes "
        f"of them as recorded.\n\nAs recorded: {as_recorded}. No worse than its "
        f"own odometer: {no_worse} of {len(runs)} runs ({no_worse / len(runs):.1%}).\n\n"
        f"{table(measured)}\nMeasured by `{command}`.\n"
    )


@click.command()
@click.argument("folder", type=PathType())
@click.option("--log", "names", multiple=True, type=click.Choice(sorted(LOGS)), help="Only this.")
@click.option("--mapper", default="albot1", show_default=True)
@click.option("--runs", default=20, show_default=True, type=CountType(1))
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="SPEC",
    help="Strike with these faults instead (docs/faults.md); repeatable.",
)
@click.option("--out", type=PathType(), help="Where both files go.")
def command(
    folder: Path,
    names: tuple[str, ...],
    mapper: str,
    runs: int,
    faults: tuple[str, ...],
    out: Path | None,
) -> None:
    """Map the logs in FOLDER under every disturbance, many times."""
    parse_faults(faults, READING_FAULTS, "--fault")
    if out is not None:
        make_folder(out)
    measured: dict[str, Any] = {"mapper": mapper, "runs": runs, "logs": {}}
    for name in names or LOGS:
        log, truth = known_log(folder, name)
        run = run_mapper(mapper, None, log, lambda _: None)
        error = ate(run.corrected or run.believed, truth, log)
        click.echo(f"{name}: {error:.2f} m as recorded", err=True)
        rows = measure(log, truth, mapper, runs, faults)
        measured["logs"][name] = {"ate_m": error, "rows": rows}
    click.echo(table(measured), nl=False)
    if out is not None:
        options = f"--mapper {mapper} --runs {runs} --out OUT"
        options = "".join(f"--fault {fault} " for fault in faults) + options
        write_text(out / "robustness.json", json.dumps(measured, indent=1) + "\n")
        write_text(
            out / "robustness.md",
            page(measured, f"albot experiment study disturbed-logs LOGS {options}"),
        )
        click.echo(f"{out / 'robustness.json'}\n{out / 'robustness.md'}")
