"""The global map by landmark association and by plain integration of views (Yeap et al. 2015)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from albot_core.geometry.types import Poses, Segments
from albot_env.sim.laser import LASERS
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator, StartStop, follow_leg
from albot_experiments.drawing import draw_map, finish_maps
from albot_experiments.mapping import (
    Shape,
    Walls,
    map_readings,
    median_and_worst,
    shape_of,
    surface_points,
)
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import TourRecord, lead
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "association-1"
TITLE = "The map produced (Yeap et al. 2015, figure 7)"
WORLD, TOUR, BEYOND = "office-ring", "single-loop", 6
"""The tour: once round, clockwise, and BEYOND waypoints further."""
STEPS = StartStop(move=3.0, turn=np.radians(30.0))
"""Maximum drive and turn from view to view, as the paper's."""
LASER = "lms-200-fine"
"""361 beams at 0.5°, as the paper's."""
DRIFTS = ("pioneer", "poor", "albot1-disturbed")
"""The odometers."""
MAPPERS = ("association", "odometry", "albot1-thesis")
PAPER = {"path_m": 130.0, "views": 103, "shape_kept": True}
RATIO = 5.0
"""The shape is kept if the path error of plain integration is at least this many times as large."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A mapper at the end of a journey."""

    surfaces: Segments
    """The map's surfaces, in the map's frame (m)."""
    poses: Poses
    """(views, 3): the estimated pose at every view."""
    shape: Shape
    """The errors of the map."""


Runs = Mapping[str, Run]
"""The mappers on one journey, by their names."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Lead the robot round once per seed and odometer, and map the readings.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    journeys = []
    runs: dict[str, list[Runs]] = {odometer: [] for odometer in DRIFTS}
    for seed in each_seed(seeds, progress):
        for odometer in DRIFTS:
            journey = drive(world, odometer, seed)
            journeys.append(journey)
            runs[odometer].append({name: follow(name, journey, world) for name in MAPPERS})
    return _report(seeds, journeys, runs)


def drive(world: World, odometer: str, seed: int) -> TourRecord:
    """Lead a robot with an odometer along the tour; return the journey."""
    tour = world.tours[TOUR]
    waypoints = np.concatenate((tour, tour[1 : BEYOND + 1]))
    sensors = Sensors(laser=LASERS[LASER], odometer=ODOMETERS[odometer])
    simulator = Simulator(world, sensors=sensors)
    go_to = partial(follow_leg, simulator, steps=STEPS)
    return lead(simulator, world, waypoints, np.random.default_rng(seed), go_to)


def follow(name: str, journey: TourRecord, world: World) -> Run:
    """Run a mapper on a journey, and measure its map."""
    mapped = map_readings(name, journey.readings)
    surfaces = mapped.mapper.snapshot().segments
    walls = Walls.of_journey(world.walls, journey.readings, journey.truth)
    shape = shape_of(surface_points(surfaces), mapped.poses, journey.truth, walls)
    return Run(surfaces=surfaces, poses=mapped.poses, shape=shape)


def _report(seeds: range, journeys: list[TourRecord], runs: Mapping[str, list[Runs]]) -> Report:
    measured: dict[str, Figures] = {
        "path_m": round(float(np.median([journey.path_length for journey in journeys])), 1),
        "views": int(np.median([len(journey.readings) for journey in journeys])),
        "seeds": len(seeds),
    }
    ratios = {odometer: _ratio(runs[odometer]) for odometer in DRIFTS}
    measured["shape_kept"] = all(ratio >= RATIO for ratio in ratios.values())
    for odometer in DRIFTS:
        figures: dict[str, Figures] = {"ratio": round(ratios[odometer], 1)}
        for name in MAPPERS:
            shapes = [run[name].shape for run in runs[odometer]]
            key = name.replace("-", "_")
            figures[f"{key}_path_error_m"] = median_and_worst([s.path_error for s in shapes], 2)
            figures[f"{key}_surface_error_m"] = median_and_worst(
                [s.surface_error for s in shapes], 2
            )
        figures["association_surfaces"] = int(
            np.median([len(run["association"].surfaces) for run in runs[odometer]])
        )
        measured[odometer] = figures
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=bool(measured["shape_kept"]),
        text=_text(seeds),
        pictures={"maps": _picture(runs)},
    )


def _ratio(runs: list[Runs]) -> float:
    """Return the ratio of the path errors by plain integration and by association, the median."""
    return float(
        np.median(
            [run["odometry"].shape.path_error / run["association"].shape.path_error for run in runs]
        )
    )


def _text(seeds: range) -> str:
    return f"""
A robot is led start-stop, {STEPS.move:g} m or 30° at a time, clockwise round the corridors of
`{WORLD}`, an office of 30 x 30 m, and on by a third of the way, so that it comes by its first views
again. Its laser has 361 beams at 0.5°, as the paper's. The same journeys are mapped by landmark
association, by plain integration of views (`odometry`) and by `albot1-thesis`. Medians and worst
over the seeds {seeds.start} to {seeds.stop - 1}, with three odometers.

The path error is the root of the mean squared distance from the believed path to the true one,
after a rigid alignment: it is the error of the map's shape. (The surface error, the median distance
of surfaces to the nearest wall, hardly sees it: there is a wall nearby wherever a surface lies.)
`ratio` is the path error of `odometry` by that of `association`, the median over the seeds; the
shape is kept where it is {RATIO:g} at least with each odometer. The paper shows two maps and gives
no figure.

With `association` the odometer's errors do not add up: known surfaces tell the direction, and where
one crosses another they tell how far the robot has come along that. Each link from a landmark to a
new surface adds an error of its own. The robot's steps are the longest of the paper's, which took
103 views of its 130 m; ours are more, as all turns are made on the spot. The picture shows the
first seed.
"""


def _picture(runs: Mapping[str, list[Runs]]) -> Figure:
    """Draw figure 7 for each odometer: the map by each mapper."""
    from matplotlib.figure import Figure

    world = load_world(WORLD)
    figure = Figure(figsize=(15, 15), layout="constrained")
    grid = figure.subplots(len(DRIFTS), len(MAPPERS))
    for row, odometer in zip(grid, DRIFTS, strict=True):
        for axes, name in zip(row, MAPPERS, strict=True):
            run = runs[odometer][0][name]
            draw_map(axes, world, run.surfaces, run.poses, run.shape.frame)
            axes.set_title(f"{name}, odometer {odometer}: {run.shape.path_error:.2f} m")
    finish_maps(figure)
    return figure
