"""When Albot1 updates its map, and what a second visit erases (figures 3.16 and 3.17)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from albot_core.geometry.types import Points, Segments
from albot_env.sim.simulator import THESIS_STEPS, StartStop
from albot_experiments.albot1_conditions import thesis_conditions
from albot_experiments.drawing import MARK, PATH, SURFACE, draw_floor, finish_maps
from albot_experiments.mapping import (
    ALBOT1,
    MappedJourney,
    Walls,
    map_readings,
    surface_points,
)
from albot_experiments.report import Figures, Report, compared, each_seed
from albot_experiments.revisiting import before_revisiting
from albot_experiments.tours import TourRecord, guided_tour
from albot_maps import World, load_world

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "albot1-e1b"
TITLE = "Updates and wiping (Hossain 2014, section 3.2.1, figures 3.16 and 3.17)"
PAPER: dict[str, Figures] = {
    "corridor_updates_per_view": round(7 / 11, 2),
    "open_updates_per_view": round(3 / 10, 2),
    "old_corridor_is_wiped": True,
}
CONDITIONS = thesis_conditions(
    "`office-ring`",
    ("start-stop, moves of 3 m on average", "start-stop, 3 m or 45°"),
    ("one journey each", "100 seeds each"),
)
WORLD, TRACED, REVISITED = "office-ring", "single-loop", "revisit"
TRACE_STEPS = StartStop(move=3.0, turn=np.radians(45.0))
"""The steps of figure 3.17: a move is about 3 m."""
CORRIDORS, OPEN = ("P3", "P5"), ("P1", "P2")
"""The floor's corridors, and its larger rooms."""
LEAST_RATIO = 1.5
"""Minimum ratio of the update rates in corridors and in the open; in the thesis it is 2."""
NEAR = 1.2
"""The robot passes walls that are at most this far from its way (m): half the width of the corridor
that it goes through again, so that the far side of the walls does not count."""
LEAST_WIPED, MOST_LENGTH = 0.9, 1.25
"""Minimum share of the passed walls that must be erased, and maximum length of wall held afterwards
for each metre of wall seen: old walls beside new ones would make it longer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """One mapper's updates in steps of 3 m, and what its second visit erased."""

    updated: np.ndarray
    """(views,) bool: the views at which the map was updated."""
    rooms: tuple[str | None, ...]
    """The room in which each view was taken."""
    wiped: float
    """Share of the remembered walls passed again that is no longer in the map."""
    length: float
    """Length of the walls in the map there at the end, for each metre of wall seen there."""
    before: Segments
    after: Segments
    """The map's surfaces before the robot comes back, and at the end (m)."""
    mapped: MappedJourney

    def rate(self, rooms: tuple[str, ...]) -> float:
        """Return the number of updates for each view taken in the rooms."""
        return float(self.updated[[room in rooms for room in self.rooms]].mean())


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Guide the robot round the ring, and round it and on, once per seed.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    traces: dict[str, list[Trace]] = {name: [] for name in ALBOT1}
    for seed in each_seed(seeds, progress):
        rng = np.random.default_rng(seed)
        once = guided_tour(world, world.tours[TRACED], rng, steps=TRACE_STEPS)
        twice = guided_tour(world, world.tours[REVISITED], rng, steps=THESIS_STEPS)
        for name in ALBOT1:
            traces[name].append(trace(name, world, once, twice))
    return _report(seeds, world, traces)


def trace(name: str, world: World, once: TourRecord, twice: TourRecord) -> Trace:
    """Lead a mapper along both journeys: its updates on the first, what it erases on the second."""
    updates = map_readings(name, once.readings).updates
    view = before_revisiting(world, twice)
    mapped = map_readings(name, twice.readings, [view])
    before, after = mapped.surfaces[view], mapped.surfaces[len(twice.readings) - 1]
    way = mapped.poses[view:, :2]
    walls = Walls.of_journey(world.walls, twice.readings[view:], twice.truth[view:])
    seen = len(_passed(walls.seen, twice.truth[view:, :2]))
    return Trace(
        updated=np.diff(updates, prepend=0) > 0,
        rooms=tuple(world.room_at(x, y) for x, y in once.truth[:, :2]),
        wiped=wiped_share(before, after, way),
        length=len(_passed(surface_points(after), way)) / max(seen, 1),
        before=before,
        after=after,
        mapped=mapped,
    )


