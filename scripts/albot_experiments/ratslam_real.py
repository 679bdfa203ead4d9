"""RatSLAM with a laser on logs of real robots, beside the odometer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

from albot_core.evaluation.map_quality import scan_cloud
from albot_core.evaluation.registration import register
from albot_core.evaluation.trajectory import Trajectory, alignment, trajectory_error
from albot_core.geometry.poses import compose, relative, transform_points
from albot_core.geometry.types import Pose, Poses
from albot_core.logs.log import Log
from albot_core.mappers.mapper import CorrectedTrajectory, PlaceMemory, require
from albot_core.mappers.registry import make_mapper
from albot_core.maps.layers import PlaceGraph
from albot_experiments.drawing import FLOOR, MARK, PATH, SURFACE, finish_maps
from albot_experiments.mapping import median_and_worst
from albot_experiments.real_logs import LOGS, KnownLog, RealLog, read_real_log
from albot_experiments.report import Figures, Report, each_seed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "ratslam-real"
TITLE = "Real logs with a laser (as in Milford et al. 2005, section 6)"
PAPER = {"human_friendly_map": True}
BOUNDS = {"Intel": 2.0, "Freiburg 101": 1.0}
"""Largest accepted error of the corrected path of a log (m)."""
SCALE, TURN, WANDER = 0.1, 0.1, np.radians((1.0, 0.5))
"""Disturbed odometers: distances and turns are too long or too short by up to these shares;
headings drift by up to this much (rad/m), with this much noise per motion (rad, standard
deviation)."""
CONDITIONS = {
    "environment": (
        "an open plan office of 80 m²: desks, chairs, fridges, doors",
        "Intel Research Lab, ACES in Austin, Freiburg building 101, Wean Hall (two logs)",
    ),
    "duration": ("15 min", "the whole logs, 209 to 501 m where the path is known"),
    "speed": ("not given", "that of the logs"),
    "way": (
        "an exploration algorithm that tries every possible route",
        "that of the logs",
    ),
    "sensors": (
        "a camera of 50° and wheel encoders on a Pioneer 2DXE, 7 Hz",
        "a laser of 180° and wheel encoders; the logs hold no pictures",
    ),
    "errors": (
        "those of the real robot",
        "those of the real robots; then odometers disturbed in scale, turn and bias",
    ),
    "trials": ("one run shown", "one run a log, and one a seed and log with disturbed odometers"),
}
_DRAWN = 12_000
"""Largest number of points of a map in the picture."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """RatSLAM at the end of a log."""

    real: RealLog
    known: KnownLog
    poses: Poses
    """The corrected path."""
    graph: PlaceGraph
    """The experience map."""
    relocalisations: int
    error: float | None
    """Error of the corrected path (m; the ATE); None if the ground truth is unknown."""
    odometer_error: float | None
    wall_error: float
    """Median distance of the scans, placed along the corrected path, from the walls (m)."""
    odometer_wall_error: float
    disturbed: tuple[float, ...]
    """Errors of the corrected path with disturbed odometers (m)."""
    odometer_disturbed: tuple[float, ...]
    """Errors of these odometers themselves (m)."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Map each log as it is; if its truth is known, also once per seed with a disturbed odometer.

    Raises:
        InputError: No seeds, or no folder of real logs.
    """
    logs = [(real, read_real_log(real)) for real in LOGS]
    errors: dict[str, list[tuple[float, float]]] = {real.name: [] for real in LOGS}
    for seed in each_seed(seeds, progress):
        for number, (real, known) in enumerate(logs):
            if known.truth is not None:
                log = disturbed(known.log, np.random.default_rng((seed, number)))
                found = path_error(log, follow(log)[0], known), odometer_error(log, known)
                errors[real.name].append((found[0] or 0.0, found[1] or 0.0))
    return _report(seeds, [map_log(real, known, errors[real.name]) for real, known in logs])


def disturbed(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of a log whose odometer measures distances and turns wrong."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    ways = np.hypot(motions[:, 0], motions[:, 1])
    bias, noise = WANDER * (rng.uniform(-1.0, 1.0), 1.0)
    motions[:, :2] *= rng.uniform(1.0 - SCALE, 1.0 + SCALE)
    motions[:, 2] *= rng.uniform(1.0 - TURN, 1.0 + TURN)
    motions[:, 2] += bias * ways + rng.normal(0.0, noise, len(motions)) * (ways > 0)
    poses = [log.odometry[0]]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    return replace(log, odometry=np.array(poses))


def follow(log: Log) -> tuple[Poses, PlaceGraph, int]:
    """Run RatSLAM on a log; return corrected path, experiences and number of re-localisations."""
    mapper = make_mapper("ratslam")
    for reading in log.readings:
        mapper.update(reading)
    graph = mapper.snapshot().place_graph
    assert graph is not None
    relocalisations = len(require(mapper, PlaceMemory).events)
    return require(mapper, CorrectedTrajectory).corrected_poses(), graph, relocalisations


def map_log(real: RealLog, known: KnownLog, errors: Sequence[tuple[float, float]]) -> Run:
    """Map a log as it is; `errors` are those of the disturbed runs and of their odometers."""
    poses, graph, relocalisations = follow(known.log)
    return Run(
        real=real,
        known=known,
        poses=poses,
        graph=graph,
        relocalisations=relocalisations,
        error=path_error(known.log, poses, known),
        odometer_error=odometer_error(known.log, known),
        wall_error=_wall_error(known, poses),
        odometer_wall_error=_wall_error(known, known.log.odometry),
        disturbed=tuple(ours for ours, _ in errors),
        odometer_disturbed=tuple(odometer for _, odometer in errors),
    )


def path_error(log: Log, poses: Poses, known: KnownLog) -> float | None:
    """Return the ATE of a path (m); None if the ground truth is unknown."""
    believed = Trajectory(stamps=log.stamps, poses=poses)
    error = None if known.truth is None else trajectory_error(believed, known.truth)
    return None if error is None else error.rmse


def odometer_error(log: Log, known: KnownLog) -> float | None:
    """Return the ATE of odometry alone (m); None if the ground truth is unknown."""
    return path_error(log, log.odometry, known)


def _cloud(known: KnownLog, poses: Poses) -> Float64[np.ndarray, "points 2"]:
    lasers = [reading.required_laser("scan cloud") for reading in known.log.readings]
    return np.asarray(scan_cloud(lasers, poses))


def _frame(known: KnownLog, poses: Poses) -> Pose:
    """Return the map's frame on the floor: by the two paths, or by how the scans fit the walls."""
    believed = Trajectory(stamps=known.log.stamps, poses=poses)
    frame = None if known.truth is None else alignment(believed, known.truth)
    return register(_cloud(known, poses), known.floor) if frame is None else frame


