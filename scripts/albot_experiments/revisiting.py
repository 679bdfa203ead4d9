"""What experiments 4 and 5 share: a long drive that comes back over known ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from albot_experiments.drawing import draw_map
from albot_experiments.mapping import (
    MAPPERS,
    SHAPE_BOUND,
    MappedJourney,
    Shape,
    map_readings,
    median_and_worst,
    shape_of,
)
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import Journey, driven_tour, thinned_views
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WORLD, TOUR = "office-ring", "revisit"
HOME_ROOM = "P1"
"""The room in which the tour begins. To come back into it is to revisit."""
CORRIDOR = "P3"
"""A corridor with two side walls only."""


@dataclass(frozen=True, kw_only=True)
class Spacing:
    """How far apart the views of a log are."""

    distance: float
    """Way from view to view (m)."""
    turn: float
    """Or the turn, whichever comes first (rad)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A mapper on one drive, and its map's shape before revisiting and at the end."""

    mapped: MappedJourney
    before: int
    """The last view before the robot comes back into the room in which it began."""
    shape_before: Shape
    shape_after: Shape
    corridor: float | None
    """Believed over true length of the first way through the bare corridor; None without."""

    @property
    def update_share(self) -> float:
        """Updates for each view."""
        return float(self.mapped.updates[-1] / len(self.mapped.updates))


