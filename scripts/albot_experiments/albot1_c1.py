"""Experiment 1 of the Albot1 thesis's chapter 4: a network of places (section 4.2.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_experiments.albot1_conditions import THESIS_LASER, THESIS_MOTION, THESIS_ODOMETER
from albot_experiments.albot1_places import PlacedTour, place_tour
from albot_experiments.albot1_truth import (
    LEAST_DESCRIBED,
    LEAST_ON_WALLS,
    NEAR_DOOR,
    NEAR_WALL,
    Judged,
)
from albot_experiments.drawing import draw_place_graph, draw_route, finish_maps
from albot_experiments.mapping import ALBOT1
from albot_experiments.report import Figures, Report, compared, each_seed
from albot_experiments.tours import guided_tour
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-c1"
TITLE = "Learning a network of places (Hossain 2014, section 4.2.1, figures 4.1 to 4.3)"
WORLD, TOUR = "office-ring", "single-loop"
PAPER: dict[str, Figures] = {
    "path_m": 90.0,
    "places": 6,
    "links": 6,
    "right_from_S": 1.0,
    "right_from_A": 1.0,
    "right_from_B": 1.0,
}
STARTS: Mapping[str, int] = {"S": 0, "A": 9, "B": 6}
"""The waypoint of the tour from which the robot sets out: in P1, P5 and P4."""
LEAST_SHARE = 0.9
"""Minimum share of the seeds in which network, exits and descriptions must be right from all
starts."""
CONDITIONS: Mapping[str, tuple[str, str]] = {
    "environment": (
        "an office floor: a laboratory, corridors and rooms, 6 exits of about 1 m",
        f"simulated, `{WORLD}`: drawn after figure 4.1, 6 exits of 1 m",
    ),
    "path": (
        "about 90 m, one loop; its end is not told",
        "98 to 108 m: the loop, and 1 to 11 m more",
    ),
    "motion": THESIS_MOTION,
    "laser": THESIS_LASER,
    "odometer": THESIS_ODOMETER,
    "trials": ("1 from each of 3 starts", "1 from each of 3 starts for each seed"),
    "judged": ("by eye", "against the true floor"),
}

Placed = dict[str, dict[str, list[PlacedTour]]]
"""The journeys by mapper and start, one for each seed."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Guide the robot round the ring from each start, once per seed, and judge its network.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    placed: Placed = {name: {start: [] for start in STARTS} for name in ALBOT1}
    for seed in each_seed(seeds, progress):
        for start, waypoint in STARTS.items():
            tour = loop_from(world.tours[TOUR], waypoint)
            journey = guided_tour(world, tour, np.random.default_rng(seed))
            for name in ALBOT1:
                placed[name][start].append(place_tour(name, world, journey))
    return _report(world, seeds, placed)


def loop_from(
    loop: Float64[np.ndarray, "waypoints 2"], start: int
) -> Float64[np.ndarray, "tour 2"]:
    """Return a closed tour that begins at one of its waypoints and continues a little way.

    At its end the robot goes on in its starting place, through the part that was left out at the
    start: it can only recognise what it has seen before leaving the place.
    """
    once = loop[:-1]
    turned = np.concatenate((once[start:], once[: start + 1]))
    return np.concatenate((turned, turned[1:3] if start else turned[1:2]))


def _report(world: World, seeds: range, placed: Placed) -> Report:
    judged = {
        name: {start: [Judged.of(each, world) for each in of] for start, of in runs.items()}
        for name, runs in placed.items()
    }
    groups: dict[str, Figures] = {name: _figures(runs) for name, runs in judged.items()}
    verdicts = {name: _from_all(runs, "is_reached") >= LEAST_SHARE for name, runs in judged.items()}
    ours = groups["albot1"]
    assert isinstance(ours, Mapping)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={**ours, "seeds": len(seeds), **groups},
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared=compared(groups, ALBOT1, ("right_from_all", "all_right_from_all", "places")),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"networks": _picture(world, placed)},
    )


def _figures(judged: Mapping[str, list[Judged]]) -> dict[str, Figures]:
    """Return the figures of one mapper, over starts and seeds."""
    runs = [each for several in judged.values() for each in several]
    graphs = [each.placed.place_graph for each in runs]

    def median(name: str) -> float:
        return round(float(np.median([getattr(each.truth, name) for each in runs])), 3)

    return {
        "path_m": round(float(np.median([each.placed.journey.path_length for each in runs])), 1),
        "places": int(np.median([len(graph.nodes) for graph in graphs])),
        "links": int(np.median([len(graph.links) for graph in graphs])),
        **{
            f"right_from_{start}": round(float(np.mean([each.is_right for each in of])), 3)
            for start, of in judged.items()
        },
        "right_from_all": round(_from_all(judged, "is_right"), 3),
        "exits_right_from_all": round(_from_all(judged, "has_exits_right"), 3),
        "described_from_all": round(_from_all(judged, "is_described"), 3),
        "all_right_from_all": round(_from_all(judged, "is_reached"), 3),
        "exits_off_m": median("exits_off"),
        "walls_described": median("walls_described"),
        "surfaces_on_walls": median("surfaces_on_walls"),
    }


def _from_all(judged: Mapping[str, list[Judged]], what: str) -> float:
    """Return the share of the seeds in which something is so from every start."""
    found = [[getattr(each, what) for each in several] for several in judged.values()]
    return float(np.all(found, axis=0).mean())


def _text(seeds: range) -> str:
    return f"""
A robot is guided start-stop round the loop of `{WORLD}`, through six exits and back to where
it set out: in P1 (S), in P5 (A) or in P4 (B). It then goes on a little way, for it recognises
a place by what it sees there again. `right_from_S` is the share of the seeds {seeds.start} to
{seeds.stop - 1} in which the network at the end is right: every view more than 1 m from a
doorway was taken in the one room that its place is, every room is one place, and the links
are those that the six exits make. From all starts, judged too:

- `exits_right`: every door has an exit in either of its rooms, and all three values of each exit
  are right: its whereabouts in the place (within {NEAR_DOOR:g} m of the true door), the place it
  leads to, and which exit of that place it is;
- `described`: of the walls of each room that the laser met from inside, the surfaces of its place
  hold at least {LEAST_DESCRIBED:.0%} within {NEAR_WALL:g} m (`walls_described` is the share in the
  worst place), and at least {LEAST_ON_WALLS:.0%} of all surfaces lie on walls
  (`surfaces_on_walls`). A place lies on the floor where the robot truly was when it began it; its
  surfaces are not fitted to the walls.

A mapper reaches it if all of this is so from all three starts in {LEAST_SHARE:.0%} of the seeds. In
the thesis the networks were right in its one run from each; exits and surfaces were not measured.

The picture shows the networks of the first seed: each place's description in a colour of its
own, drawn where the map had it when the place was learned.
"""


def _picture(world: World, placed: Placed) -> Figure:
    """Draw the route, and each mapper's network from each start, as figures 4.1 to 4.3."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(17, 4.6 * len(placed)), layout="constrained")
    for (name, runs), (route, *others) in zip(
        placed.items(), figure.subplots(len(placed), 1 + len(STARTS)), strict=True
    ):
        draw_route(route, world, world.tours[TOUR])
        route.set_title(f"{WORLD}: {TOUR}")
        for axes, (start, several) in zip(others, runs.items(), strict=True):
            draw_place_graph(axes, world, several[0].place_graph, several[0].journey.truth[0])
            axes.set_title(f"{name}, from {start}")
    finish_maps(figure)
    return figure
