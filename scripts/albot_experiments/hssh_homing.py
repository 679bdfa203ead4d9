"""HSSH comes home in random offices, beside other mappers (after Beeson et al. 2010)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.summary import summarise
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_experiments.report import Figures, Report, each_seed

ID = "hssh-homing"
PAPER: dict[str, Any] = {}
"""The paper gives no figures."""
TITLE = "HSSH comes home over its places and paths in random offices"
TASK, AGENT = "Albot/Homing-v0", "map-homing"
WORLD = "random:office:{seed}"
MAPPERS = ("hssh", "albot1", "ratslam", "scan-matching", "odometry")
ASKED = 0.8
"""Share of the ways home of `hssh` that must end at home."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive home once per seed and mapper, each time in an office of its own.

    Raises:
        InputError: No seeds.
    """
    outcomes: dict[str, list[Outcome]] = {name: [] for name in MAPPERS}
    for seed in each_seed(seeds, progress):
        for name, ends in outcomes.items():
            trial = Trial(
                task=TASK,
                agent=AGENT,
                world=WORLD.format(seed=seed),
                seed=seed,
                settings={"mapper": name},
            )
            ends.append(run_trial(trial))
    return report(seeds, outcomes)


def report(seeds: range, outcomes: Mapping[str, Sequence[Outcome]]) -> Report:
    """Return the report of these episodes."""
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    verdicts = {}
    for name, ends in outcomes.items():
        figures = summarise(ends)
        measured[name] = {
            "episodes": len(ends),
            "success_rate": round(figures["success_rate"], 2),
            "ci95": "{:.2f} to {:.2f}".format(*figures["ci95"]),
            "spl": round(figures["spl"], 2),
            "final_distance_m": round(figures["mean_final_distance_m"], 2),
        }
        verdicts[name] = bool(figures["success_rate"] >= ASKED)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=verdicts["hssh"],
        verdicts=verdicts,
        text=f"""
`{AGENT}` drives home in `{TASK}` by the way that its mapper knows, in a random office for each of
the seeds {seeds.start} to {seeds.stop - 1}. All mappers meet the same offices, outward journeys and
odometer. The way of `hssh` leads over the gateways that the robot has travelled through. The paper
gives no figures for this; {ASKED:.0%} are asked for. The thresholds of `hssh` were chosen on seeds
500 to 519.
""",
    )
