"""Experiment 1 of the Albot1 thesis's chapter 4: a network of places (section 4.2.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_experiments.albot1_places import PlacedTour, place_tour
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
"""Minimum share of the seeds in which the network must be right from all starts."""

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
    groups: dict[str, Figures] = {name: _figures(world, runs) for name, runs in placed.items()}
    verdicts = {name: _is_reached(world, runs) for name, runs in placed.items()}
    ours = groups["albot1"]
    assert isinstance(ours, Mapping)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={**ours, "seeds": len(seeds), **groups},
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared=compared(groups, ALBOT1, ("right_from_all", "places")),
        text=_text(seeds),
        pictures={"networks": _picture(world, placed)},
    )


def _figures(world: World, placed: Mapping[str, list[PlacedTour]]) -> dict[str, Figures]:
    """Return the figures of one mapper, over starts and seeds."""
    runs = [each for several in placed.values() for each in several]
    return {
        "path_m": round(float(np.median([each.journey.path_length for each in runs])), 1),
        "places": int(np.median([len(each.place_graph.nodes) for each in runs])),
        "links": int(np.median([len(each.place_graph.links) for each in runs])),
        **{
            f"right_from_{start}": round(float(np.mean([each.is_right(world) for each in of])), 3)
            for start, of in placed.items()
        },
        "right_from_all": round(_right_from_all(world, placed), 3),
    }


def _right_from_all(world: World, placed: Mapping[str, list[PlacedTour]]) -> float:
    """Return the share of the seeds in which the network is right from every start."""
    right = [[each.is_right(world) for each in several] for several in placed.values()]
    return float(np.all(right, axis=0).mean())


def _is_reached(world: World, placed: Mapping[str, list[PlacedTour]]) -> bool:
    return _right_from_all(world, placed) >= LEAST_SHARE


def _text(seeds: range) -> str:
    return f"""
A robot is guided start-stop round the loop of `{WORLD}`, through six exits and back to where
it set out: in P1 (S), in P5 (A) or in P4 (B). It then goes on a little way, for it recognises
a place by what it sees there again. `right_from_S` is the share of the seeds {seeds.start} to
{seeds.stop - 1} in which the network at the end is right: every view more than 1 m from a
doorway was taken in the one room that its place is, every room is one place, and the links
are those that the six exits make. A mapper reaches it if it is right from all three starts in
{LEAST_SHARE:.0%} of the seeds; in the thesis it was in its one run from each.

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