def wiped_share(before: Segments, after: Segments, way: Points) -> float:
    """Return the share of the length of `before`, near the way, whose surfaces `after` lacks."""
    kept = {tuple(surface) for surface in after.tolist()}
    is_kept = np.array([tuple(surface) in kept for surface in before.tolist()], np.bool_)
    still, gone = (len(_passed(surface_points(before[rows]), way)) for rows in (is_kept, ~is_kept))
    return gone / max(still + gone, 1)


def _passed(points: Points, way: Points) -> Points:
    """Return the points that the way passes."""
    return points[KDTree(way).query(points)[0] <= NEAR] if len(points) else points


def _report(seeds: range, world: World, traces: dict[str, list[Trace]]) -> Report:
    groups: dict[str, Figures] = {name: _figures(of) for name, of in traces.items()}
    verdicts = {name: _is_reached(of) for name, of in traces.items()}
    ours = _figures(traces["albot1"])
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={**ours, "seeds": len(seeds), **groups},
        holds=verdicts["albot1"],
        verdicts=verdicts,
        compared=compared(groups, ALBOT1, tuple(ours)),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"wiping": _picture(world, traces)},
    )


def _median(values: list[float]) -> float:
    return round(float(np.median(values)), 2)


def _figures(traces: list[Trace]) -> dict[str, Figures]:
    """Return the figures of one mapper, over the seeds."""
    wiped = _median([each.wiped for each in traces])
    return {
        "corridor_updates_per_view": _median([each.rate(CORRIDORS) for each in traces]),
        "open_updates_per_view": _median([each.rate(OPEN) for each in traces]),
        "wiped": wiped,
        "length_held": _median([each.length for each in traces]),
        "old_corridor_is_wiped": wiped >= LEAST_WIPED,
    }


def _is_reached(traces: list[Trace]) -> bool:
    """Return whether updates are denser in corridors, and old walls are erased and not doubled."""
    rates = [(each.rate(CORRIDORS), each.rate(OPEN)) for each in traces]
    corridor, space = np.median(rates, axis=0)
    return bool(
        corridor >= LEAST_RATIO * space
        and np.median([each.wiped for each in traces]) >= LEAST_WIPED
        and np.median([each.length for each in traces]) <= MOST_LENGTH
    )


def _text(seeds: range) -> str:
    return f"""
Figure 3.17 is a trace of one run: seven updates in eleven moves down a corridor, where few
landmarks are near, and three in ten views in the open. Here a robot is guided round `{WORLD}` in
moves of 3 m, as there; the corridors are {" and ".join(CORRIDORS)}, the open rooms
{" and ".join(OPEN)}.

Figure 3.16 shows what a second visit does: the old corridor is wiped, and built anew where it is
now seen. Here a robot goes round and on along `{REVISITED}`, in steps of 1 m and 45°. `wiped`: of
the walls remembered when it comes back, within {NEAR} m of its way from there on, the share that is
not in the map as it was any more. `length_held` is how much wall the map then holds there for each
metre that is seen: old walls left beside new ones would make it more than 1.

Medians over the seeds {seeds.start} to {seeds.stop - 1}. A mapper reaches it if it updates
{LEAST_RATIO} times as often in the corridors, and wipes {LEAST_WIPED:.0%} or more with no more than
{MOST_LENGTH} m held. Places are left out (chapter 4): no exit forces an update.
"""


def _picture(world: World, traces: dict[str, list[Trace]]) -> Figure:
    """Draw the first seed's map when the robot comes back, and at the end, with the way between."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5 * len(traces), 10), layout="constrained")
    columns = figure.subplots(2, len(traces)).T
    for (name, several), (first, last) in zip(traces.items(), columns, strict=True):
        each, start = several[0], several[0].mapped.poses
        for axes, surfaces, when in (
            (first, each.before, "when it comes back"),
            (last, each.after, "at the end"),
        ):
            draw_floor(axes, surfaces, SURFACE, 1.0, "surfaces of the map")
            axes.plot(start[:, 0], start[:, 1], color=PATH, lw=0.6, label="estimated path")
            axes.plot(*start[0, :2], "o", color=MARK, ms=5, ls="none", label="start")
            axes.set_title(f"{name}, {when}")
        last.set_xlabel(f"{each.wiped:.0%} of what is passed again is wiped")
    finish_maps(figure)
    return figure
