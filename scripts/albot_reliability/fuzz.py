"""The program that fuzzes the readers for some minutes, as every night."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click

from albot_cli.number_types import CountType, RealType
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_core.counts import many
from albot_core.errors import InputError
from albot_reliability import fuzzing


@click.command()
@click.option(
    "--minutes",
    default=60.0,
    show_default=True,
    type=RealType(0, min_open=True),
    help="Time after which no other round begins.",
)
@click.option(
    "--seed",
    default=None,
    type=CountType(0, 2**32 - 1),
    help="Seed of the first round; each round has the next one.  [default: another each day]",
)
@click.option("--jobs", type=CountType(1), help="Processes.  [default: one a core]")
@click.option(
    "--out",
    default=Path("fuzzed"),
    show_default=True,
    type=PathType(file_okay=False),
    help="New folder, in which crash-N folders keep the inputs that crash a reader.",
)
@JSON
def command(minutes: float, seed: int | None, jobs: int | None, out: Path, as_json: bool) -> int:
    """Give damaged files to all readers for some minutes.

    The exit status is 1 if an input ended in anything but being read or refused in one clear error.
    """
    if out.exists():
        raise InputError("--out", "a folder that is not there yet", str(out))
    out.mkdir()
    os.nice(10)
    first = _seed_of_today() if seed is None else seed
    processes = jobs or os.cpu_count() or 1
    figures = fuzzing.fuzz(out, share=1.0, jobs=processes, minutes=minutes, seed=first)
    found = fuzzing.crashed(figures)
    if as_json:
        click.echo(json.dumps({**figures, "crashes": found}))
    else:
        tallies = [tally for tally in figures["readers"].values() if "read" in tally]
        read, refused = (sum(tally[key] for tally in tallies) for key in ("read", "refused"))
        click.echo(
            f"{many(figures['rounds'], 'round')} from seed {first}, {figures['minutes']:.0f} "
            f"minutes: {read:,} inputs read, {refused:,} refused, {found:,} ended in anything else"
        )
    return 1 if found else 0


def _seed_of_today() -> int:
    """Return a seed that differs by a day's worth of rounds from that of the day before."""
    from datetime import UTC, datetime

    return 100_000 + 1000 * datetime.now(UTC).toordinal() % 2**31
