"""Experiment 6 of the Albot1 thesis: logs of other robots (section 3.2.6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from albot_core.errors import InputError
from albot_core.evaluation.map_quality import cloud_error, mean_map_entropy, scan_cloud
from albot_core.evaluation.trajectory import (
    RelationError,
    Trajectory,
    relation_error,
    trajectory_error,
)
from albot_core.geometry.poses import compose, transform_segments
from albot_core.geometry.types import Pose
from albot_core.logs.log import Log, with_noise
from albot_experiments.drawing import FLOOR, PATH, SURFACE, draw_floor
from albot_experiments.mapping import (
    MAPPERS,
    SHAPE_BOUND,
    MappedJourney,
    map_readings,
    median_and_worst,
)
from albot_experiments.real_logs import LOGS, KnownLog, RealLog, read_real_log
from albot_experiments.report import Figures, Report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "albot1-e6"
TITLE = "Public logs (Hossain 2014, section 3.2.6, figure 3.29)"
PAPER = {"logs": 1, "reasonable_shape": True}
PATH_BOUND = 0.01
"""A map has a reasonable shape where its path's error is at most this share of its length."""
_DRAWN = 15_000
"""Points of a reference map in the picture."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A mapper on a log."""

    real: RealLog
    known: KnownLog
    mapped: MappedJourney
    frame: Pose
    """The map's frame on the floor."""
    surface_error: float | None
    """Median distance of the surfaces to the walls (m)."""
    path_error: float | None
    """The ATE (m); None where the true path is not known."""
    relations: RelationError | None
    disturbed_errors: tuple[float, ...]
    """The ATE of runs with a little noise added (m)."""

    @property
    def reasonable(self) -> bool:
        """Whether the map's shape is: by its path, or by its walls where no path is known."""
        if self.disturbed_errors:
            error = np.median(self.disturbed_errors)
            return bool(error <= PATH_BOUND * self.known.log.path_length)
        return self.surface_error is not None and self.surface_error <= SHAPE_BOUND


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Map each log as it is, and once a seed with a little noise added.

    Raises:
        InputError: No seeds, or no folder of real logs.
    """
    if not len(seeds):
        raise InputError("seeds", "at least one", "none")
    runs = []
    for done, real in enumerate(LOGS, start=1):
        known = read_real_log(real)
        generators = [np.random.default_rng(seed) for seed in seeds]
        # Without a true path nothing is measured on them.
        noisy = [with_noise(known.log, rng) for rng in generators if known.truth is not None]
        runs += [map_log(name, real, known, noisy) for name in MAPPERS]
        progress(done * len(seeds) // len(LOGS))
    return _report(seeds, runs)


def map_log(name: str, real: RealLog, known: KnownLog, noisy: list[Log]) -> Run:
    """Lead a mapper through a log and its noisy copies, and hold it against what is known."""
    mapped, believed = _follow(name, known.log)
    surfaces = mapped.mapper.snapshot().segments
    frame = known.frame_of(believed, surfaces)
    errors = (_path_error(_follow(name, log)[1], known) for log in noisy)
    return Run(
        real=real,
        known=known,
        mapped=mapped,
        frame=frame,
        surface_error=cloud_error(surfaces, known.floor, frame),
        path_error=_path_error(believed, known),
        relations=relation_error(believed, known.relations) if known.relations else None,
        disturbed_errors=tuple(error for error in errors if error is not None),
    )


def _follow(name: str, log: Log) -> tuple[MappedJourney, Trajectory]:
    mapped = map_readings(name, log.readings)
    return mapped, Trajectory(stamps=log.stamps, poses=mapped.poses)


def _path_error(believed: Trajectory, known: KnownLog) -> float | None:
    error = None if known.truth is None else trajectory_error(believed, known.truth)
    return None if error is None else error.rmse


def _report(seeds: range, runs: list[Run]) -> Report:
    ours = [run for run in runs if run.mapped.mapper.spec.name == "albot1"]
    measured: dict[str, Figures] = {
        "logs": len(ours),
        "reasonable_shape": all(run.reasonable for run in ours),
        "seeds": len(seeds),
    }
    measured |= {f"{run.real.name}, {run.mapped.mapper.spec.name}": _figures(run) for run in runs}
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=all(run.reasonable for run in ours),
        text=_text(seeds),
        pictures={"maps": _picture(runs)},
    )


def _figures(run: Run) -> dict[str, Figures]:
    log, relations = run.known.log, run.relations
    lasers = [reading.required_laser("map entropy") for reading in log.readings]
    spread = median_and_worst(run.disturbed_errors) if run.disturbed_errors else None
    return {
        "path_m": round(log.path_length, 1),
        "views": len(log.readings),
        "updates": int(run.mapped.updates[-1]),
        "path_error_m": _rounded(run.path_error),
        "path_error_disturbed_m": spread,
        "surface_error_m": _rounded(run.surface_error),
        "relations_translation_m": _rounded(relations.translation_mean) if relations else None,
        "relations_rotation_deg": (
            _rounded(np.degrees(relations.rotation_mean)) if relations else None
        ),
        "map_entropy": _rounded(mean_map_entropy(scan_cloud(lasers, run.mapped.poses))),
        "reasonable_shape": run.reasonable,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 3)


def _text(seeds: range) -> str:
    return f"""
The thesis maps one public log and finds its shape reasonable. Here it is five: Intel Research
Lab, ACES in Austin, Freiburg building 101, and two of Wean Hall, raw odometer and laser.

- `path_error_m`: root mean square distance of the believed path to the reference's after rigid
  alignment (ATE); *disturbed*: median and worst of {len(seeds)} runs with a little noise added
  (5 mm on ranges, 3 mm and 0.1° on motions), for one log is one draw.
- `surface_error_m`: median distance from the map's surfaces to the reference map: the scans laid
  where the reference has the robot, or, for Wean Hall, the faces of the walls of the
  building's map (cells of 10 cm), on which the map is laid as it fits best.
- `relations_…`: mean errors against the published true relations, at the stamps that match.
- `map_entropy`: lower is sharper; it needs no reference.

A shape counts as reasonable where the path's error, the median of the disturbed runs, is at
most {PATH_BOUND:.0%} of the path, or, where no path is known, the surfaces' at most
{SHAPE_BOUND} m; reached where that is so for `albot1` on all logs. No mapper here closes
loops: on the largest floors, walls seen again after a hundred metres stand beside themselves.
"""


def _picture(runs: list[Run]) -> Figure:
    """A column for each log, a row for each mapper."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(20, 11.5), layout="constrained")
    grid = figure.subplots(len(MAPPERS), len(LOGS))
    for axes, run in zip(grid.T.ravel(), runs, strict=True):
        _draw(axes, run)
    return figure


def _draw(axes: Axes, run: Run) -> None:
    floor = run.known.floor
    axes.plot(*floor[:: -(-len(floor) // _DRAWN)].T, ",", color=FLOOR)
    surfaces = transform_segments(run.frame, run.mapped.mapper.snapshot().segments)
    draw_floor(axes, surfaces, SURFACE)
    axes.plot(*compose(run.frame, run.mapped.poses)[:, :2].T, color=PATH, lw=0.5)
    error = f"{run.surface_error:.2f} m" if run.surface_error is not None else "no map"
    axes.set_title(f"{run.real.name}, {run.mapped.mapper.spec.name}: {error}")
