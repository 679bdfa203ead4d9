"""Experiment 2 of the Albot1 thesis's chapter 4: recognising familiar places (section 4.2.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import relative
from albot_core.mappers.albot1.places.events import Event, EventKind
from albot_experiments.albot1_conditions import THESIS_LASER, THESIS_MOTION, THESIS_ODOMETER
from albot_experiments.albot1_places import PlacedTour, place_tour
from albot_experiments.albot1_truth import LEAST_DESCRIBED, LEAST_ON_WALLS, Judged
from albot_experiments.drawing import draw_place_graph, draw_route, finish_maps
from albot_experiments.mapping import ALBOT1
from albot_experiments.report import Figures, Report, compared, each_seed
from albot_experiments.tours import guided_tour
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-c2"
TITLE = "Recognizing familiar places (Hossain 2014, section 4.2.2, figures 4.4 to 4.6)"
WORLD, TOUR = "office-double", "double-loop"
TAKEN_FOR_P7 = slice(19, 22)
"""The tour's waypoints in the part of P1 that the robot does not know, and takes for P7."""
PAPER: dict[str, Figures] = {
    "path_m": 150.0,
    "places": 7,
    "links": 8,
    "network_right": 1.0,
    "story_told": 1.0,
}
LEAST_SHARE = 0.8
"""Minimum share of the seeds in which network, exits and descriptions must be right and the story
as in the thesis."""
ENTRANCE = 3.0
"""Length of the way into P7 on which P1 must not be compared (m)."""
CONDITIONS: Mapping[str, tuple[str, str]] = {
    "environment": (
        "the same office floor as in experiment 1, with a room and 2 exits more",
        f"simulated, `{WORLD}`: drawn after figure 4.4, 8 exits of 1 m",
    ),
    "path": ("about 150 m", "160 m: the double loop, and 8 m more into P7"),
    "motion": THESIS_MOTION,
    "laser": THESIS_LASER,
    "odometer": THESIS_ODOMETER,
    "trials": ("1", "1 for each seed"),
    "judged": ("by eye", "against the true floor, and by the log of events"),
}

Beat = tuple[EventKind, str, str]
"""A kind of event, the place in which the robot believes to be, and the other place."""

