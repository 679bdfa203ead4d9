"""Experiment 4 of the Albot1 thesis: mapping without stopping (section 3.2.4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from albot_experiments.mapping import SHAPE_BOUND
from albot_experiments.report import Report
from albot_experiments.revisiting import TOUR, WORLD, RevisitingExperiment, Spacing, run_drives

ID = "albot1-e4"
TITLE = "Continuous movement (Hossain 2014, section 3.2.4, figures 3.23 and 3.24)"
SPACING = Spacing(distance=0.1, turn=np.radians(1.0))
PAPER = {
    "path_m": 136.0,
    "views": 1330,
    "views_before": 810,
    "updates": 470,
    "update_share": round(470 / 1330, 3),
    "shape_kept": True,
}
MOST_UPDATES = 0.4
"""Of the views."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive the robot without stopping, once a seed, and map every 10 cm and 1°.

    Raises:
        InputError: No seeds.
    """
    experiment = RevisitingExperiment(
        id=ID, title=TITLE, paper=PAPER, spacing=SPACING, most_updates=MOST_UPDATES
    )
    return run_drives(experiment, seeds, progress, _text(seeds))


def _text(seeds: range) -> str:
    return f"""
A robot is driven without stopping along the tour `{TOUR}` of `{WORLD}`: once round, and on
over 40 m of ground that it knows. A view is noted whenever the odometer says that it has come
10 cm, or turned 1°, since the last one. *Before* is the last view before it comes back into
the room in which it began, *after* the last of all.

The map is laid on the floor by the rigid motion that brings the believed path nearest to the
true one. Medians and worst over the seeds {seeds.start} to {seeds.stop - 1}; reached where the
median distance of `albot1`'s surfaces to the walls is at most {SHAPE_BOUND} m both before and
after, and it updates its map at no more than {MOST_UPDATES:.0%} of the views.

`corridor_length` is how long a mapper believes the bare corridor to be, to its true length.
Where views are 10 cm apart, `albot1-thesis` takes the ends of what it sees of the two side
walls for landmarks; they come along with the robot.
"""
