"""`albot bench`: speed, each figure beside something run in the same minute."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.logs.reader import read_log
from albot_core.registry import mapper_names

PARTS = ("laser", "mapper", "env", "generator", "startup")


@click.command()
@click.option("--part", "parts", multiple=True, help=f"Measure only this part: {', '.join(PARTS)}.")
@click.option(
    "--log",
    type=click.Path(path_type=Path),
    help="A real robot's log for the mappers; by default they map a simulated tour.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def command(parts: tuple[str, ...], log: Path | None, as_json: bool) -> None:
    """Measure laser, mappers, environments, random worlds and the start, on one core."""
    for part in parts:
        if part not in PARTS:
            raise InputError("--part", f"one of {', '.join(PARTS)}", repr(part))
    measures = _measures(log)
    chosen = parts or PARTS
    # The keys stand whether measured or not, so that programs can rely on them.
    figures: dict[str, Any] = {"machine": _machine(), "laser": [], "mapper": [], "env": []}
    figures |= {"generator": [], "learner": {}}
    with progress("bench", len(chosen), "parts") as tell:
        for done, part in enumerate(chosen, start=1):
            figures[part] = measures[part]()
            tell(done)
    click.echo(json.dumps(figures) if as_json else _as_text(figures))


def _measures(log: Path | None) -> dict[str, Callable[[], Any]]:
    """How each part is measured. Imported here: the benchmarks need all of the simulator."""
    from albot_cli.startup import measure_startup
    from albot_env.benchmarks.environment import measure_environments
    from albot_env.benchmarks.generator import measure_generators
    from albot_env.benchmarks.laser import measure_laser
    from albot_env.benchmarks.mapper import measure_growth, measure_mappers

    readings = read_log(log).readings if log else None
    return {
        "laser": measure_laser,
        "mapper": lambda: measure_mappers(mapper_names(), readings) + measure_growth(),
        "env": measure_environments,
        "generator": measure_generators,
        "startup": measure_startup,
    }


def _machine() -> dict[str, Any]:
    from albot_env.benchmarks.machine import describe_machine

    return describe_machine()


def _as_text(figures: dict[str, Any]) -> str:
    machine = figures["machine"]
    lines = [f"{machine['processor']}, Python {machine['python']}"]
    lines += [_laser_line(row) for row in figures["laser"]]
    lines += [
        f"mapper      {row['surfaces']:7,d} surfaces  "
        f"{row['readings_per_second']:8,.0f} readings/s  {row['name']}"
        for row in figures["mapper"]
    ]
    lines += [
        f"environment {row['num_envs']:7,d} {row['mode']:9s} "
        f"{row['steps_per_second']:8,.0f} steps/s     {row['id']} with {row['mapper']}"
        for row in figures["env"]
    ]
    lines += [
        f"generator   {row['walls']:7,.0f} walls     {row['worlds_per_second']:8,.0f} worlds/s    "
        f"{row['kind']}"
        for row in figures["generator"]
    ]
    if "startup" in figures:
        start = figures["startup"]
        lines.append(
            f"start       {start['first_s']:.1f} s compiling everything, "
            f"{start['later_s']:.2f} s from the cache"
        )
    return "\n".join(lines)


def _laser_line(row: dict[str, float | int]) -> str:
    return (
        f"laser       {row['segments']:7,d} walls     {row['us_per_scan']:8.2f} µs/scan in a "
        f"batch, {row['us_per_scan_single']:.2f} alone; pymunk's query in a loop takes "
        f"{row['ratio_to_pymunk']:,.0f} times as long"
    )
