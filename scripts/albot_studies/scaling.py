"""What campaigns cost: on this machine by processes and by Ray, and so on a cluster.

The jobs are those of `albot stress`: random offices, 300 steps each, all checks. An engine's own
cost is what it takes for tasks that do nothing, against the time of a job, so that a busy machine
makes both slower alike.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from albot_agents.engine.choice import LOCAL, RAY, make_engine
from albot_agents.engine.engine import Engine, OnStep
from albot_agents.engine.rows import TAIL, Manifest, RowsFolder
from albot_benchmarks.timing import describe_machine
from albot_cli.number_types import CountType
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_stress.campaign import Campaign
from albot_stress.episodes import Job, Outcome
from albot_stress.rows import COLUMNS, row_of
from albot_stress.running import run_job

WORLDS, STEPS = "random:office", 300
MILLION = 1_000_000
CORES = 32
"""Cores of a node in the tables."""
NODES = (1, 10, 100)
_TOGETHER = 8
"""Worlds of a job."""
_EMPTY = 1000
"""Number of tasks that do nothing."""
_TITLES = (
    "a task that does nothing, ms", "the engine adds", "start of the engine, s",
    "start of a worker, s", "its first job, s", "memory a worker, MiB",
)  # fmt: skip
"""Columns of the table of engines after the numbers of worlds."""
_PEAK = re.compile(r"^VmHWM:\s*(\d+) kB$", re.MULTILINE)


@dataclass(frozen=True, kw_only=True)
class Ended:
    """What a task tells of itself."""

    outcomes: Sequence[Outcome]
    """The outcomes of its episodes."""
    seconds: float
    """Time that it took in its worker (s)."""
    peak_mib: float
    """Peak memory of the worker so far (MiB)."""


def run_timed(job: Job | None, on_step: OnStep, /) -> Ended:
    """Run a job, or nothing, and take its time."""
    began = time.perf_counter()
    outcomes = [] if job is None else run_job(job, on_step)
    seconds = time.perf_counter() - began
    return Ended(outcomes=outcomes, seconds=seconds, peak_mib=_peak_mib())


def _peak_mib() -> float:
    found = _PEAK.search(Path("/proc/self/status").read_text())
    assert found is not None, "Linux tells the memory of processes"
    return float(found[1]) / 1024.0


def empty(task: int, on_step: OnStep, /) -> None:
    """Do nothing."""


@click.command()
@click.option("--jobs", default=8, show_default=True, type=CountType(4), help="Jobs a measurement.")
@click.option(
    "--workers",
    default="1,2,4",
    show_default=True,
    metavar="N,…",
    help="Numbers of tasks at a time.",
)
@click.option("--out", default="docs/scaling.md", show_default=True, type=PathType(dir_okay=False))
@JSON
def command(jobs: int, workers: str, out: Path, as_json: bool) -> None:
    """Measure what campaigns cost, and write docs/scaling.md and its figures.

    The machine should be idle, as for all figures of speed; it takes minutes.
    """
    if not re.fullmatch(r"[1-9]\d{0,2}(,[1-9]\d{0,2})*", workers):
        raise InputError("--workers", "numbers with commas, as 1,2,4", workers)
    facts: dict[str, Any] = {"machine": describe_machine(), "jobs": jobs, "engines": {}}
    planned = _jobs(jobs)
    bare = [run_timed(job, lambda step: None) for job in (planned[0], *planned)][1:]
    facts["job_seconds"] = sum(each.seconds for each in bare) / len(bare)
    facts["job_worlds"] = _TOGETHER
    for name in (LOCAL, RAY):
        facts["engines"][name] = _measure_engine(name, planned, [*map(int, workers.split(","))])
    facts["rows"] = _measure_rows([outcome for each in bare for outcome in each.outcomes])
    for engine in facts["engines"].values():
        engine["share"] = engine["task_seconds"] / facts["job_seconds"]
    write_text(out.with_suffix(".json"), json.dumps(facts, indent=1) + "\n")
    write_text(out, page(facts))
    click.echo(json.dumps(facts) if as_json else str(out))


def _jobs(count: int) -> list[Job]:
    """Return jobs of equal size in worlds of their own."""
    campaign = Campaign(
        worlds=(WORLDS,), count=count * _TOGETHER, steps=STEPS, agents=("gap-explorer",)
    )
    episodes = campaign.episodes()
    starts = range(0, len(episodes), _TOGETHER)
    return [(tuple(episodes[start : start + _TOGETHER]),) for start in starts]


def _measure_engine(name: str, jobs: Sequence[Job], workers: Iterable[int]) -> dict[str, Any]:
    found: dict[str, Any] = {"worlds_per_minute": {}}
    for count in workers:
        with make_engine(name, count) as engine:
            began = time.perf_counter()
            engine.start()
            found.setdefault("engine_start_seconds", time.perf_counter() - began)
            found["worlds_per_minute"][str(count)] = _worlds_per_minute(engine, jobs, count, found)
            if "task_seconds" not in found:
                found["task_seconds"] = _empty_seconds(engine)
    return found


def _worlds_per_minute(
    engine: Engine, jobs: Sequence[Job], workers: int, found: dict[str, Any]
) -> float:
    """Run the jobs after one that warms each worker up; add what the first one of all shows."""
    tasks = [*([jobs[0]] * workers), *jobs]
    began = time.perf_counter()
    warm = 0.0
    with closing(engine.run(run_timed, tasks)) as results:
        for count, done in enumerate(results, start=1):
            ended = done.required(f"job {done.number}")
            if count == 1:
                start = time.perf_counter() - began - ended.seconds
                found.setdefault("worker_start_seconds", start)
                found.setdefault("worker_first_job_seconds", ended.seconds)
            if count == workers:
                warm = time.perf_counter()
            found["worker_peak_mib"] = max(found.get("worker_peak_mib", 0.0), ended.peak_mib)
    worlds = sum(len(group) for job in jobs for group in job)
    return 60.0 * worlds / (time.perf_counter() - warm)


def _empty_seconds(engine: Engine) -> float:
    """Return what a task that does nothing takes, once the workers are there (s)."""
    first = 0.0
    with closing(engine.run(empty, range(engine.workers + _EMPTY))) as results:
        for count, _ in enumerate(results, start=1):
            if count == engine.workers:
                first = time.perf_counter()
    return (time.perf_counter() - first) / _EMPTY


def _measure_rows(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """Return the size of a row, and how many are written a second."""
    with TemporaryDirectory(prefix="albot-") as scratch:
        manifest = Manifest(command="stress", words=[], plan={}, tasks=_EMPTY)
        folder = RowsFolder(path=Path(scratch, "rows"), manifest=manifest, columns=COLUMNS)
        began = time.perf_counter()
        with folder.opened(resume=False):
            for number in range(_EMPTY):
                row = row_of(outcomes[number % len(outcomes)])
                folder.add(number, row | {"world": f"{WORLDS}:{number}", "seed": number})
            seconds = time.perf_counter() - began
            lines = (folder.path / TAIL).stat().st_size
        parts = sum(path.stat().st_size for path in folder.path.glob("*.parquet"))
    return {
        "line_bytes": lines / _EMPTY,
        "parquet_bytes": parts / _EMPTY,
        "rows_per_second": _EMPTY / seconds,
    }


def page(facts: Mapping[str, Any]) -> str:
    """Return the page, in Markdown."""
    machine, rows, ray = facts["machine"], facts["rows"], facts["engines"][RAY]
    per_core = facts["job_worlds"] / facts["job_seconds"]
    limit = facts["job_worlds"] / ray["task_seconds"]
    lines = [
        _HEAD,
        "## Measured",
        "",
        f"On {machine['cores']} cores ({machine['processor']}, Python {machine['python']}), "
        f"{facts['jobs']} jobs of {facts['job_worlds']} random offices, {STEPS} steps each, agent "
        "`gap-explorer`, all checks. A job takes "
        f"{facts['job_seconds']:.2f} s without any engine: **{per_core:.2f} worlds a second and "
        "core**. What an engine adds is the time of a task that does nothing, as a share of that "
        "of a job.",
        "",
        f"| {' | '.join(('engine', *_worlds_titles(ray), *_TITLES))} |",
        "|---" + "|---:" * (len(_counts(ray)) + len(_TITLES)) + "|",
        *(_engine_row(name, each) for name, each in facts["engines"].items()),
        "",
        f"A row of `albot stress` is {rows['parquet_bytes']:.0f} bytes in Parquet and "
        f"{rows['line_bytes']:.0f} in JSON lines; {rows['rows_per_second']:,.0f} are written a "
        "second.",
        "",
        "## A campaign of 1,000,000 worlds",
        "",
        f"Worked out from the above, for nodes of {CORES} cores like these, each core with a "
        "worker:",
        "",
        "| nodes | hours | node-hours | memory of the workers a node, GiB | rows, MB |",
        "|---:|---:|---:|---:|---:|",
        *(_cost_row(nodes, per_core, ray, rows) for nodes in NODES),
        "",
        _LIMITS.format(
            limit=limit, cores=limit / per_core, task=1e3 * ray["task_seconds"],
            rows=rows["rows_per_second"],
        ),
        _CLUSTER,
    ]  # fmt: skip
    return "\n".join(lines)


def _worlds_titles(engine: Mapping[str, Any]) -> list[str]:
    return [f"worlds a minute, {count} at a time" for count in _counts(engine)]


def _counts(engine: Mapping[str, Any]) -> list[str]:
    return list(engine["worlds_per_minute"])


def _engine_row(name: str, each: Mapping[str, Any]) -> str:
    cells = [f"`{name}`", *(f"{each['worlds_per_minute'][n]:.0f}" for n in _counts(each))]
    cells += [f"{1e3 * each['task_seconds']:.2f}", f"{each['share']:.2%}"]
    names = ("engine_start_seconds", "worker_start_seconds", "worker_first_job_seconds")
    cells += [*(f"{each[key]:.1f}" for key in names), f"{each['worker_peak_mib']:.0f}"]
    return f"| {' | '.join(cells)} |"


def _cost_row(
    nodes: int, per_core: float, ray: Mapping[str, Any], rows: Mapping[str, float]
) -> str:
    hours = MILLION / per_core / (CORES * nodes) / 3600.0
    memory = CORES * ray["worker_peak_mib"] / 1024.0
    size = MILLION * rows["parquet_bytes"] / 1e6
    return f"| {nodes} | {hours:.2f} | {hours * nodes:.1f} | {memory:.0f} | {size:.0f} |"


_HEAD = """\
# Many machines