def _wall_error(known: KnownLog, poses: Poses) -> float:
    points = transform_points(_frame(known, poses), _cloud(known, poses))
    distances, _ = KDTree(known.floor).query(points)
    return float(np.median(distances))


def _report(seeds: range, runs: list[Run]) -> Report:
    reached = {
        run.real.name: run.error is not None and run.error <= BOUNDS[run.real.name]
        for run in runs
        if run.real.name in BOUNDS
    }
    is_friendly = all(run.wall_error <= 0.2 for run in runs)
    measured: dict[str, Figures] = {"human_friendly_map": is_friendly}
    measured |= {f"{name} within {BOUNDS[name]:g} m": holds for name, holds in reached.items()}
    measured["seeds"] = len(seeds)
    measured |= {run.real.name: _figures(run) for run in runs}
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=is_friendly and all(reached.values()),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"maps": _picture(runs)},
    )


def _figures(run: Run) -> dict[str, Figures]:
    return {
        "path_m": round(run.known.log.path_length, 1),
        "readings": len(run.known.log.readings),
        "experiences": len(run.graph.nodes),
        "transitions": len(run.graph.edges),
        "relocalisations": run.relocalisations,
        "odometer_error_m": _rounded(run.odometer_error),
        "error_m": _rounded(run.error),
        "disturbed_odometer_error_m": _spread(run.odometer_disturbed),
        "disturbed_error_m": _spread(run.disturbed),
        "odometer_wall_error_m": _rounded(run.odometer_wall_error),
        "wall_error_m": _rounded(run.wall_error),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 2)


