"""RatSLAM maps an open plan office (Milford et al. 2005, section 6), in the simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from albot_experiments.mapping import median_and_worst
from albot_experiments.ratslam_runs import CORRECTED, LETTER, Run, follow
from albot_experiments.ratslam_wandering import (
    SPEED,
    Wandering,
    figures,
    overlaps,
    picture,
    seeds_within,
    text,
)
from albot_experiments.report import Figures, Report, each_seed

ID = "ratslam-office"
TITLE = "An open plan office (Milford et al. 2005, section 6, figure 13), simulated"
OFFICE = Wandering(world="open-plan", tour="routes", minutes=15)
PAPER = {"multiple_overlap": True}
CONDITIONS = {
    "environment": ("a real open plan office of 80 m²", f"simulated: `{OFFICE.world}`, 80 m²"),
    "duration": ("15 min", f"{OFFICE.minutes} min"),
    "speed": ("not given", f"{SPEED} m/s"),
    "way": (
        "an exploration algorithm that tries every possible route",
        "a tour round every cloister, then shortest ways between random waypoints",
    ),
    "sensors": (
        "a camera of 50° and wheel encoders on a Pioneer 2DXE, 7 Hz",
        "scenes `paper`: 1 m and 45° each, two views a number, 5 % missed, 0.5 % false; 10 Hz",
    ),
    "errors": ("those of the real robot", "odometer `pioneer`"),
    "trials": ("one run shown", "one run a seed"),
}
POSITION_OR_HEADING = replace(
    CORRECTED, experiences=replace(CORRECTED.experiences, position_or_heading=True)
)
"""The mapper whose experiences are active in either zone, as eq. (9) literally says."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Run the robot through the office for 15 minutes, once per seed, and map its readings.

    Raises:
        InputError: No seeds.
    """
    runs, letter, errors = [], [], []
    for seed in each_seed(seeds, progress):
        journey = OFFICE.journey(seed, OFFICE.minutes)
        runs.append(follow(journey.readings, journey.truth, CORRECTED))
        letter.append(follow(journey.readings, journey.truth, LETTER))
        errors.append(follow(journey.readings, journey.truth, POSITION_OR_HEADING).error)
    return report(seeds, runs, errors, letter)


def report(
    seeds: range,
    runs: Sequence[Run],
    either: Sequence[float] = (),
    letter: Sequence[Run] = (),
) -> Report:
    """Return the report of these runs, of the errors with `POSITION_OR_HEADING`, and of LETTER."""
    measured: dict[str, Figures] = figures(runs)
    if either:
        measured["position_or_heading_error_m"] = median_and_worst(either)
    overlap = overlaps(runs)
    verdicts = {"ratslam-scenes": overlap}
    if letter:
        measured["ratslam-paper"] = figures(letter)
        verdicts = {"ratslam-paper": overlaps(letter)} | verdicts
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={"multiple_overlap": overlap} | measured | seeds_within(seeds, runs),
        holds=overlap,
        verdicts=verdicts if letter else {},
        conditions=CONDITIONS,
        text=_TEXT + text(),
        pictures={"maps": picture(runs[0], OFFICE.world, (11.0, 5.0))},
    )


_TEXT = f"""
A robot wanders through the office `{OFFICE.world}` of 80 m² at {SPEED} m/s for {OFFICE.minutes}
minutes: first along the tour round every cloister of desks, then from one of the tour's
waypoints to another at random. The paper's robot was a real one with a camera; this is its
simulator's, with scenes in place of pictures.

`position_or_heading_error_m` is the error where an experience is active in its zone in (x', y') or
in that in θ', as eq. (9) says to the letter, and not in both. `ratslam-paper` follows the whole
paper to the letter; all other figures are those of `ratslam-scenes`.
"""
