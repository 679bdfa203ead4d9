"""RatSLAM closes a small loop under odometric error (Milford et al. 2005, section 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.planning.leading import Driving
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.scenes import SceneConfig
from albot_experiments.mapping import median_and_worst
from albot_experiments.ratslam_runs import (
    CORRECTED,
    LETTER,
    UNCORRECTED,
    Run,
    draw_experiences,
    draw_pose_cells,
    follow,
)
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import driven_tour
from albot_maps import load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "ratslam-loop"
TITLE = (
    "Closing simple loops under odometric error (Milford et al. 2005, section 5.2, figures 7–10)"
)
WORLD, TOUR = "square-loop", "loop"
BIASES = ("bias-1.5", "bias-3", "bias-6")
"""Names of the odometers."""
DRIVING = Driving(speed=0.3)
MINUTES, READINGS_PER_SECOND = 15, 10
SCENES = SceneConfig(false_rate=0.05, false_shortest=1.0, false_longest=3.0, familiar=True)
"""The scene sensor: 5 % of its looks show, for 1 to 3 s, a scene that the robot has passed."""
MAPPER = replace(CORRECTED, experiences=replace(CORRECTED.experiences, visits=2))
"""The mapper, for a camera whose false scenes last."""
CONDITIONS = {
    "environment": ("a square corridor, laps of about 18 m", f"`{WORLD}`, laps of 18 m"),
    "duration": ("15 min", f"{MINUTES} min"),
    "speed": ("not given", f"{DRIVING.speed} m/s"),
    "sensors": (
        "noisy, ambiguous scene numbers; at random times a familiar scene is falsely recognised",
        f"scenes of 1 m and 45°; {SCENES.false_rate:.0%} of the looks show a scene that the robot "
        f"has passed, for {SCENES.false_shortest:g} to {SCENES.false_longest:g} s",
    ),
    "errors": ("heading biases of 1.5, 3 and 6 °/s", "the same; no other error"),
    "trials": ("one run shown for each bias", "one run a seed and bias"),
}
PAPER = {"consistent_at_1.5": True, "consistent_at_3": True, "consistent_at_6": True}
MOST_ERROR, LEAST_RATIO, MOST_GROWTH, MOST_ELSEWHERE = 0.5, 5.0, 2, 10.0
"""Bounds: rms error (m); ratio of the rms error without correction to that with it; number of
experiences made in the last five minutes; longest time for which the robot is believed elsewhere
(s)."""
LEAST_SHARE = 0.95
"""Share of the seeds that must be consistent."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive laps for 15 minutes, once per seed and bias; map with and without correction.

    Raises:
        InputError: No seeds.
    """
    runs, letter = [], []
    for seed in each_seed(seeds, progress):
        runs.append({bias: loop(bias, seed) for bias in BIASES})
        letter.append({bias: loop(bias, seed, LETTER) for bias in BIASES})
    return _report(seeds, runs, letter)


def loop(odometer: str, seed: int, mapper: RatSlamConfig = MAPPER) -> tuple[Run, Run]:
    """Return a run with map correction, and the same run without."""
    world = load_world(WORLD)
    tour = world.tours[TOUR]
    count = 60 * MINUTES * READINGS_PER_SECOND + 1
    # 20 laps take 20 minutes at least; the rest is cut off.
    waypoints = np.concatenate((tour, *[tour[1:]] * 19))
    journey = driven_tour(
        world,
        waypoints,
        np.random.default_rng((BIASES.index(odometer), seed)),
        driving=DRIVING,
        odometer=ODOMETERS[odometer],
        scenes=SCENES,
    )
    readings, truth = journey.readings[:count], journey.truth[:count]
    with_correction, without = (
        follow(readings, truth, config)
        for config in (mapper, replace(mapper, correction=UNCORRECTED.correction))
    )
    return with_correction, without


def is_consistent(corrected: Run, uncorrected: Run) -> bool:
    """Return whether a run's map is consistent, by all of the bounds."""
    return bool(
        corrected.error <= MOST_ERROR
        and corrected.path_error <= MOST_ERROR
        and uncorrected.error >= LEAST_RATIO * corrected.error
        and corrected.growth(5 * 60 * READINGS_PER_SECOND) <= MOST_GROWTH
        and corrected.longest_elsewhere <= MOST_ELSEWHERE * READINGS_PER_SECOND
        and corrected.grown > 0
        and corrected.weakened == 0
    )


