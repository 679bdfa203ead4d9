"""Experiment 6 of the Albot1 thesis: logs of other robots (section 3.2.6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

from albot_core.errors import InputError
from albot_core.evaluation.map_quality import (
    mean_map_entropy,
    precision_and_recall,
    scan_cloud,
)
from albot_core.evaluation.trajectory import (
    RelationError,
    Trajectory,
    relation_error,
    trajectory_error,
)
from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.logs.log import Log, with_noise
from albot_experiments.drawing import FLOOR, PATH, SURFACE, draw_floor, finish_maps
from albot_experiments.mapping import (
    ALBOT1,
    LARGEST_PATH_ERROR,
    MAPPERS,
    WITHIN,
    MappedJourney,
    map_readings,
    median_and_worst,
    surface_points,
)
from albot_experiments.real_logs import LOGS, KnownLog, RealLog, read_real_log
from albot_experiments.report import Figures, Report, compared

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "albot1-e6"
TITLE = "Public logs (Hossain 2014, section 3.2.6, figure 3.29)"
PAPER = {"logs": 1, "reasonable_shape": True}
CONDITIONS = {
    "environment": ("one public log of a large corridor, not named", "five public logs"),
    "robot": ("as recorded", "as recorded"),
    "laser": ("as recorded", "as recorded"),
    "odometer": ("as recorded", "as recorded; also with small noise added, by seed"),
    "movement": ("continuous", "continuous"),
    "trials": ("one log", "five logs, 20 seeds"),
    "judged by": ("eye, beside GMapping's map", "the references' walls, paths and relations"),
}
LARGEST_TRANSLATION, LARGEST_ROTATION = 0.22, np.radians(1.7)
"""A map has a reasonable shape only if its mean errors against the true relations are at most these
(m, rad), which Kümmerle et al. 2009 measure of scan matching on Intel."""
LEAST_HALF = 0.5
"""…and if at least this share of its surfaces is right, which means that their median distance from
the walls is below WITHIN. It is less than in the simulator, because the references are themselves
off by a decimetre."""
_DOUBLED = 3.0
"""Maximum distance between a wall and its double (m)."""
_CELL = 0.1
"""Reference walls are thinned to one point for each square of this side (m), to weigh all alike."""
_DRAWN = 15_000
"""Number of points of a reference map in the picture."""


@dataclass(frozen=True, kw_only=True)
class WallErrors:
    """Errors of a map's walls relative to the reference's, as shares of wall length."""

    precision: float
    """Share of the map's walls within WITHIN of a true wall."""
    recall: float
    """Share of the reference's walls within WITHIN of the map's."""
    doubled: float
    """Share of the map's walls that double a true wall which the map also holds in its place."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A mapper on a log."""

    real: RealLog
    known: KnownLog
    mapped: MappedJourney
    frame: Pose
    """The pose of the map's frame on the floor."""
    walls: tuple[WallErrors, ...]
    """The errors on the log as it is and, if the true path is known, on copies with added noise."""
    path_errors: tuple[float, ...]
    """The ATE (m) on the same logs; empty if the true path is not known."""
    relations: RelationError | None

    @property
    def reasonable(self) -> bool:
        """Whether the shape is reasonable, in the median, by all that is known of the truth."""
        relations = self.relations
        return bool(
            np.median([each.precision for each in self.walls]) >= LEAST_HALF
            and (not self.path_errors or np.median(self.path_errors) <= LARGEST_PATH_ERROR)
            and (relations is None or relations.translation_mean <= LARGEST_TRANSLATION)
            and (relations is None or relations.rotation_mean <= LARGEST_ROTATION)
        )


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Map each log as it is, and once per seed with a little noise added.

    Raises:
        InputError: No seeds, or no folder of real logs.
    """
    if not len(seeds):
        raise InputError("seeds", "at least one", "none")
    runs = []
    for done, real in enumerate(LOGS, start=1):
        known = read_real_log(real)
        generators = [np.random.default_rng(seed) for seed in seeds]
        # Without a true path no errors are measured on them.
        noisy = [with_noise(known.log, rng) for rng in generators if known.truth is not None]
        runs += [map_log(name, real, known, noisy) for name in MAPPERS]
        progress(done * len(seeds) // len(LOGS))
    return _report(seeds, runs)


def map_log(name: str, real: RealLog, known: KnownLog, noisy: list[Log]) -> Run:
    """Run a mapper on a log and its noisy copies, and compare the maps with the truth."""
    mapped, believed = _follow(name, known.log)
    surfaces = mapped.mapper.snapshot().segments
    frame = known.frame_of(believed, surfaces)
    reference = thinned(known.floor)
    walls = [wall_errors(surfaces, frame, reference)]
    errors = [_path_error(believed, known)]
    for log in noisy:
        again, believed_again = _follow(name, log)
        surfaces = again.mapper.snapshot().segments
        walls.append(wall_errors(surfaces, known.frame_of(believed_again, surfaces), reference))
        errors.append(_path_error(believed_again, known))
    return Run(
        real=real,
        known=known,
        mapped=mapped,
        frame=frame,
        walls=tuple(walls),
        path_errors=tuple(error for error in errors if error is not None),
        relations=relation_error(believed, known.relations) if known.relations else None,
    )


def _follow(name: str, log: Log) -> tuple[MappedJourney, Trajectory]:
    mapped = map_readings(name, log.readings)
    return mapped, Trajectory(stamps=log.stamps, poses=mapped.poses)


def _path_error(believed: Trajectory, known: KnownLog) -> float | None:
    error = None if known.truth is None else trajectory_error(believed, known.truth)
    return None if error is None else error.rmse


def thinned(points: Float64[np.ndarray, "points 2"]) -> Float64[np.ndarray, "thinned 2"]:
    """Return one of the points for each square of _CELL, so that their number measures length."""
    _, first = np.unique(np.floor(points / _CELL).astype(np.int64), axis=0, return_index=True)
    return np.asarray(points[first])


def wall_errors(surfaces: Segments, frame: Pose, reference: Points) -> WallErrors:
    """Compare a map's surfaces, placed by `frame`, with the points of the true walls (m)."""
    points = transform_points(frame, surface_points(surfaces))
    precision, recall = precision_and_recall(points, reference, reference, WITHIN)
    doubled = 0.0
    if len(points):
        away, nearest = KDTree(reference).query(points)
        beside = (away > WITHIN) & (away <= _DOUBLED)
        is_held = KDTree(points).query(reference[nearest])[0] <= WITHIN
        doubled = float((beside & is_held).mean())
    return WallErrors(precision=precision, recall=recall, doubled=doubled)