Made by `albot experiment study scaling`; the figures are in `docs/scaling.json`.

`stress`, `evaluate`, `results`, `compare`, the probes of `experiment run` and `train --seeds` run
many tasks that do not depend on each other. `--engine local`, the default, runs them in processes
of this machine. `--engine ray` runs the same tasks on [Ray](https://www.ray.io), which is the extra
`cluster`: without `--address` on this machine alone, with it on a cluster. The results are the same
to the last bit whatever the engine and the number of tasks at a time, on machines of the same kind.

A task whose process or node dies is run again elsewhere, three times at most; then it is listed
with the command that shows it. `--rows FOLDER` (`stress`, `evaluate`) keeps a row an episode as it
ends, and `--resume FOLDER` goes on with the run after any end, also a `kill -9`, a full disk or a
lost head node. `results --out FOLDER` and `train --resume FOLDER` go on by their own folders.
"""
_LIMITS = """\
## What limits it

- **The driver**, the process of the command, hands out all tasks and writes all rows. It can hand
  out one each {task:.1f} ms, so that about {limit:,.0f} worlds a second can be run, by
  {cores:,.0f} cores; and it writes {rows:,.0f} rows a second. Jobs of `albot stress` hold up to 64
  worlds, more than those measured here, so that it is idle for most of the time. Of each processor
  two tasks are with Ray at a time, and the plan of a million episodes is in its memory.
- **The object store** holds results larger than 100 kB until the driver has read them: the maps of
  `compare`, not the rows of `stress`. Ray writes what does not fit to the disk.
- **The start of workers**: each loads albot-env and its compiled code once, and keeps it.
- **A shared folder**: relative paths, worlds and agents given as files, `ALBOT_DATA` and the
  folders of `train` and `evaluate --record` must be the same on all nodes.
"""
_CLUSTER = """\
## A cluster of 100 nodes

Install the same version of albot-env with its extra `cluster` on all nodes (another one is refused
when its first task runs), and give all the same token. On the head:

```text
ray get-auth-token --generate  # Copy ~/.ray/auth_token to all nodes.
RAY_USAGE_STATS_ENABLED=0 RAY_AUTH_MODE=token ray start --head --port 6379 --include-dashboard false
```

On each of the others, here by Slurm, then the command itself on the head:

```text
srun --nodes 99 --ntasks-per-node 1 env RAY_AUTH_MODE=token \\
  ray start --address HEAD:6379 --block &
RAY_AUTH_MODE=token albot stress --worlds random --count 1000000 \\
  --engine ray --address auto --rows /shared/million
```

If the head is lost, start the cluster again and go on, with `--resume /shared/million` in place of
`--worlds`, `--count` and `--rows`. Nodes may come and go meanwhile. What listens on which ports
then is said in `SECURITY.md`.
"""
