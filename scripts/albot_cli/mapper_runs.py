"""Runs of mappers on logs, each in its own process, and their results."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from albot_agents.engine.engine import Crash, Engine, OnStep
from albot_cli.map_report import report, score
from albot_cli.mapping_run import run_mapper, warm_up
from albot_cli.progress import progress
from albot_core.evaluation.map_quality import mean_map_entropy, scan_cloud
from albot_core.evaluation.trajectory import (
    Relations,
    Trajectory,
    alignment_at_start,
    trajectory_error,
)
from albot_core.logs.log import Log
from albot_core.mappers.mapper import AttractorNetwork, Mapper
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Reading
from albot_env.rendering.page.tracks import Track, TrackWriter

_STATUS = Path("/proc/self/status")
"""The file in which Linux reports this process's memory."""
MAP_VERSIONS = 600
"""Largest number of versions of a map on a page."""
_LOADING = 5.0
"""Duration of a run's warm-up (s), in which all compiled code is loaded."""
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
"""The figures of `albot map` that are part of a row."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """A robot's log that mappers run on, and its ground truth if known."""

    log: Log
    """The robot's readings."""
    seed: int
    """Seed of the mappers' random numbers, and of the episode if the source is a world."""
    reference: Trajectory | None = None
    """True poses of the robot."""
    relations: Relations | None = None
    """True relations between the robot's poses."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MapperChoice:
    """A mapper with its parameters."""

    label: str
    """Its label in tables."""
    name: str
    """The mapper's name."""
    config: Any = None
    """Its parameters; None for the defaults."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MapperRun:
    """One run of a mapper on a log."""

    choice: MapperChoice
    """The mapper."""
    source: Source
    """The log."""
    compiles: bool = False
    """Whether it only processes the log's beginning, to compile the mapper's code."""
    tracks: bool = False
    """Whether all that the mapper believes is taken down for a page."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunResult:
    """The result of a run. It does not hold the log: many results would take much memory."""

    figures: dict[str, Any]
    """A row of the comparison, by the keys of its JSON."""
    snapshot: MapSnapshot | None = None
    """The map at the end."""
    path: Trajectory | None = None
    """The mapper's final estimate of the robot's poses, in the map's frame."""
    track: Track | None = None
    """What the mapper believed at each reading; None if it was not taken down."""


def _run_one(run: MapperRun, on_step: OnStep, /) -> RunResult:
    """Run a mapper on a log, or compile its code alone."""
    if run.compiles:
        warm_up(run.choice.name, run.choice.config, run.source.log)
        return RunResult(figures=no_figures(run))
    return measure_run(run, on_step)


def _crashed(run: MapperRun, crash: Crash) -> RunResult:
    """Return a row with the cause of a crash and the reading at which it happened."""
    where = "" if crash.step is None else f", at reading {crash.step} or soon after"
    return RunResult(figures={**no_figures(run), "error": f"{crash.cause}{where}"})


def no_figures(run: MapperRun) -> dict[str, Any]:
    """Return the row of a run that was not finished."""
    unknown = ("unaligned_rmse_m", *KEPT, "corrected_map_entropy", "map_bytes")
    speed = ("readings_per_second", "slowest_reading_ms", "peak_mib")
    begin = {"mapper": run.choice.label, "seed": run.source.seed}
    return {**begin, **dict.fromkeys((*unknown, *speed)), "error": None}