STORY: tuple[Beat, ...] = (
    (EventKind.NEW, "P1", "P2"),
    (EventKind.NEW, "P2", "P3"),
    (EventKind.NEW, "P3", "P4"),
    (EventKind.NEW, "P4", "P5"),
    (EventKind.NEW, "P5", "P6"),
    (EventKind.NEW, "P6", "P7"),
    (EventKind.ENTERED, "P7", "P6"),
    (EventKind.NEW, "P6", "P8"),
    (EventKind.NEW, "P8", "P9"),
    (EventKind.RECOGNIZED, "P9", "P2"),
    (EventKind.ENTERED, "P2", "P1"),
    (EventKind.RECOGNIZED, "P1", "P7"),
)
"""The thesis's story. The robot enters P2 as an unknown place, here P9, and recognises it there."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Guide the robot along the double loop, once per seed, and judge its network.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    tour = and_on(world.tours[TOUR])
    placed: dict[str, list[PlacedTour]] = {name: [] for name in ALBOT1}
    for seed in each_seed(seeds, progress):
        journey = guided_tour(world, tour, np.random.default_rng(seed))
        for name in ALBOT1:
            placed[name].append(place_tour(name, world, journey))
    return _report(world, seeds, placed)


def and_on(tour: Float64[np.ndarray, "waypoints 2"]) -> Float64[np.ndarray, "tour 2"]:
    """Return the double loop, continued a little way into P7, which may then be found to be P1."""
    return np.concatenate((tour, tour[TAKEN_FOR_P7]))


def story(events: Iterable[Event]) -> tuple[Beat, ...]:
    """Return the events, without the refused candidates."""
    quiet = (EventKind.SET_OUT, EventKind.REFUSED)
    return tuple(
        (event.kind, f"P{event.place + 1}", f"P{event.other + 1}")
        for event in events
        if event.kind not in quiet
    )


def is_unchecked(placed: PlacedTour) -> bool:
    """Return whether P1 is not compared at the entrance of its unknown part, P7.

    There "there are not enough of them to trigger a check". Comparisons that no re-observed surface
    brought about do not count: they are ours, and the gate has no part in them.
    """
    truth = placed.journey.truth[:, :2]
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(truth, axis=0).T))))
    entered = next((e.step for e in placed.events if (e.kind, e.other) == (EventKind.NEW, 6)), None)
    if entered is None:
        return False
    return not any(
        event.kind in (EventKind.REFUSED, EventKind.RECOGNIZED)
        and (event.place, event.other) == (6, 0)
        and event.gate >= 0
        and way[event.step - 1] - way[entered - 1] < ENTRANCE
        for event in placed.events
    )


def _report(world: World, seeds: range, placed: dict[str, list[PlacedTour]]) -> Report:
    judged = {name: [Judged.of(each, world) for each in runs] for name, runs in placed.items()}
    groups: dict[str, Figures] = {name: _figures(runs) for name, runs in judged.items()}
    verdicts = {
        name: float(np.mean([_is_reached(each) for each in runs])) >= LEAST_SHARE
        for name, runs in judged.items()
    }
    ours = groups["albot1"]
    assert isinstance(ours, Mapping)
    order = np.argsort([_error(each) for each in placed["albot1"]], kind="stable")
    middle = int(order[len(order) // 2])
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={**ours, "seeds": len(seeds), **groups},
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared=compared(groups, ALBOT1, ("network_right", "story_told", "all", "places")),
        conditions=CONDITIONS,
        text=_text(seeds, seeds[middle], placed["albot1"][middle]),
        pictures={"network": _picture(world, {name: of[middle] for name, of in placed.items()})},
    )


def _is_reached(judged: Judged) -> bool:
    """Return whether the network is all right, and arose as in the thesis."""
    placed = judged.placed
    return judged.is_reached and story(placed.events) == STORY and is_unchecked(placed)


def _figures(judged: list[Judged]) -> dict[str, Figures]:
    """Return the figures of one mapper, over the seeds."""
    placed = [each.placed for each in judged]

    def share(found: Iterable[bool]) -> float:
        return round(float(np.mean(list(found))), 3)

    return {
        "path_m": round(float(np.median([each.journey.path_length for each in placed])), 1),
        "places": int(np.median([len(each.place_graph.nodes) for each in placed])),
        "links": int(np.median([len(each.place_graph.links) for each in placed])),
        "network_right": share(each.is_right for each in judged),
        "story_told": share(story(each.events) == STORY for each in placed),
        "not_checked_at_entrance": share(map(is_unchecked, placed)),
        "exits_right": share(each.has_exits_right for each in judged),
        "described": share(each.is_described for each in judged),
        "all": share(map(_is_reached, judged)),
    }


def _error(placed: PlacedTour) -> float:
    """Return how far the map has drifted at the end of the journey (m)."""
    truth = placed.journey.truth
    return float(np.hypot(*(relative(truth[0], truth[-1]) - placed.poses[-1])[:2]))


def _text(seeds: range, seed: int, placed: PlacedTour) -> str:
    log = "\n".join(str(event) for event in placed.events)
    return f"""
A robot is guided start-stop along the tour `{TOUR}` of `{WORLD}`: once round the ring, into a
part of P1 that it has not seen, where it must not know P1 again; back through E6, through P8
into P2 from a side that it has not seen either, and through E1 into P1. There the tour ends;
the robot goes on into the part of P1 that it took for a place of its own.

`network_right` is the share of the seeds {seeds.start} to {seeds.stop - 1} in which the
network at the end is right: every view more than 1 m from a doorway was taken in the one room
that its place is, every room is one place, and the links are those that the eight exits make.
`story_told` is the share in which it came about as in the thesis: P1 is not recognised and
becomes P7; the exit known leads back to P6; P8 is new; P2 is recognised by its structure, P1
by the exit, and P7 is found to be P1. `not_checked_at_entrance` is the share in which P1 is not
compared with P7 on the first {ENTRANCE:g} m in P7, for too few of its surfaces are met again.
`exits_right` and `described` are those of `albot1-c1`: all three values of every exit are right;
the surfaces of each place are at least {LEAST_DESCRIBED:.0%} of the walls seen in its room, and
{LEAST_ON_WALLS:.0%} of all surfaces are walls. A mapper reaches it if all five are so in
{LEAST_SHARE:.0%} of the seeds (`all`).

What happened to `albot1` with the seed whose map drifts as far as the median, {seed}:

```
{log}
```
"""


def _picture(world: World, placed: dict[str, PlacedTour]) -> Figure:
    """Draw the route and each mapper's network, as figures 4.4 and 4.6."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6 * (1 + len(placed)), 6), layout="constrained")
    route, *others = figure.subplots(1, 1 + len(placed))
    draw_route(route, world, world.tours[TOUR])
    route.set_title(f"{WORLD}: {TOUR}")
    for axes, (name, each) in zip(others, placed.items(), strict=True):
        draw_place_graph(axes, world, each.place_graph, each.journey.truth[0])
        axes.set_title(f"{name}: network of places")
    finish_maps(figure)
    return figure
