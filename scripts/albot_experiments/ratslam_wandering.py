"""RatSLAM on a robot that wanders over a floor, as by an exploration algorithm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from albot_core.geometry.types import Points
from albot_core.planning.leading import Driving
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.scenes import SCENES
from albot_experiments.mapping import median_and_worst
from albot_experiments.ratslam_runs import Run, draw_experiences, draw_pose_cells
from albot_experiments.report import Figures
from albot_experiments.tours import TourRecord, driven_tour
from albot_maps import load_world
from albot_maps.routes import Routes
from albot_maps.world import World

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPEED = 0.3
"""The robot's speed (m/s), as in section 3.5 of the paper."""
READINGS_PER_SECOND = 10
ODOMETER, SCENE_SENSOR = "pioneer", "paper"
ASKED_REVISITS = 0.95
"""Share of revisits that must lie within a metre of the first visit."""
LEAST_SEEDS = 0.85
"""Share of the seeds that must keep within every bound: 17 of 20."""
_SPARE = 0.2
"""Distance of the robot's body from walls on the routes (m); the robot cuts corners."""
_LEAST_LEG = 1.0
"""Smallest distance between the ends of a route (m)."""


@dataclass(frozen=True, kw_only=True)
class Wandering:
    """The world in which a robot wanders, and the duration."""

    world: str
    tour: str
    """The tour with which it begins."""
    minutes: int

    def journey(self, seed: int, minutes: int) -> TourRecord:
        """Return the robot's readings and true poses over `minutes` minutes.

        The odometer is a Pioneer's. The scenes are the paper's: each number stands for two views,
        and some are missed or false.
        """
        world, rng = load_world(self.world), np.random.default_rng(seed)
        # Turns take time, so this distance takes longer than `minutes`.
        waypoints = wandering(world, self.tour, 60 * minutes * SPEED, rng)
        journey = driven_tour(
            world,
            waypoints,
            rng,
            driving=Driving(speed=SPEED),
            odometer=ODOMETERS[ODOMETER],
            scenes=SCENES[SCENE_SENSOR],
        )
        count = 60 * minutes * READINGS_PER_SECOND + 1
        return replace(journey, readings=journey.readings[:count], truth=journey.truth[:count])


def wandering(world: World, tour: str, length: float, rng: np.random.Generator) -> Points:
    """Return waypoints of a tour, then of random routes between them, up to a length (m)."""
    stops = world.tours[tour]
    routes = Routes(world, _SPARE)
    parts, here, gone = [stops], stops[-1], _length(stops)
    while gone < length:
        there = stops[rng.integers(len(stops))]
        if np.hypot(*(there - here)) < _LEAST_LEG:
            continue
        way = routes.through(np.stack((here, there)))
        parts.append(way[1:])
        here, gone = there, gone + _length(way)
    return np.concatenate(parts)


def _length(way: Points) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def figures(runs: Sequence[Run]) -> dict[str, Figures]:
    """Return the measured figures of runs."""
    return {
        "error_m": median_and_worst([run.error for run in runs]),
        "path_error_m": median_and_worst([run.path_error for run in runs]),
        "revisits": int(np.median([len(run.revisits) for run in runs])),
        "within_a_metre": float(np.median([run.revisits_within_a_metre for run in runs])),
        "least_within_a_metre": min(run.revisits_within_a_metre for run in runs),
        "experiences": int(np.median([run.counts[-1] for run in runs])),
        "relocalisations": int(np.median([run.relocalisations for run in runs])),
        "multiple": int(np.median([run.represented[0] for run in runs])),
        "collisions": int(np.median([run.represented[1] for run in runs])),
        "longest_elsewhere_s": max(run.longest_elsewhere for run in runs) / READINGS_PER_SECOND,
    }


def overlaps(runs: Sequence[Run]) -> bool:
    """Return whether enough seeds have ASKED_REVISITS of their revisits within a metre."""
    return enough([run.revisits_within_a_metre >= ASKED_REVISITS for run in runs])


def enough(kept: Sequence[bool]) -> bool:
    """Return whether LEAST_SEEDS of the seeds keep within a bound."""
    return float(np.mean(kept)) >= LEAST_SEEDS


def within(runs: Sequence[Run], most_error: float = np.inf) -> list[bool]:
    """Return which of the runs keep within every bound."""
    return [
        run.revisits_within_a_metre >= ASKED_REVISITS and run.error <= most_error for run in runs
    ]


def seeds_within(
    seeds: range, runs: Sequence[Run], most_error: float = np.inf
) -> dict[str, Figures]:
    """Return how many seeds keep within every bound, and which have the worst figures."""
    shares = [run.revisits_within_a_metre for run in runs]
    errors = [run.error for run in runs]
    return {
        "seeds": len(seeds),
        "seeds_within_every_bound": sum(within(runs, most_error)),
        "seed_of_worst_error": seeds[int(np.argmax(errors))],
        "seed_of_least_within_a_metre": seeds[int(np.argmin(shares))],
    }


def text() -> str:
    """Return a description of how all of these runs are measured, in Markdown."""
    return f"""
The odometer is the preset `{ODOMETER}`, the scenes are the preset `{SCENE_SENSOR}`: places of 1 m
seen in eight directions, each number that of two views far apart, 5 % of the looks missed and
0.5 % false.

A revisit is when the robot comes into a square of 0.5 m where it was before, whichever way it
faces, more than 10 s after it left it. Both visits, as the map has them in the end, are to lie
within 1 m of each other where they truly are at one point: that says whether multiple
representations overlap. It is asked of {ASKED_REVISITS:.0%} of the revisits. Verdicts go by
seeds: at least {LEAST_SEEDS:.0%} of them must keep within every bound. The worst seeds are named.
`multiple` and `collisions` count the experiences that share their place with another of other
pose cells, and their pose cells with another of another place. `longest_elsewhere_s` is for how
long at most the robot was taken to be over 2 m from where it was.

The picture shows the first seed: the path of the packet in the pose cells, and the experience map
laid on the floor.
"""


def picture(run: Run, world: str, size: tuple[float, float]) -> Figure:
    """Draw the pose cells and the experience map side by side."""
    from matplotlib.figure import Figure

    floor = load_world(world)
    width, height = np.subtract(floor.bounds[2:], floor.bounds[:2])
    figure = Figure(figsize=size, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, max(1.0, float(width / height))))
    draw_pose_cells(left, run)
    left.set_title("pose cells")
    draw_experiences(right, run, floor)
    right.set_title(f"experience map: {run.error:.2f} m rms")
    return figure
