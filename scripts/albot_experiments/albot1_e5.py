"""Experiment 5 of the Albot1 thesis: few views, too few for SLAM (section 3.2.5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from albot_experiments.report import Report
from albot_experiments.revisiting import (
    TOUR,
    WORLD,
    RevisitingExperiment,
    Spacing,
    criterion,
    drive,
    report_on,
)

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
SLAM = ("scan-matching", "graph-slam", "gmapping", "grid-slam", "dp-slam")
"""Our mappers of the kind that the thesis runs: CARMEN's, GMapping, gridSLAM and DP-SLAM; and, in
place of none of them, graph SLAM."""
SLAM_SEEDS = 20
"""They take seconds a drive: they are led along the drives of so many seeds, the first ones."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive the robot as in experiment 4, once a seed, and map every metre and 10°.

    Raises:
        InputError: No seeds.
    """
    experiment = RevisitingExperiment(id=ID, title=TITLE, paper=PAPER, most_updates=MOST_UPDATES)
    report = report_on(experiment, drive(SPACING, seeds, progress), _text(seeds))
    slam = drive(SPACING, seeds[:SLAM_SEEDS], lambda _: None, SLAM)
    kept = {name: slam.keeps_shape(name) for name in SLAM}
    measured = {**report.measured, "slam_shape_kept": all(kept.values())}
    measured |= {name: slam.figures_of(name) for name in SLAM}
    pictures = {**report.pictures, "slam": slam.grid_picture(SLAM)}
    return replace(report, measured=measured, pictures=pictures)


def _text(seeds: range) -> str:
    slam = seeds[:SLAM_SEEDS]
    return f"""
The drive of experiment 4, along the tour `{TOUR}` of `{WORLD}`, but with a view only every metre
or 10°.

{criterion(seeds, MOST_UPDATES)}

On such a log of the thesis's robot the maps of DP-SLAM, CARMEN mapping, GMapping and gridSLAM all
came out distorted. Our own mappers of those kinds are led along the same drives, of the seeds
{slam.start} to {slam.stop - 1}; `after_…` is of the grid and, where a mapper corrects it, of the
whole path at the end, and a cell is a wall if it is more likely occupied than not. Their shape is
kept here, for `shape_kept` in the table says so of each: 1 m and 10° are little for a laser that
sees half a turn and 30 m, the scans overlap almost wholly, and each is searched for over the
whole error of such a step with an odometer as good as `pioneer`. The thesis's programs of 2002 to
2007 search a smaller window, made for a scan every few centimetres, and hold few particles; it
does not say with which settings they were run. So its comparison tells of those programs on that
log, not of SLAM.
"""
