"""The common part of experiments 4 and 5: a long drive that returns over known ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from albot_core.geometry.types import Points, Poses, Segments
from albot_core.mappers.mapper import CorrectedTrajectory, Mapper
from albot_core.maps.layers import OccupancyGridLayer
from albot_experiments.drawing import draw_map, draw_points, finish_maps
from albot_experiments.mapping import (
    ALBOT1,
    LARGEST_PATH_ERROR,
    LEAST_PRECISION,
    LEAST_RECALL,
    MAPPERS,
    WITHIN,
    Shape,
    Walls,
    is_kept,
    map_readings,
    shape_figures,
    shape_of,
    surface_points,
)
from albot_experiments.report import Figures, Report, compared, each_seed
from albot_experiments.tours import TourRecord, driven_tour, thinned_views
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WORLD, TOUR = "office-ring", "revisit"
HOME_ROOM = "P1"
"""The room in which the tour begins. Entering it again is revisiting."""
CORRIDOR = "P3"
"""A corridor with only two side walls."""
CORRIDOR_OFF = 0.1
"""Maximum error of the believed length of the corridor, as a share."""
_OCCUPIED = 0.5
"""Probability from which on a cell of a grid is a wall."""


@dataclass(frozen=True, kw_only=True)
class Spacing:
    """The distance between the views of a log."""

    distance: float
    """Distance between two views (m)."""
    turn: float
    """Turn between two views (rad); whichever comes first makes a view."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A mapper on one drive, and its map's shape before revisiting and at the end."""

    poses: Poses
    """(views, 3): the estimated poses, in the map's frame, as corrected at the end."""
    updates: int
    """Number of updates of the map."""
    before: int
    """The last view before the robot comes back into the room in which it began."""
    surfaces: Mapping[int, Segments]
    """The map's surfaces, by view; empty for a mapper with a grid."""
    cells: Points
    """(n, 2): the occupied cells of a mapper with a grid, at the end (m)."""
    shape_before: Shape | None
    """The shape before revisiting; None for a mapper with a grid, measured only at the end."""
    shape_after: Shape
    corridor: float | None
    """Ratio of believed to true length of the first way through the bare corridor; None without
    it."""

    @property
    def update_share(self) -> float:
        """The number of updates for each view."""
        return self.updates / len(self.poses)