def _figures(runs: list[tuple[Run, Run]]) -> dict[str, Figures]:
    """Return the measured figures of the runs with one odometer."""
    with_correction = [corrected for corrected, _ in runs]
    return {
        "consistent": sum(is_consistent(*pair) for pair in runs) / len(runs),
        "error_m": median_and_worst([run.error for run in with_correction]),
        "path_error_m": median_and_worst([run.path_error for run in with_correction]),
        "uncorrected_error_m": round(float(np.median([run.error for _, run in runs])), 2),
        "least_ratio": round(min(other.error / run.error for run, other in runs), 1),
        "experiences": int(np.median([run.counts[-1] for run in with_correction])),
        "most_growth": max(run.growth(5 * 60 * READINGS_PER_SECOND) for run in with_correction),
        "relocalisations": int(np.median([run.relocalisations for run in with_correction])),
        "multiple": int(np.median([run.represented[0] for run in with_correction])),
        "collisions": int(np.median([run.represented[1] for run in with_correction])),
        "longest_elsewhere_s": max(run.longest_elsewhere for run in with_correction)
        / READINGS_PER_SECOND,
        "least_grown": min(run.grown for run in with_correction),
        "most_weakened": max(run.weakened for run in with_correction),
    }


def _report(
    seeds: range,
    runs: Sequence[Mapping[str, tuple[Run, Run]]],
    letter: Sequence[Mapping[str, tuple[Run, Run]]],
) -> Report:
    measured: dict[str, Figures] = {}
    for bias in BIASES:
        figures = _figures([each[bias] for each in runs])
        share = figures["consistent"]
        measured[f"consistent_at_{bias.removeprefix('bias-')}"] = bool(share >= LEAST_SHARE)  # type: ignore[operator]
        measured[bias] = figures
    holds = all(measured[name] for name in PAPER)
    by_letter = {bias: _figures([each[bias] for each in letter]) for bias in BIASES}
    measured |= {f"ratslam-paper, {bias}": figures for bias, figures in by_letter.items()}
    shares = [float(figures["consistent"]) for figures in by_letter.values()]  # type: ignore[arg-type]
    measured["seeds"] = len(seeds)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=holds,
        verdicts={"ratslam-paper": min(shares) >= LEAST_SHARE, "ratslam-scenes": holds},
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"maps": _picture(runs[0])},
    )


def _text(seeds: range) -> str:
    return f"""
A robot goes round the square corridor `{WORLD}` of 18 m for {MINUTES} minutes at
{DRIVING.speed} m/s, ten readings a second, with an odometer that turns 1.5, 3 or 6 °/s in excess
and has no other error. The paper gives no speed. The scene sensor numbers squares of 1 m seen in
eight directions; {SCENES.false_rate:.0%} of its looks show, for {SCENES.false_shortest:g} to
{SCENES.false_longest:g} s at a time, a scene that the robot passed at some time before. The paper's
robot falsely recognises familiar scenes in novel parts; here it does so in all parts. So the mapper
asks for two visits (`visits=2`) before it believes that a known place shows a scene that is known
from elsewhere.

A map is consistent where, laid on the floor by a rigid motion, the experiences lie within
{MOST_ERROR} m rms of where they were made and all corrected poses within as much of the true ones
(so laps lie on laps); where the same run without map correction is {LEAST_RATIO:g} times as
wrong; where no more than {MOST_GROWTH} experiences are new in the last five minutes; where the
robot is never taken to be over 2 m from where it is for more than {MOST_ELSEWHERE:g} s; and where
links from views to pose cells grow stronger, and none ever grows weaker, as Hebbian learning has it
(section 3.4; `grown` and `weakened` count how often one does). It is to be so with
{LEAST_SHARE:.0%} of the seeds {seeds.start} to {seeds.stop - 1}. `multiple` and `collisions` count
the experiences that share their place with another of other pose cells, and their pose cells with
another of another place.

At 0.3 m/s a lap takes a minute, so that 6 °/s are a whole turn: the packet's path in the pose
cells is nearly straight, as in figure 10. `ratslam-paper` follows the whole paper to the letter,
without such visits; all figures without its name are those of `ratslam-scenes`. The picture shows
the first seed: at each bias the path of the packet in the pose cells, the experience map, and the
same without correction.
"""


def _picture(runs: Mapping[str, tuple[Run, Run]]) -> Figure:
    """Draw figures 8 to 10, and the map without correction."""
    from matplotlib.figure import Figure

    world = load_world(WORLD)
    figure = Figure(figsize=(12, 12), layout="constrained")
    grid = figure.subplots(len(BIASES), 3)
    for row, bias in enumerate(BIASES):
        corrected, uncorrected = runs[bias]
        draw_pose_cells(grid[row][0], corrected)
        grid[row][0].set_title(f"{bias}: pose cells")
        for axes, run, kind in zip(
            grid[row][1:], (corrected, uncorrected), ("experience map", "uncorrected"), strict=True
        ):
            draw_experiences(axes, run, world)
            axes.set_title(f"{kind}: {run.error:.2f} m rms")
    return figure