def _report(seeds: range, runs: list[Run]) -> Report:
    by_mapper = {
        name: [run for run in runs if run.mapped.mapper.spec.name == name] for name in MAPPERS
    }
    verdicts = {name: all(run.reasonable for run in by_mapper[name]) for name in ALBOT1}
    measured: dict[str, Figures] = {
        "logs": len(by_mapper["albot1"]),
        "reasonable_shape": verdicts["albot1"],
        "logs_reasonable": sum(run.reasonable for run in by_mapper["albot1"]),
        "seeds": len(seeds),
    }
    by_log: dict[str, dict[str, Figures]] = {}
    for run in runs:
        by_log.setdefault(run.real.name, {})[run.mapped.mapper.spec.name] = _figures(run)
    for log, groups in by_log.items():
        measured |= {f"{log}, {name}": figures for name, figures in groups.items()}
    names = "path_error_m", "wall_precision", "wall_recall", "doubled_walls", "reasonable_shape"
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared={
            f"{log}, {name}": by_name
            for log, groups in by_log.items()
            for name, by_name in compared(groups, MAPPERS, names).items()
        },
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"maps": _picture(runs)},
    )


def _figures(run: Run) -> dict[str, Figures]:
    log, relations = run.known.log, run.relations
    lasers = [reading.required_laser("map entropy") for reading in log.readings]
    errors = run.path_errors
    return {
        "path_m": round(log.path_length, 1),
        "views": len(log.readings),
        "updates": int(run.mapped.updates[-1]),
        "path_error_m": median_and_worst(errors) if errors else None,
        "path_error_undisturbed_m": _rounded(errors[0]) if errors else None,
        "relations_translation_m": _rounded(relations.translation_mean) if relations else None,
        "relations_rotation_deg": (
            _rounded(np.degrees(relations.rotation_mean)) if relations else None
        ),
        "wall_precision": median_and_worst([each.precision for each in run.walls], 2, min),
        "wall_recall": median_and_worst([each.recall for each in run.walls], 2, min),
        "doubled_walls": median_and_worst([each.doubled for each in run.walls], 2),
        "map_entropy": _rounded(mean_map_entropy(scan_cloud(lasers, run.mapped.poses))),
        "reasonable_shape": run.reasonable,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 3)


