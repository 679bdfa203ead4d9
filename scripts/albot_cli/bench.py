"""`albot bench`: speed, each figure beside something run in the same minute."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from albot_cli.bench_report import as_text
from albot_cli.journey_page import write_journey
from albot_cli.outputs import check_file
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.logs.reader import read_log
from albot_core.mappers.registry import mapper_names

ROUNDS = 6
"""Turns of the environments."""
PARTS = ("laser", "mapper", "journey", "env", "processes", "learner", "generator", "startup")


@click.command()
@click.option("--part", "parts", multiple=True, help=f"Measure only this part: {', '.join(PARTS)}.")
@click.option(
    "--log",
    type=click.Path(path_type=Path),
    help="A real robot's log for the mappers; by default they map a simulated tour.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Page for the journey, in Markdown; its picture is written beside it.",
)
@click.option(
    "--rounds",
    type=click.IntRange(1),
    help="Turns that each environment has, of which the best counts: on a busy machine more find "
    f"a quieter moment.  [default: {ROUNDS}]",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def command(
    parts: tuple[str, ...],
    log: Path | None,
    out: Path | None,
    rounds: int | None,
    as_json: bool,
) -> None:
    """Measure speed: laser, mappers, environments, a learner, random worlds and the start.

    The journey leads a mapper 10 km through one building, to see whether it slows down.
    Each other figure is the best of several rounds on one core; of `processes` on as many as
    there are processes, of `learner` on all cores.
    """
    for part in parts:
        if part not in PARTS:
            raise InputError("--part", f"one of {', '.join(PARTS)}", repr(part))
    if out is not None:
        if parts and "journey" not in parts:
            raise InputError("--out", "--part journey, whose page it is", ", ".join(parts))
        check_file(out)
    if rounds is not None and parts and "env" not in parts:
        raise InputError("--rounds", "--part env, whose rounds they are", ", ".join(parts))
    measures = _measures(log, rounds or ROUNDS)
    chosen = parts or PARTS
    # The keys stand whether measured or not, so that programs can rely on them.
    figures: dict[str, Any] = {"machine": _machine(), "laser": [], "mapper": [], "env": []}
    figures |= {"journey": [], "generator": [], "processes": {}, "learner": {}}
    with progress("bench", len(chosen), "parts") as tell:
        for done, part in enumerate(chosen, start=1):
            figures[part] = measures[part]()
            tell(done)
    if out is not None and figures["journey"]:
        write_journey(out, figures["journey"], figures["machine"])
    click.echo(json.dumps(figures) if as_json else as_text(figures))


def _measures(log: Path | None, rounds: int) -> dict[str, Callable[[], Any]]:
    """How each part is measured. Imported here: the benchmarks need all of the simulator."""
    from albot_benchmarks.environment import measure_environments
    from albot_benchmarks.generator import measure_generators
    from albot_benchmarks.journey import measure_journey
    from albot_benchmarks.laser import measure_laser
    from albot_benchmarks.learner import measure_learner
    from albot_benchmarks.mapper import measure_growth, measure_mappers
    from albot_benchmarks.processes import measure_processes
    from albot_cli.startup import measure_startup

    readings = read_log(log).readings if log else None
    return {
        "laser": measure_laser,
        "mapper": lambda: measure_mappers(mapper_names(), readings) + measure_growth(),
        "journey": measure_journey,
        "env": lambda: measure_environments(rounds=rounds),
        "processes": measure_processes,
        "learner": measure_learner,
        "generator": measure_generators,
        "startup": measure_startup,
    }


def _machine() -> dict[str, Any]:
    from albot_benchmarks.machine import calibrate, describe_machine

    return describe_machine() | {"calibration": calibrate()}
