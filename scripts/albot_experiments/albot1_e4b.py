"""The margin around a view within which the map is cleared before an update (section 3.2.4)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from albot_experiments.albot1_conditions import thesis_conditions
from albot_experiments.drawing import draw_map, finish_maps
from albot_experiments.mapping import (
    ALBOT1,
    CHAPTER_3,
    Walls,
    median_and_worst,
    shape_figures,
    surface_points,
)
from albot_experiments.report import Figures, Report, compared, each_seed
from albot_experiments.revisiting import TOUR, WORLD, Drive, map_drive
from albot_experiments.tours import driven_tour, thinned_views
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-e4b"
TITLE = "The deletion margin (Hossain 2014, section 3.2.4 and algorithm 3, line 9)"
PAPER: dict[str, Figures] = {
    "margin_m": 0.4,
    "too_little_leaves_ghosts": True,
    "too_much_forgets": True,
}
CONDITIONS = thesis_conditions(
    "`office-ring`",
    ("driven by hand, a view each 10 cm or 1°", "driven at 0.5 m/s, a view each 10 cm or 1°"),
    ("one margin, slightly larger than the view", "five margins, 20 seeds"),
)
MARGINS = (0.0, 0.2, 0.4, 0.8, 1.6)
"""Distances from a view's boundary within which a surface counts as inside (m)."""
THESIS_MARGIN = 0.4
SPACING, TURN = 0.1, np.radians(1.0)
"""Distance and turn between views, as in experiment 4 (m, rad)."""

Drives = dict[tuple[str, float], list[tuple[Drive, float]]]
"""By mapper and margin: for each seed the drive, and the wall held for each metre of wall seen."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive the tour of experiment 4, once per seed, and map it with every margin.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    drives: Drives = {(name, margin): [] for name in ALBOT1 for margin in MARGINS}
    for seed in each_seed(seeds, progress):
        ridden = driven_tour(world, world.tours[TOUR], np.random.default_rng(seed))
        journey = thinned_views(ridden, SPACING, TURN)
        seen = len(Walls.of_journey(world.walls, journey.readings, journey.truth).seen)
        for (name, margin), several in drives.items():
            drive = map_drive(name, world, journey, CHAPTER_3 | {"margin": margin})
            held = len(surface_points(drive.surfaces[len(drive.poses) - 1]))
            several.append((drive, held / seen))
    return _report(seeds, world, drives)


def _report(seeds: range, world: World, drives: Drives) -> Report:
    groups: dict[str, Figures] = {
        f"{name}, {margin} m": _figures(drives[name, margin])
        for name in ALBOT1
        for margin in MARGINS
    }
    effects = {name: (_leaves_ghosts(drives, name), _forgets(drives, name)) for name in ALBOT1}
    verdicts = {name: all(both) for name, both in effects.items()}
    at_thesis: dict[str, Figures] = {
        name: {
            "too_little_leaves_ghosts": effects[name][0],
            "too_much_forgets": effects[name][1],
            "most_precise_margin_m": _best(drives, name),
        }
        for name in ALBOT1
    }
    names = "too_little_leaves_ghosts", "too_much_forgets", "most_precise_margin_m"
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={
            "margin_m": THESIS_MARGIN,
            "too_little_leaves_ghosts": effects["albot1"][0],
            "too_much_forgets": effects["albot1"][1],
            "seeds": len(seeds),
            **at_thesis,
            **groups,
        },
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared=compared(at_thesis, ALBOT1, names),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"margins": _picture(world, drives)},
    )


def _figures(several: list[tuple[Drive, float]]) -> dict[str, Figures]:
    return {
        **shape_figures([drive.shape_after for drive, _ in several]),
        "length_held": median_and_worst([held for _, held in several], 2),
        "updates": int(np.median([drive.updates for drive, _ in several])),
    }


def _held(drives: Drives, name: str, margin: float) -> float:
    return float(np.median([held for _, held in drives[name, margin]]))


def _recall(drives: Drives, name: str, margin: float) -> float:
    return float(np.median([drive.shape_after.recall for drive, _ in drives[name, margin]]))


def _leaves_ghosts(drives: Drives, name: str) -> bool:
    """Return whether, without a margin, the map holds more wall, but is not more precise."""
    longer = _held(drives, name, 0.0) > 1.1 * _held(drives, name, THESIS_MARGIN)
    none, thesis = (_precision(drives, name, margin) for margin in (0.0, THESIS_MARGIN))
    return longer and none <= thesis


def _precision(drives: Drives, name: str, margin: float) -> float:
    return float(np.median([drive.shape_after.precision for drive, _ in drives[name, margin]]))


def _forgets(drives: Drives, name: str) -> bool:
    """Return whether, with the widest margin, fewer of the walls seen are in the map."""
    return _recall(drives, name, MARGINS[-1]) < 0.9 * _recall(drives, name, THESIS_MARGIN)


def _best(drives: Drives, name: str) -> float:
    """Return the margin with the highest precision."""
    return max(MARGINS, key=lambda margin: _precision(drives, name, margin))


def _text(seeds: range) -> str:
    return f"""
The thesis removes a little more than the view covers, what lies within 40 cm of its boundary: too
little removed leaves ghosts of walls beside themselves, too much forgets what is nearby. It shows
neither. Here the drive of experiment 4, along `{TOUR}` of `{WORLD}` with a view every 10 cm and 1°,
is mapped with margins from {MARGINS[0]} to {MARGINS[-1]} m. `length_held` is how much wall the map
holds at the end for each metre of wall seen; the other figures are those of experiment 4, after
revisiting. Medians and worst over the seeds {seeds.start} to {seeds.stop - 1}.

*Too little leaves ghosts* where without a margin the map holds a tenth more wall than with 40 cm,
and no larger share of it is right; *too much forgets* where with {MARGINS[-1]} m a tenth less of
the walls seen is found. A mapper reaches it where both are so.
"""


def _picture(world: World, drives: Drives) -> Figure:
    """Draw the first seed's map at the end, with a row per mapper and a column per margin."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * len(MARGINS), 4.3 * len(ALBOT1)), layout="constrained")
    for name, row in zip(ALBOT1, figure.subplots(len(ALBOT1), len(MARGINS)), strict=True):
        for margin, axes in zip(MARGINS, row, strict=True):
            drive, held = drives[name, margin][0]
            last = len(drive.poses) - 1
            draw_map(axes, world, drive.surfaces[last], drive.poses, drive.shape_after.frame)
            axes.set_title(f"{name}, {margin} m: {held:.2f} m held a metre")
    finish_maps(figure)
    return figure
