"""Mappers led through logs, each run in a process of its own, and what each run measured."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from albot_agents.workers import TaskRunner, run_parallel
from albot_cli.map_report import report, run_mapper, score, warm_up
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.evaluation.map_quality import mean_map_entropy, scan_cloud
from albot_core.evaluation.trajectory import (
    Relations,
    Trajectory,
    alignment_at_start,
    trajectory_error,
)
from albot_core.logs.log import Log
from albot_core.maps.layers import MapSnapshot

_LOADING = 5.0
"""Seconds for which a run is warmed up, so that all compiled code has been loaded."""
KEPT = (
    "ate_rmse_m",
    "corrected_ate_rmse_m",
    "relations",
    "corrected_relations",
    "map_entropy",
    "updates",
    "surfaces",
    "places",
)
"""The figures of `albot map` that stand in a row."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """A robot's log that mappers are led through, and what is known of the truth."""

    log: Log
    """What the robot sensed."""
    seed: int
    """Seed of the mappers' random numbers, and of the episode, where it is one of a world."""
    reference: Trajectory | None = None
    """Where the robot was."""
    relations: Relations | None = None
    """How its poses lay to each other."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MapperChoice:
    """A mapper with its thresholds."""

    label: str
    """What it is called in tables."""
    name: str
    """The mapper's name."""
    config: Any = None
    """Its thresholds; None for the default ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MapperRun:
    """A mapper to be led through a log."""

    choice: MapperChoice
    """The mapper."""
    source: Source
    """The log."""
    compiles: bool = False
    """Whether it is only led through the log's beginning, so that its code is compiled."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunResult:
    """What a run measured."""

    run: MapperRun
    """The run."""
    figures: dict[str, Any]
    """A row of the comparison, by the keys of its JSON."""
    snapshot: MapSnapshot | None = None
    """The map at the end."""
    path: Trajectory | None = None
    """Where the mapper believes at the end that the robot was, in the map's frame."""


class MapperRunner(TaskRunner[MapperRun, "RunResult | InputError"]):
    """Leads mappers through logs; what is wrong with one comes back as the error that it is."""

    def run(self, task: MapperRun, on_step: Callable[[int], None]) -> RunResult | InputError:
        """Lead a mapper through a log."""
        try:
            if task.compiles:
                warm_up(task.choice.name, task.choice.config, task.source.log)
                return RunResult(run=task, figures={})
            return measure_run(task, on_step)
        except InputError as error:
            return error

    def on_crash(self, task: MapperRun, step: int, cause: str) -> RunResult:
        """A row that says of what, and at which reading, the process died."""
        figures = {**no_figures(task), "error": f"{cause}, at reading {step} or soon after"}
        return RunResult(run=task, figures=figures)


def no_figures(run: MapperRun) -> dict[str, Any]:
    """The row of a run that was not finished."""
    unknown = ("unaligned_rmse_m", *KEPT, "corrected_map_entropy", "map_bytes")
    speed = ("readings_per_second", "slowest_reading_ms", "peak_mib")
    begin = {"mapper": run.choice.label, "seed": run.source.seed}
    return {**begin, **dict.fromkeys((*unknown, *speed)), "error": None}


def measure_run(run: MapperRun, on_step: Callable[[int], None] = lambda _: None) -> RunResult:
    """Lead a mapper through a log and measure what it comes to, in this process.

    The peak of the memory is that of the process, Python and its libraries included: it is the
    mapper's only in a process that has done nothing else.

    Args:
        run: The mapper and the log.
        on_step: Is called now and then with the number of readings done.

    Raises:
        InputError: The mapper needs a sensor that the log lacks.
    """
    choice, source = run.choice, run.source
    log = source.log
    warm_up(choice.name, choice.config, log, seconds=_LOADING)
    rng = np.random.default_rng(source.seed)
    mapped = run_mapper(choice.name, choice.config, log, on_step, rng=rng)
    online = score(mapped.believed, source.reference, source.relations)
    corrected = None
    if mapped.corrected is not None:
        corrected = score(mapped.corrected, source.reference, source.relations)
    odometry = score(log.odometry_trajectory, source.reference, None)
    told = report(log, mapped, online, corrected, odometry)
    figures = no_figures(run) | {key: told[key] for key in KEPT}
    path = mapped.corrected or mapped.believed
    figures |= {
        "unaligned_rmse_m": _unaligned(mapped.believed, source.reference),
        "corrected_map_entropy": None if mapped.corrected is None else _entropy(log, path),
        "map_bytes": sum(array.nbytes for array in mapped.mapper.state().values()),
        "readings_per_second": told["scans_per_second"],
        "slowest_reading_ms": 1e3 * mapped.slowest,
        "peak_mib": _peak_mib(),
    }
    return RunResult(run=run, figures=figures, snapshot=mapped.mapper.snapshot(), path=path)


def _unaligned(believed: Trajectory, reference: Trajectory | None) -> float | None:
    """The error of positions in the map's own frame, which begins where the robot did (m)."""
    if reference is None:
        return None
    error = trajectory_error(believed, reference, align=alignment_at_start)
    return None if error is None else error.rmse


def _entropy(log: Log, path: Trajectory) -> float | None:
    if log.ranges is None:
        return None
    scans = [reading.required_laser("map entropy") for reading in log.readings]
    return mean_map_entropy(scan_cloud(scans, path.poses))


def _peak_mib() -> float | None:
    """The most memory that this process has taken so far (MiB); None where no system tells."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) / 1024.0 / (1024.0 if sys.platform == "darwin" else 1.0)


def compare_mappers(
    choices: Iterable[MapperChoice], sources: list[Source], jobs: int
) -> Generator[RunResult, None, None]:
    """Lead each mapper through each log, in parallel; the results as they are done.

    First each is led through the beginning of the first log, so that its code is compiled.

    Args:
        choices: The mappers.
        sources: The logs.
        jobs: How many run at once. Figures of speed are best with one.

    Raises:
        InputError: A mapper needs a sensor that a log lacks.
    """
    first = [MapperRun(choice=choice, source=sources[0], compiles=True) for choice in choices]
    runs = [MapperRun(choice=run.choice, source=source) for source in sources for run in first]
    for what, tasks in (("compiling", first), ("comparing", runs)):
        results = run_parallel(MapperRunner(), tasks, min(jobs, len(tasks)), fresh=True)
        with progress(what, len(tasks), "runs") as tell, closing(results):
            for done, result in enumerate(results, start=1):
                if isinstance(result, InputError):
                    raise result
                tell(done, result.run.choice.label)
                if not result.run.compiles:
                    yield result
