"""RatSLAM maps a whole office floor (Milford et al. 2005, section 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from albot_experiments.ratslam_runs import CORRECTED, LETTER, Run, follow
from albot_experiments.ratslam_wandering import (
    SPEED,
    Wandering,
    enough,
    figures,
    overlaps,
    picture,
    seeds_within,
    text,
    within,
)
from albot_experiments.report import Figures, Report, each_seed

ID = "ratslam-floor"
TITLE = "The full floor of an office (Milford et al. 2005, section 5.3, figures 4 and 11)"
FLOOR = Wandering(world="office-floor", tour="floor", minutes=150)
MOST_ERROR = 1.0
"""Largest rms error of the experiences (m)."""
PAPER = {"matches_the_floor": True, "multiple_overlap": True}
CONDITIONS = {
    "environment": (
        "simulated floor of the authors' office, 43 × 13 m; no plan given",
        f"`{FLOOR.world}`, 43 × 13 m",
    ),
    "duration": ("2.5 h (figure 4)", f"{FLOOR.minutes} min"),
    "speed": ("0.3 m/s on average", f"{SPEED} m/s"),
    "way": (
        "an exploration algorithm that tries every possible route",
        "a tour of all rooms, then shortest ways between random waypoints",
    ),
    "sensors": (
        "noisy, ambiguous scene numbers; false matches at random times",
        "scenes `paper`: 1 m and 45° each, two views a number, 5 % missed, 0.5 % false",
    ),
    "errors": ("not given", "odometer `pioneer`"),
    "trials": ("one run shown", "one run a seed"),
}


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Run the robot over the floor for 2.5 hours, once per seed, and map its readings.

    Raises:
        InputError: No seeds.
    """
    runs, letter = [], []
    for seed in each_seed(seeds, progress):
        journey = FLOOR.journey(seed, FLOOR.minutes)
        runs.append(follow(journey.readings, journey.truth, CORRECTED))
        letter.append(follow(journey.readings, journey.truth, LETTER))
    return report(seeds, runs, letter)


def report(seeds: range, runs: Sequence[Run], letter: Sequence[Run] = ()) -> Report:
    """Return the report of these runs, and of those with LETTER."""
    measured: dict[str, Figures] = figures(runs)
    matches = enough([run.error <= MOST_ERROR for run in runs])
    overlap = overlaps(runs)
    verdict: dict[str, Figures] = {"matches_the_floor": matches, "multiple_overlap": overlap}
    holds = enough(within(runs, MOST_ERROR))
    verdicts = {"ratslam-scenes": holds}
    if letter:
        measured["ratslam-paper"] = figures(letter)
        verdicts = {"ratslam-paper": enough(within(letter, MOST_ERROR))} | verdicts
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=verdict | measured | seeds_within(seeds, runs, MOST_ERROR),
        holds=holds,
        verdicts=verdicts if letter else {},
        conditions=CONDITIONS,
        text=_TEXT + text(),
        pictures={"maps": picture(runs[0], FLOOR.world, (14.0, 4.0))},
    )


_TEXT = f"""
A robot wanders over the floor `{FLOOR.world}` of 43 × 13 m at {SPEED} m/s for
{FLOOR.minutes} minutes, as in the paper: first along the floor's tour through all rooms and
corridors, then from one of the tour's waypoints to another at random, by the shortest way. The
paper gives no plan of its floor; ours has as many sorts of ways: long corridors, loops of several
sizes, rooms with one door and with two, and an open office.

The map matches the floor where the experiences lie within {MOST_ERROR:g} m rms of where they were
made. `ratslam-paper` follows the whole paper to the letter; all other figures are those of
`ratslam-scenes`.
"""