def _spread(values: Sequence[float]) -> Figures:
    return median_and_worst(values, 2) if values else None


def _text(seeds: range) -> str:
    return f"""
The paper's robot drives through 80 m² of an office. Its log is not public, so these are those of
other robots: Intel Research Lab, ACES in Austin, Freiburg building 101, and two of Wean Hall.
`ratslam` runs with its default parameters on all. They were chosen on Intel and on simulated
offices; the other logs are test, but their figures had been seen by then. On ACES itself it was
found that robots come by known places for a few metres only, too few for views to re-localise
them as they did; how much views inject since was chosen on other disturbed copies of Intel.

- `error_m`: root mean square distance of the corrected path to the reference's after rigid
  alignment (ATE). At most {BOUNDS["Intel"]:g} m are asked of Intel, {BOUNDS["Freiburg 101"]:g} m
  of Freiburg 101. Wean Hall has no reference.
- *disturbed*: median and worst of {len(seeds)} runs whose odometers measure ways and turns up to
  {SCALE:.0%} too long or too short, turn in excess by up to {np.degrees(WANDER[0]):.0f}° a metre,
  and by {np.degrees(WANDER[1]):.1f}° of noise a motion.
- `wall_error_m`: median distance from the scans, laid along the corrected path, to the reference
  map: the scans along the reference path, or the building's map for Wean Hall, on which they are
  laid as they fit best. A map is human-friendly where it is at most 0.2 m.

The picture shows the reference map in grey, under it the scans along the corrected path, the
experiences and their transitions.
"""


def _picture(runs: list[Run]) -> Figure:
    """Draw a column for each log: along the odometer's path, and along the corrected one."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(20, 8), layout="constrained")
    grid = figure.subplots(2, len(runs))
    for (above, below), run in zip(grid.T, runs, strict=True):
        _draw(above, run, run.known.log.odometry, "odometer", run.odometer_error)
        frame = _draw(below, run, run.poses, "ratslam", run.error)
        places = {
            node.id: transform_points(frame, np.asarray(node.middle)) for node in run.graph.nodes
        }
        for edge in run.graph.edges:
            ends = np.array((places[edge.source], places[edge.target]))
            below.plot(*ends.T, color=PATH, lw=0.6, label="transitions")
        below.plot(
            *np.array(list(places.values())).T,
            ".",
            color=MARK,
            ms=2,
            ls="none",
            label="experiences",
        )
    finish_maps(figure)
    return figure


def _draw(axes: Axes, run: Run, poses: Poses, name: str, error: float | None) -> Pose:
    frame, floor = _frame(run.known, poses), run.known.floor
    cloud = transform_points(frame, _cloud(run.known, poses))
    axes.plot(
        *cloud[:: -(-len(cloud) // _DRAWN)].T,
        ".",
        color=SURFACE,
        ms=1,
        label="scans along the path",
    )
    axes.plot(
        *floor[:: -(-len(floor) // _DRAWN)].T,
        ".",
        color=FLOOR,
        ms=1,
        label="the log's corrected scans",
    )
    axes.set(aspect="equal", xticks=[], yticks=[])
    figure = "" if error is None else f": {error:.2f} m"
    axes.set_title(f"{run.real.name}, {name}{figure}")
    return frame