def _text(seeds: range) -> str:
    return f"""
The thesis maps one public log and finds its shape reasonable. Here it is five: Intel Research
Lab, ACES in Austin, Freiburg building 101, and two of Wean Hall, raw odometer and laser. `albot1`
was developed on them, on Intel and Wean Hall above all: none of its figures here is of a log that
nobody tuned on. `albot1-tracked` and `albot1-thesis` have nothing that was tuned on any.

- `path_error_m`: root mean square distance of the believed path to the reference's after rigid
  alignment (ATE): median and worst of the log as it is and of {len(seeds)} runs with a little noise
  added (5 mm on ranges, 3 mm and 0.1° on motions), for one log is one draw; *undisturbed*: without.
- `relations_…`: mean errors against the published true relations, at the stamps that match.
- `wall_precision`: share of the length of what the map remembers that lies within {WITHIN} m of a
  wall of the reference: the scans laid where the reference has the robot, or, for Wean Hall, the
  faces of the walls of the building's map (cells of 10 cm), on which the map is laid as it fits
  best. `wall_recall`: share of the reference's walls that the map holds as near; the reference
  holds all that was ever seen, people too, and of Wean Hall the whole building, so no bar is set.
- `doubled_walls`: share of the map that stands beside a wall, up to {_DOUBLED:.0f} m away, which
  the map holds in its place as well: walls seen again after the map had drifted.
- `map_entropy`: lower is sharper; it needs no reference.

A shape counts as reasonable where half of the map or more is right, the path error, if the path is
known, is at most {LARGEST_PATH_ERROR} m, both in the median, and the relations, if there are any,
are off by at most {LARGEST_TRANSLATION} m and {np.degrees(LARGEST_ROTATION):.1f}°: the errors that
Kümmerle et al. 2009 measure of plain scan matching on Intel. A mapper reaches it if that is so on
all logs.

No mapper here closes loops. On ACES, whose corridors are walked round several times, walls seen
again after a hundred metres stand beside themselves: `doubled_walls` says how many.
"""


def _picture(runs: list[Run]) -> Figure:
    """Draw all maps, with a column for each log and a row for each mapper."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(20, 3.9 * len(MAPPERS)), layout="constrained")
    grid = figure.subplots(len(MAPPERS), len(LOGS))
    for axes, run in zip(grid.T.ravel(), runs, strict=True):
        _draw(axes, run)
    finish_maps(figure)
    return figure


def _draw(axes: Axes, run: Run) -> None:
    floor = run.known.floor
    axes.plot(
        *floor[:: -(-len(floor) // _DRAWN)].T,
        ".",
        color=FLOOR,
        ms=1,
        label="the log's corrected scans",
    )
    surfaces = transform_segments(run.frame, run.mapped.mapper.snapshot().segments)
    draw_floor(axes, surfaces, SURFACE, label="surfaces of the map")
    axes.plot(
        *compose(run.frame, run.mapped.poses)[:, :2].T, color=PATH, lw=0.5, label="estimated path"
    )
    axes.set_title(
        f"{run.real.name}, {run.mapped.mapper.spec.name}:\n{run.walls[0].precision:.0%} of it right"
    )
