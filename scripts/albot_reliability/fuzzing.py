"""The section on damaged files: how many each reader got, and with what results."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from albot_cli.progress import progress
from albot_reliability.fault_sampling import ROOT
from tests.fuzzing.fuzz import MEMORY
from tests.fuzzing.readers import READERS

INPUTS = 16_000
"""Number of damaged inputs, shared out among the readers."""
SEED = 1
"""Seed of the damage."""
_INTRODUCTION = """\
Whole files of every kind, damaged: their bytes flipped, cut, doubled, put in and swapped; and what
is written in them (documents, arrays, messages, words) changed, and written again so that it gets
past parsers and checksums. What was read is used: a mapper takes in more readings, an episode is
played, a training goes on. Two things may happen: a file is read, or it is refused in one clear
error."""


ROUND = 40
"""Number of inputs that each reader gets in a round of a run of some minutes."""
Tallies = dict[str, dict[str, Any]]


def measure(share: float, jobs: int, minutes: float | None = None) -> dict[str, Any]:
    """Give damaged files to all readers, in `jobs` processes; return the results by reader.

    Args:
        share: Share of `INPUTS`, if it is not a run of some minutes.
        jobs: Number of processes.
        minutes: Length of the run: rounds with one seed after the other; None for one round.
    """
    with tempfile.TemporaryDirectory() as folder:
        return fuzz(Path(folder), share=share, jobs=jobs, minutes=minutes)


def fuzz(
    folder: Path, *, share: float, jobs: int, minutes: float | None = None, seed: int = SEED
) -> dict[str, Any]:
    """Give damaged files to all readers; those that crash one are left in a folder.

    Args:
        folder: The folder, which exists.
        share: As for `measure`.
        jobs: As for `measure`.
        minutes: As for `measure`.
        seed: Seed of the first round.
    """
    began = time.monotonic()
    names = [reader.name for reader in READERS]
    examples = max(1, round(share * INPUTS / len(READERS))) if minutes is None else ROUND
    found: Tallies = {}
    rounds = 0
    while not rounds or (minutes is not None and time.monotonic() < began + 60 * minutes):
        for name, counts in _round(folder / str(rounds), names, examples, jobs, seed + rounds):
            found[name] = _added(found.get(name), counts)
        rounds += 1
    readers = {name: found[name] for name in names}
    spent = (time.monotonic() - began) / 60
    return {
        "seed": seed,
        "rounds": rounds,
        "minutes": None if minutes is None else spent,
        "memory": MEMORY,
        "readers": readers,
    }


def _round(
    folder: Path, names: list[str], examples: int, jobs: int, seed: int
) -> list[tuple[str, dict[str, Any]]]:
    """Give every reader so many inputs; return the results by reader, as they came."""
    found: list[tuple[str, dict[str, Any]]] = []
    with (
        ThreadPoolExecutor(jobs) as pool,
        progress(f"damaged files, seed {seed}", len(names), "readers") as update,
    ):

        def work(k: int) -> None:
            for name, tally in _tallies(names[k::jobs], folder / str(k), examples, seed):
                found.append((name, tally))
                update(len(found))

        list(pool.map(work, range(jobs)))
    return found


def _added(one: dict[str, Any] | None, other: dict[str, Any]) -> dict[str, Any]:
    """Return the sum of two results; an end of the process is kept."""
    if one is None or "read" not in one:
        return one or other
    if "read" not in other:
        return other
    crashes = dict(one["crashes"])
    for what, count in other["crashes"].items():
        crashes[what] = crashes.get(what, 0) + count
    return {
        "read": one["read"] + other["read"],
        "refused": one["refused"] + other["refused"],
        "crashes": crashes,
        "slowest": max(one["slowest"], other["slowest"]),
    }


def crashed(figures: Mapping[str, Any]) -> int:
    """Return how many inputs ended in anything but being read or refused."""
    return sum(
        sum(tally["crashes"].values()) if "read" in tally else 1
        for tally in figures["readers"].values()
    )


def _tallies(
    names: list[str], folder: Path, examples: int, seed: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield, for each reader, its results on damaged files, measured in a separate process.

    If the process ends early, another continues with the remaining readers.
    """
    while names:
        words = ["-m", "tests.fuzzing.fuzz", folder / str(len(names)), examples, seed, *names]
        command = [sys.executable, *map(str, words)]
        with (
            tempfile.TemporaryFile("w+") as complaints,
            subprocess.Popen(
                command, cwd=ROOT, stdout=subprocess.PIPE, stderr=complaints, text=True
            ) as process,
        ):
            assert process.stdout is not None
            for line in process.stdout:
                yield names.pop(0), json.loads(line)
            process.wait()
            if names:
                complaints.seek(0)
                yield names.pop(0), {"ended": (complaints.readlines() or [""])[-1].strip()[:200]}


def render(figures: Mapping[str, Any]) -> Iterable[str]:
    """Yield the section's lines."""
    readers = figures["readers"]
    whole = [tally for tally in readers.values() if "read" in tally]
    read, refused = (sum(tally[key] for tally in whole) for key in ("read", "refused"))
    faults = crashed(figures)
    yield "## Damaged files"
    yield ""
    yield _INTRODUCTION
    yield f"Each reader may take {figures['memory'] / 1e6:.0f} MB."
    yield ""
    first, rounds = figures["seed"], figures.get("rounds", 1)
    seeds = f"seed {first}" if rounds == 1 else f"seeds {first} to {first + rounds - 1}"
    minutes = figures.get("minutes")
    time_spent = "" if minutes is None else f", {minutes:.0f} minutes"
    yield (
        f"Of {read + refused + faults:,} inputs ({seeds}{time_spent}) {read:,} were read and "
        f"{refused:,} refused; {faults:,} ended in anything else. "
        "`python -m albot_reliability fuzz --minutes 60` goes on with other seeds, as for every "
        "night, and keeps the inputs that end in anything else."
    )
    yield ""
    yield "| reader | read | refused | anything else | slowest (s of processor time) |"
    yield "|---|---|---|---|---|"
    for name, tally in readers.items():
        if "read" not in tally:
            yield f"| {name} | | | the process ended: {tally['ended']} | |"
            continue
        crashes = "; ".join(f"{count} × {what}" for what, count in tally["crashes"].items())
        cells = (name, tally["read"], tally["refused"], crashes or 0, f"{tally['slowest']:.2f}")
        yield f"| {' | '.join(map(str, cells))} |"
