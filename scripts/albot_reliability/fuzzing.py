"""The section on damaged files: how many each reader got, and with what results."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
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


def measure(share: float, jobs: int) -> dict[str, Any]:
    """Give damaged files to all readers, in `jobs` processes; return the results by reader."""
    examples = max(1, round(share * INPUTS / len(READERS)))
    names = [reader.name for reader in READERS]
    found: dict[str, Any] = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        ThreadPoolExecutor(jobs) as pool,
        progress("damaged files", len(names), "readers") as update,
    ):

        def work(k: int) -> None:
            for name, tally in _tallies(names[k::jobs], Path(folder) / str(k), examples):
                found[name] = tally
                update(len(found))

        list(pool.map(work, range(jobs)))
    readers = {name: found[name] for name in names}
    return {"seed": SEED, "memory": MEMORY, "readers": readers}


def _tallies(names: list[str], folder: Path, examples: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield, for each reader, its results on damaged files, measured in a separate process.

    If the process ends early, another continues with the remaining readers.
    """
    while names:
        words = ["-m", "tests.fuzzing.fuzz", folder / str(len(names)), examples, SEED, *names]
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
    faults = sum(sum(tally["crashes"].values()) for tally in whole) + len(readers) - len(whole)
    yield "## Damaged files"
    yield ""
    yield _INTRODUCTION
    yield f"Each reader may take {figures['memory'] / 1e6:.0f} MB."
    yield ""
    yield (
        f"Of {read + refused + faults:,} inputs (seed {figures['seed']}) {read:,} were read and "
        f"{refused:,} refused; {faults:,} ended in anything else."
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
