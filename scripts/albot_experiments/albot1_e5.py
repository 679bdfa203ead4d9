"""Experiment 5 of the Albot1 thesis: few views, too few for SLAM (section 3.2.5)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from albot_experiments.mapping import SHAPE_BOUND
from albot_experiments.report import Report
from albot_experiments.revisiting import TOUR, WORLD, RevisitingExperiment, Spacing, run_drives

ID = "albot1-e5"
TITLE = "Sparse views (Hossain 2014, section 3.2.5, figures 3.26 to 3.28)"
SPACING = Spacing(distance=1.0, turn=np.radians(10.0))
PAPER = {
    "path_m": 136.0,
    "views": 217,
    "views_before": 128,
    "updates": 133,
    "update_share": round(133 / 217, 3),
    "shape_kept": True,
    "slam_shape_kept": False,
}
MOST_UPDATES = 0.65
"""Of the views."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive the robot as in experiment 4, once a seed, and map every metre and 10°.

    Raises:
        InputError: No seeds.
    """
    experiment = RevisitingExperiment(
        id=ID, title=TITLE, paper=PAPER, spacing=SPACING, most_updates=MOST_UPDATES
    )
    return run_drives(experiment, seeds, progress, _text(seeds))


def _text(seeds: range) -> str:
    return f"""
The drive of experiment 4, along the tour `{TOUR}` of `{WORLD}`, but with a view only every metre
or 10°. On such a log of the thesis's robot the maps of DP-SLAM, CARMEN mapping, GMapping and
gridSLAM all came out distorted; those systems are not run here.

The map is laid on the floor by the rigid motion that brings the believed path nearest to the
true one. *Before* is the last view before the robot comes back into the room in which it
began, *after* the last of all. Medians and worst over the seeds {seeds.start} to
{seeds.stop - 1}; reached where the median distance of `albot1`'s surfaces to the walls is at
most {SHAPE_BOUND} m both before and after, and it updates its map at no more than
{MOST_UPDATES:.0%} of the views.

`corridor_length` is how long a mapper believes the bare corridor to be, to its true length.
"""