def measure_run(run: MapperRun, on_step: Callable[[int], None] = lambda _: None) -> RunResult:
    """Run a mapper on a log in this process, and measure the result.

    Peak memory is that of the process, including Python and its libraries, so it is only meaningful
    in a process that has done nothing else.

    Args:
        run: The mapper and the log.
        on_step: Called from time to time with the number of readings done.

    Raises:
        InputError: The mapper needs a sensor that the log lacks.
    """
    choice, source = run.choice, run.source
    log = source.log
    warm_up(choice.name, choice.config, log, seconds=_LOADING)
    rng = np.random.default_rng(source.seed)
    follower = _Follower(run) if run.tracks else None
    follow: dict[str, Any] = {} if follower is None else {"follow": follower.follow}
    mapped = run_mapper(choice.name, choice.config, log, on_step, rng=rng, **follow)
    online = score(mapped.believed, source.reference, source.relations)
    corrected = None
    if mapped.corrected is not None:
        corrected = score(mapped.corrected, source.reference, source.relations)
    odometry = score(log.odometry_trajectory, source.reference, None)
    reported = report(log, mapped, online, corrected, odometry)
    figures = no_figures(run) | {key: reported[key] for key in KEPT}
    path = mapped.corrected or mapped.believed
    figures |= {
        "unaligned_rmse_m": _unaligned(mapped.believed, source.reference),
        "corrected_map_entropy": None if mapped.corrected is None else _entropy(log, path),
        "map_bytes": sum(array.nbytes for array in mapped.mapper.state().values()),
        "readings_per_second": reported["scans_per_second"],
        "slowest_reading_ms": 1e3 * mapped.slowest,
        "peak_mib": _peak_mib(),
    }
    return RunResult(
        figures=figures,
        snapshot=mapped.mapper.snapshot(),
        path=path,
        track=None if follower is None else follower.writer.track(),
    )


class _Follower:
    """Takes down what a mapper believes as it runs."""

    def __init__(self, run: MapperRun) -> None:
        times = run.source.log.times
        interval = float(times[-1] - times[0]) / (MAP_VERSIONS - 1)  # The last map is one more.
        self.writer = TrackWriter(run.choice.label, np.zeros(3), map_interval=interval)
        self._version = -1

    def follow(self, reading: Reading, mapper: Mapper) -> None:
        """Take down the state after a reading."""
        estimate = mapper.estimate
        changed, self._version = estimate.map_version != self._version, estimate.map_version
        self.writer.add(
            reading.stamp,
            estimate.pose,
            estimate.home_from_robot,
            mapper.snapshot() if changed else None,
            mapper.activity if isinstance(mapper, AttractorNetwork) else None,
        )


def _unaligned(believed: Trajectory, reference: Trajectory | None) -> float | None:
    """Return the position error in the map's frame, aligned only at the start (m)."""
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
    """Return the peak memory of this process so far (MiB); None if it is not reported."""
    if sys.platform == "win32":
        return None
    # On Linux `getrusage` counts the memory of the process that started this one, too.
    status = _STATUS.read_text() if _STATUS.exists() else ""
    if found := re.search(r"^VmHWM:\s*(\d+) kB$", status, re.MULTILINE):
        return float(found[1]) / 1024.0
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) / 1024.0 / (1024.0 if sys.platform == "darwin" else 1.0)


def compare_mappers(
    choices: Iterable[MapperChoice], sources: list[Source], engine: Engine, *, tracks: bool = False
) -> Generator[RunResult, None, None]:
    """Run each mapper on each log, in parallel; yield each result when it is done.

    First each mapper runs on the beginning of the first log, to compile its code.

    Args:
        choices: The mappers.
        sources: The logs.
        engine: Runs them. Figures of speed are most accurate with one at a time.
        tracks: Whether the runs on the first log also tell what the mappers believed at each time.

    Raises:
        InputError: A mapper needs a sensor that a log lacks.
    """
    first = [MapperRun(choice=choice, source=sources[0], compiles=True) for choice in choices]
    runs = [
        MapperRun(choice=run.choice, source=source, tracks=tracks and source is sources[0])
        for source in sources
        for run in first
    ]
    for what, tasks in (("compiling", first), ("comparing", runs)):
        results = engine.run(_run_one, tasks, fresh=True)
        with progress(what, len(tasks), "runs") as tell, closing(results):
            for count, done in enumerate(results, start=1):
                result = done.result
                if isinstance(result, Crash):
                    result = _crashed(done.task, result)
                tell(count, result.figures["mapper"])
                if tasks is runs:
                    yield result