@dataclass(frozen=True, kw_only=True)
class RevisitingExperiment:
    """The parameters of one such experiment."""

    id: str
    title: str
    paper: Mapping[str, Figures]
    """The thesis's figures."""
    conditions: Mapping[str, tuple[str, str]]
    """The thesis's conditions and ours."""
    most_updates: float
    """Maximum number of updates, as a share of the views."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drives:
    """All drives of an experiment."""

    world: World
    journeys: tuple[TourRecord, ...]
    """The journeys, one for each seed."""
    by_mapper: Mapping[str, tuple[Drive, ...]]
    """The drives of each mapper, one for each seed."""

    def keeps_shape(self, name: str) -> bool:
        """Return whether a mapper's shape is kept, in the median, before revisiting and after."""
        drives = self.by_mapper[name]
        before = [drive.shape_before for drive in drives if drive.shape_before is not None]
        lengths = [drive.corridor for drive in drives if drive.corridor is not None]
        is_long = not lengths or abs(np.median(lengths) - 1.0) <= CORRIDOR_OFF
        after = is_kept([drive.shape_after for drive in drives])
        return bool(is_long and after and (not before or is_kept(before)))

    def update_share(self, name: str) -> float:
        """Return a mapper's number of updates for each view, the median."""
        return float(np.median([drive.update_share for drive in self.by_mapper[name]]))

    def figures(self) -> dict[str, Figures]:
        """Return the reported figures, under the paper's names where it has any."""
        ours = self.by_mapper["albot1"]
        measured: dict[str, Figures] = {
            "path_m": round(float(np.median([each.path_length for each in self.journeys])), 1),
            "views": int(np.median([len(each.readings) for each in self.journeys])),
            "views_before": int(np.median([drive.before + 1 for drive in ours])),
            "updates": int(np.median([drive.updates for drive in ours])),
            "update_share": round(self.update_share("albot1"), 3),
            "shape_kept": self.keeps_shape("albot1"),
            "seeds": len(self.journeys),
        }
        return measured | {name: self.figures_of(name) for name in self.by_mapper}

    def figures_of(self, name: str) -> dict[str, Figures]:
        """Return the figures of one mapper."""
        drives = self.by_mapper[name]
        before = [drive.shape_before for drive in drives if drive.shape_before is not None]
        return {
            "updates": int(np.median([drive.updates for drive in drives])),
            "update_share": round(self.update_share(name), 3),
            "corridor_length": self.corridor_length(name),
            **(shape_figures(before, "before_") if before else {}),
            **shape_figures([drive.shape_after for drive in drives], "after_"),
            "shape_kept": self.keeps_shape(name),
        }

    def corridor_length(self, name: str) -> float | None:
        """Return the ratio of believed to true length of the bare corridor, the median."""
        lengths = [drive.corridor for drive in self.by_mapper[name] if drive.corridor is not None]
        return round(float(np.median(lengths)), 2) if lengths else None

    def picture(self) -> Figure:
        """Draw each mapper's map before and after, for the seed with albot1's median error."""
        from matplotlib.figure import Figure

        errors = [drive.shape_after.path_error for drive in self.by_mapper["albot1"]]
        middle = int(np.argsort(errors)[len(errors) // 2])
        figure = Figure(figsize=(4.4 * len(MAPPERS), 9.4), layout="constrained")
        for name, column in zip(MAPPERS, figure.subplots(2, len(MAPPERS)).T, strict=True):
            drive = self.by_mapper[name][middle]
            for axes, when in zip(column, ("before", "after"), strict=True):
                self._draw(axes, drive, when)
                axes.set_title(f"{name}, {when} revisiting:\n{axes.get_title()}")
        finish_maps(figure)
        return figure

    def _draw(self, axes: Axes, drive: Drive, when: str) -> None:
        view = drive.before if when == "before" else len(drive.poses) - 1
        shape = drive.shape_before if when == "before" else drive.shape_after
        assert shape is not None
        draw_map(axes, self.world, drive.surfaces[view], drive.poses[: view + 1], shape.frame)
        axes.set_title(f"path {shape.path_error:.2f} m off")

    def grid_picture(self, names: Sequence[str]) -> Figure:
        """Draw the maps of mappers with grids at the end, for the first seed."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(4.4 * len(names), 4.9), layout="constrained")
        for axes, name in zip(figure.subplots(1, len(names)), names, strict=True):
            drive = self.by_mapper[name][0]
            shape = drive.shape_after
            draw_points(axes, self.world, drive.cells, drive.poses, shape.frame)
            axes.set_title(f"{name}: path {shape.path_error:.2f} m off")
        finish_maps(figure)
        return figure


def reached(drives: Drives, experiment: RevisitingExperiment) -> dict[str, bool]:
    """Return whether each of Albot1's mappers keeps the shape with few enough updates."""
    return {
        name: drives.keeps_shape(name) and drives.update_share(name) <= experiment.most_updates
        for name in ALBOT1
    }


def report_on(experiment: RevisitingExperiment, drives: Drives, text: str) -> Report:
    """Return the report on the shape of each mapper's map."""
    verdicts = reached(drives, experiment)
    measured = drives.figures()
    return Report(
        id=experiment.id,
        title=experiment.title,
        paper=experiment.paper,
        measured=measured,
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared=compared(
            measured,
            MAPPERS,
            ("after_path_error_m", "after_wall_precision", "after_wall_recall", "corridor_length"),
        ),
        conditions=experiment.conditions,
        text=text,
        pictures={"maps": drives.picture()},
    )


def drive(
    spacing: Spacing,
    seeds: range,
    progress: Callable[[int], None],
    names: Sequence[str] = MAPPERS,
) -> Drives:
    """Drive the tour, once per seed, and map it with every mapper.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    journeys = []
    by_mapper: dict[str, list[Drive]] = {name: [] for name in names}
    for seed in each_seed(seeds, progress):
        ridden = driven_tour(world, world.tours[TOUR], np.random.default_rng(seed))
        journey = thinned_views(ridden, spacing.distance, spacing.turn)
        for name in names:
            by_mapper[name].append(map_drive(name, world, journey))
        journeys.append(journey)
    return Drives(
        world=world,
        journeys=tuple(journeys),
        by_mapper={name: tuple(drives) for name, drives in by_mapper.items()},
    )


def map_drive(name: str, world: World, journey: TourRecord, config: object = None) -> Drive:
    """Map a drive, and measure the shape before revisiting and at the end."""
    before, last = before_revisiting(world, journey), len(journey.readings) - 1
    mapped = map_readings(name, journey.readings, [before], config=config)
    poses = final_poses(mapped.mapper, mapped.poses)
    cells = occupied_cells(mapped.mapper)
    shapes: dict[int, Shape] = {}
    for view in (last,) if len(cells) else (before, last):
        readings, truth = journey.readings[: view + 1], journey.truth[: view + 1]
        walls = Walls.of_journey(world.walls, readings, truth)
        points = cells if len(cells) else surface_points(mapped.surfaces[view])
        shapes[view] = shape_of(points, poses[: view + 1], truth, walls)
    return Drive(
        poses=poses,
        updates=int(mapped.updates[-1]),
        before=before,
        surfaces=mapped.surfaces,
        cells=cells,
        shape_before=shapes.get(before),
        shape_after=shapes[last],
        corridor=corridor_length(world, journey, poses),
    )


def final_poses(mapper: Mapper, believed: Poses) -> Poses:
    """Return the poses corrected at the end, if the mapper corrects them; else those believed."""
    return mapper.corrected_poses() if isinstance(mapper, CorrectedTrajectory) else believed


def occupied_cells(mapper: Mapper) -> Points:
    """Return the occupied cells of a mapper's grid, (n, 2) (m); none without a grid."""
    grid = mapper.snapshot().layer(OccupancyGridLayer)
    return np.empty((0, 2)) if grid is None else grid.centres(_OCCUPIED)


def corridor_length(world: World, journey: TourRecord, poses: Poses) -> float | None:
    """Return the ratio of believed to true length of the first way through the bare corridor.

    None if there is no such way.
    """
    inside = np.array([world.room_at(x, y) == CORRIDOR for x, y in journey.truth[:, :2]])
    if not inside.any():
        return None
    first = int(inside.argmax())
    last = first + int((~np.append(inside[first:], False)).argmax()) - 1
    believed, true = (np.hypot(*(way[last] - way[first])[:2]) for way in (poses, journey.truth))
    return float(believed / true) if true > 0 else None


def before_revisiting(world: World, journey: TourRecord) -> int:
    """Return the last view before the robot returns into the room in which it began."""
    inside = np.array([world.room_at(x, y) == HOME_ROOM for x, y in journey.truth[:, :2]])
    back = np.flatnonzero(~inside[:-1] & inside[1:])
    return int(back[0]) if len(back) else len(inside) - 1


def criterion(seeds: range, most_updates: float) -> str:
    """Return the criterion for the shape, as text for the reports."""
    return f"""\
The map is laid on the floor by the rigid motion that brings the believed path nearest to the true
one. *Before* is the last view before the robot comes back into the room in which it began,
*after* the last of all.

- `wall_precision`: share of the length of what a map remembers that lies within {WITHIN} m of a
  wall; `wall_recall`: share of the length of the walls seen until then that it holds as near.
- `path_error_m`: root mean square distance of the believed path to the true one.
- `corridor_length`: how long a mapper believes the bare corridor to be, to its true length.

Medians and worst over the seeds {seeds.start} to {seeds.stop - 1}. A mapper reaches it if in the
median, before and after, precision is at least {LEAST_PRECISION} and recall {LEAST_RECALL}, the
path at most {LARGEST_PATH_ERROR} m off and the corridor within {CORRIDOR_OFF:.0%} of its length,
and if it updates its map at no more than {most_updates:.0%} of the views. Places are left out
(chapter 4): no exit forces an update."""
