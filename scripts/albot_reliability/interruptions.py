"""The section on interrupts and kills: the number of runs of the command, and what was left."""

from __future__ import annotations

import os
import signal
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

from albot_cli.progress import progress
from albot_env.recording.writer import CHUNK_MOMENTS

# One processor for each run, so that no library's threads are forked. Set before the libraries
# load.
os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}

from albot_reliability.interrupted_runs import (
    COMMANDS,
    EARLY,
    INTERRUPTS,
    OTHERS,
    RESUMED,
    Run,
    forked_runs,
    fresh_runs,
    prepare,
)

FORKED, FRESH = 950, 50
"""Number of interrupted runs, and of killed runs; FRESH of each are new processes."""
_KINDS = {"interrupts": INTERRUPTS, "kills": (signal.SIGKILL,)}
_MOST = ("lost",)
"""Counts of which the maximum is reported, not the sum."""

Tally = Mapping[str, Mapping[str, Counter[str]]]
"""The counts, by kind and command."""


def measure(share: float, jobs: int) -> dict[str, Any]:
    """Interrupt and kill the command at random moments; return the counts, by kind and command."""
    forked, fresh = (max(1, round(share * count)) for count in (FORKED, FRESH))
    whole = prepare()
    found: dict[str, dict[str, Counter[str]]] = {kind: {} for kind in _KINDS}
    problems: list[str] = []
    with progress("reliability", 2 * (forked + fresh), "runs") as update:
        for kind, numbers in _KINDS.items():
            every = chain(
                fresh_runs(fresh, numbers, jobs), forked_runs(whole, forked, numbers, jobs)
            )
            for run in every:
                _count(run, found[kind].setdefault(run.words[0], Counter()), problems)
                update(sum(each["runs"] for kinds in found.values() for each in kinds.values()))
    seconds = {command: length for command, (length, _) in whole.items()}
    return {"found": found, "problems": problems, "seconds": seconds, "fresh": fresh}


def _count(run: Run, tally: Counter[str], problems: list[str]) -> None:
    if run.ended:
        return
    tally["runs"] += 1
    if run.problem:
        name = signal.Signals(run.number).name
        problems.append(f"{' '.join(run.words)}: {name} after {run.after:.2f} s: {run.problem}")
    for name, count in run.facts.items():
        tally[name] = max(tally[name], count) if name in _MOST else tally[name] + count


def render(figures: Mapping[str, Any]) -> Iterable[str]:
    """Yield the section in Markdown."""
    found: Tally = figures["found"]
    totals = {kind: sum(each["runs"] for each in found[kind].values()) for kind in _KINDS}
    yield from (
        "## Interrupts and kills",
        "",
        f"{totals['interrupts']:,} runs of the command were interrupted (SIGINT to all of its",
        f"processes, as by Ctrl-C; SIGTERM or SIGHUP to one) and {totals['kills']:,} killed",
        "(SIGKILL to one process), at moments drawn evenly from the time that a run takes.",
        f"{figures['fresh']} of either were new processes that got their signal within the first",
        f"{EARLY:g} s, other subcommands among them; the others began with everything loaded.",
        "",
        "| | interrupts | kills | files found whole | most moments lost to an interrupt, "
        "a kill | torn episodes played | rows kept | temporary files left by kills | "
        "resumed to the end |",
        "|---|---|---|---|---|---|---|---|---|",
    )
    for command in (*COMMANDS, *sorted({line.split()[0] for line in OTHERS})):
        interrupts, kills = (Counter(found[kind].get(command, {})) for kind in _KINDS)
        both = interrupts + kills
        is_play = command == "play"
        cells = (
            f"`{command}`",
            str(interrupts["runs"]),
            str(kills["runs"]),
            str(both["files"]),
            f"{interrupts['lost']}, {kills['lost']}" if is_play else "",
            str(both["torn"]) if is_play else "",
            str(both["rows"]) if command in ("stress", "evaluate") else "",
            str(kills["left"]),
            str(both["resumed"]) if command in RESUMED else "",
        )
        yield f"| {' | '.join(cells)} |"
    early = sum(each.get("before us", 0) for each in found["interrupts"].values())
    yield from (
        "",
        f"Promises broken: {len(figures['problems']) or 'none'}.",
        *(f"- {problem}" for problem in figures["problems"]),
        f"{early} of the new processes got their interrupt before Python had come to our first",
        "line, and ended in a traceback of Python's own.",
        "",
        *_PROMISES.splitlines(),
    )


_PROMISES = f"""\
What is promised, and was checked after each run:

- **Every file with its final name is whole**: episodes, pictures, pages, figures, agents,
  checkpoints. Files are written beside their place and moved there; episodes, and the log of a
  training's episodes, grow by whole pieces.
- **An interrupted episode holds every moment** that its recorder was given, and is closed. That of
  a killed process lacks its end: at most the last {CHUNK_MOMENTS - 1} moments, less than a second
  of the robot's time. `albot play` plays it up to its last complete chunk, and says so.
- **A training goes on** with `--resume` from its last checkpoint.
- **A campaign or an evaluation goes on** with `--resume` from its rows: each that was written is
  there, and in the end the rows are the same, to the bit, as of a run that nobody interrupted.
- **A benchmark goes on** with the same `albot results`, from the last episodes that were kept.
- **An interrupt leaves nothing behind**: no temporary files, no processes. A killed process cannot
  tidy up: a hidden file `.NAME.…` may stay beside its place (`--resume` clears away those of a
  training), and a folder `albot-…` among the system's temporary ones. Its worker processes end by
  themselves.
- **No traceback.** Exit status 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP; while modules
  are still being imported, and at the very end, the signal itself ends the process. A closed pipe
  (`albot … | head -1`) ends a command without a word and with status 141, as it ends others.

A computer that loses its power is another matter: nothing is forced to the disk.

What is there is never overwritten unasked. A command that is to write a file that exists, or into a
folder that holds files of these names, refuses; `--force` overwrites them. `albot play` numbers the
files that nobody named: `episode.mcap`, `episode-1.mcap`, …. Only `albot results` keeps a page up
to date, and adds to the folder of its episodes. A file is written to where its symbolic link leads;
a pipe or a device gets the bytes, but no episode goes into a pipe. Commands make the folder that
they are given, and none above it.
"""
