"""Experiment 4 of the Albot1 thesis: mapping without stopping (section 3.2.4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from albot_experiments.albot1_conditions import thesis_conditions
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
CONDITIONS = thesis_conditions(
    "`office-ring`",
    ("driven by hand, a view each 10 cm or 1°", "driven at 0.5 m/s, a view each 10 cm or 1°"),
    ("one journey of 136 m", "one journey of 136 m, 100 seeds"),
)
MOST_UPDATES = 0.4
"""Maximum number of updates, as a share of the views."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive the robot without stopping, once per seed, and take a view every 10 cm and 1°.

    Raises:
        InputError: No seeds.
    """
    experiment = RevisitingExperiment(
        id=ID, title=TITLE, paper=PAPER, conditions=CONDITIONS, most_updates=MOST_UPDATES
    )
    return report_on(experiment, drive(SPACING, seeds, progress), _text(seeds))


def _text(seeds: range) -> str:
    return f"""
A robot is driven without stopping along the tour `{TOUR}` of `{WORLD}`: once round, and on
over 40 m of ground that it knows. A view is noted whenever the odometer says that it has come
10 cm, or turned 1°, since the last one.

{criterion(seeds, MOST_UPDATES)}
"""