@dataclass(frozen=True, kw_only=True, eq=False)
class Drives:
    """All drives of an experiment."""

    world: World
    journeys: tuple[Journey, ...]
    """One for each seed."""
    by_mapper: Mapping[str, tuple[Drive, ...]]
    """A drive for each seed."""

    def keeps_shape(self, name: str) -> bool:
        """Whether a mapper's shape is kept, in the median, both before revisiting and after."""
        drives = self.by_mapper[name]
        before = np.median([drive.shape_before.surface_error for drive in drives])
        after = np.median([drive.shape_after.surface_error for drive in drives])
        return bool(max(before, after) <= SHAPE_BOUND)

    def update_share(self, name: str) -> float:
        """A mapper's updates for each view; the median."""
        return float(np.median([drive.update_share for drive in self.by_mapper[name]]))

    def figures(self) -> dict[str, Figures]:
        """What is reported, under the paper's names where it has any."""
        ours = self.by_mapper["albot1"]
        measured: dict[str, Figures] = {
            "path_m": round(float(np.median([each.path_length for each in self.journeys])), 1),
            "views": int(np.median([len(each.readings) for each in self.journeys])),
            "views_before": int(np.median([drive.before + 1 for drive in ours])),
            "updates": int(np.median([drive.mapped.updates[-1] for drive in ours])),
            "update_share": round(self.update_share("albot1"), 3),
            "shape_kept": self.keeps_shape("albot1"),
            "seeds": len(self.journeys),
        }
        return measured | {name: _mapper_figures(drives) for name, drives in self.by_mapper.items()}

    def picture(self) -> Figure:
        """Each mapper's map before and after, of the seed with albot1's median error."""
        from matplotlib.figure import Figure

        errors = [drive.shape_after.surface_error for drive in self.by_mapper["albot1"]]
        middle = int(np.argsort(errors)[len(errors) // 2])
        figure = Figure(figsize=(14, 9.8), layout="constrained")
        for name, column in zip(MAPPERS, figure.subplots(2, 3).T, strict=True):
            drive = self.by_mapper[name][middle]
            last = len(drive.mapped.poses) - 1
            rows = ((drive.before, drive.shape_before), (last, drive.shape_after))
            for axes, when, (view, shape) in zip(column, ("before", "after"), rows, strict=True):
                draw_map(
                    axes,
                    self.world,
                    drive.mapped.surfaces[view],
                    drive.mapped.poses[: view + 1],
                    shape.frame,
                )
                axes.set_title(f"{name}, {when} revisiting: {shape.surface_error:.2f} m")
        return figure


@dataclass(frozen=True, kw_only=True)
class RevisitingExperiment:
    """What sets one such experiment apart from another."""

    id: str
    title: str
    paper: Mapping[str, Figures]
    """The thesis's figures."""
    spacing: Spacing
    """How far apart the views are."""
    most_updates: float
    """The map is to be updated at no larger share of the views."""


def run_drives(
    experiment: RevisitingExperiment, seeds: range, progress: Callable[[int], None], text: str
) -> Report:
    """Drive the tour, once a seed, and report on the shape that each mapper's map has.

    Raises:
        InputError: No seeds.
    """
    drives = drive(experiment.spacing, seeds, progress)
    few = drives.update_share("albot1") <= experiment.most_updates
    return Report(
        id=experiment.id,
        title=experiment.title,
        paper=experiment.paper,
        measured=drives.figures(),
        holds=drives.keeps_shape("albot1") and few,
        text=text,
        pictures={"maps": drives.picture()},
    )


def drive(spacing: Spacing, seeds: range, progress: Callable[[int], None]) -> Drives:
    """Drive the tour, once a seed, and map it with every mapper.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    journeys = []
    by_mapper: dict[str, list[Drive]] = {name: [] for name in MAPPERS}
    for seed in each_seed(seeds, progress):
        ridden = driven_tour(world, world.tours[TOUR], np.random.default_rng(seed))
        journey = thinned_views(ridden, spacing.distance, spacing.turn)
        for name in MAPPERS:
            by_mapper[name].append(map_drive(name, world, journey))
        journeys.append(journey)
    return Drives(
        world=world,
        journeys=tuple(journeys),
        by_mapper={name: tuple(drives) for name, drives in by_mapper.items()},
    )


def map_drive(name: str, world: World, journey: Journey) -> Drive:
    """Map a drive and measure the shape before revisiting and at the end."""
    before = before_revisiting(world, journey)
    mapped = map_readings(name, journey.readings, [before])
    shapes = [
        shape_of(surfaces, mapped.poses[: view + 1], journey.truth[: view + 1], world.walls)
        for view, surfaces in mapped.surfaces.items()
    ]
    return Drive(
        mapped=mapped,
        before=before,
        shape_before=shapes[0],
        shape_after=shapes[-1],
        corridor=_corridor_length(world, journey, mapped),
    )


def _corridor_length(world: World, journey: Journey, mapped: MappedJourney) -> float | None:
    inside = np.array([world.room_at(x, y) == CORRIDOR for x, y in journey.truth[:, :2]])
    if not inside.any():
        return None
    first = int(inside.argmax())
    last = first + int((~np.append(inside[first:], False)).argmax()) - 1
    believed, true = (
        np.hypot(*(poses[last] - poses[first])[:2]) for poses in (mapped.poses, journey.truth)
    )
    return float(believed / true)


def before_revisiting(world: World, journey: Journey) -> int:
    """The last view before the robot comes back into the room that it began in."""
    inside = np.array([world.room_at(x, y) == HOME_ROOM for x, y in journey.truth[:, :2]])
    back = np.flatnonzero(~inside[:-1] & inside[1:])
    return int(back[0]) if len(back) else len(inside) - 1


def _mapper_figures(drives: tuple[Drive, ...]) -> dict[str, Figures]:
    before = [drive.shape_before for drive in drives]
    after = [drive.shape_after for drive in drives]
    lengths = [drive.corridor for drive in drives if drive.corridor is not None]
    return {
        "updates": int(np.median([drive.mapped.updates[-1] for drive in drives])),
        "update_share": round(float(np.median([drive.update_share for drive in drives])), 3),
        "corridor_length": round(float(np.median(lengths)), 2) if lengths else None,
        "before_surface_error_m": median_and_worst([shape.surface_error for shape in before]),
        "after_surface_error_m": median_and_worst([shape.surface_error for shape in after]),
        "before_path_error_m": median_and_worst([shape.path_error for shape in before]),
        "after_path_error_m": median_and_worst([shape.path_error for shape in after]),
    }
