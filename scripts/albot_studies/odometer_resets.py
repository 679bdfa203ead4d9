"""Effect of odometer resets, inserted into logs, on the mappers' errors, as a table.

In each run the odometer jumps once, by a given length in a random direction, with or without a
random turn, before one of `--scans` random scans of a log of the data folder, or of a robot that
explores a simulated world. The table shows the difference of the ATE to that of the log as
recorded.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_cli.explored_logs import Exploration, explore
from albot_cli.mapping_run import run_mapper
from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.evaluation.trajectory import Trajectory
from albot_core.files import write_text
from albot_core.logs.disturbed import with_faults
from albot_core.logs.log import Log
from albot_studies.disturbed_logs import LOGS, ate, known_log

WORLDS = {"office": "random:office:7", "apartment": "random:apartment:7"}
"""Simulated worlds, which a robot explores for `STEPS` steps of 0.1 s."""
STEPS = 1500
JUMPS = (1.0, 3.0, 4.0, 10.0, 30.0)
"""Lengths of the jumps (m)."""
MAPPERS = (
    "albot1", "albot1-tracked", "albot1-thesis", "association", "ratslam", "graph-slam",
    "scan-matching", "gmapping", "odometry",
)  # fmt: skip
"""The mappers that are measured by default."""
_EDGE = 5
"""Number of scans at either end of a log before which the odometer does not jump."""


def any_log(folder: Path, name: str) -> tuple[Log, Trajectory]:
    """Return a log of the data folder or of a simulated world, and the robot's true path."""
    if name in LOGS:
        return known_log(folder, name)
    log = explore(
        Exploration(world=WORLDS[name], seed=7, agent="gap-explorer", steps=STEPS, sensors={})
    )
    assert log.reference_trajectory is not None
    return log, log.reference_trajectory


def measure(log: Log, truth: Trajectory, mapper: str, scans: int) -> list[dict[str, Any]]:
    """Return one row per length: the differences of the ATE (m), and the number of jumps found."""

    def error(of: Log) -> float:
        run = run_mapper(mapper, None, of, lambda _: None, rng=np.random.default_rng(0))
        return ate(run.corrected or run.believed, truth, of)

    undisturbed, rng, rows = error(log), np.random.default_rng(0), []
    for length in JUMPS:
        differences, found = [], 0
        for turn in ("0deg", "0..180deg"):
            for drawn in rng.integers(_EDGE, len(log.stamps) - _EDGE, scans).tolist():
                scan = int(np.searchsorted(log.times, log.times[drawn]))  # The first of that time.
                moment = float(log.times[scan] - log.times[0])
                jump = f"odometer-jump:at={moment!r}s,length={length}m,turn={turn}"
                wrong = with_faults(log, jump, int(rng.integers(2**32)))
                differences.append(error(wrong) - undisturbed)
                found += [reset.scan for reset in wrong.resets] == [scan]
        rows.append({"jump_m": length, "differences_m": differences, "found": found})
    return rows


def table(measured: dict[str, dict[str, list[dict[str, Any]]]]) -> str:
    """Return the largest differences and the numbers of jumps found, as a table in Markdown."""
    lines = [
        f"| log | mapper | {' | '.join(f'{length:g} m' for length in JUMPS)} |",
        "|---|---|" + "---:|" * len(JUMPS),
    ]
    for name, mappers in measured.items():
        for mapper, rows in mappers.items():
            cells = [
                f"{max(row['differences_m'], key=abs):+.2f} m, "
                f"{row['found']} of {len(row['differences_m'])}"
                for row in rows
            ]
            lines.append(f"| {name} | {mapper} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


@click.command()
@click.argument("folder", type=PathType())
@click.option("--log", "names", multiple=True, type=click.Choice([*LOGS, *WORLDS]))
@click.option("--mapper", "mappers", multiple=True, default=MAPPERS, show_default=True)
@click.option(
    "--scans",
    default=2,
    show_default=True,
    type=CountType(1),
    help="Scans a length, twice: with a turn.",
)
@click.option("--out", type=PathType(), help="File for the table.")
def command(
    folder: Path, names: tuple[str, ...], mappers: tuple[str, ...], scans: int, out: Path | None
) -> None:
    """Insert resets of the odometer into logs of FOLDER and of simulated worlds, and map them."""
    measured: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for name in names or (*LOGS, *WORLDS):
        log, truth = any_log(folder, name)
        measured[name] = {}
        for mapper in mappers:
            measured[name][mapper] = measure(log, truth, mapper, scans)
            click.echo(f"{name}: {mapper}", err=True)
    click.echo(table(measured), nl=False)
    if out is not None:
        write_text(out, table(measured))
        click.echo(str(out))
