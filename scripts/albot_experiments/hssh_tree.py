"""The tree of topological maps on a floor with nested loops (Beeson et al. 2010, section 6.3)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from albot_core.drawing.palette import EXIT, PLACE
from albot_core.geometry.poses import compose, transform_segments
from albot_core.mappers.hssh.config import HsshConfig
from albot_core.mappers.hssh.map_tree import MapTree, TreeConfig
from albot_core.mappers.hssh.mapper import Hssh
from albot_experiments.drawing import draw_floor
from albot_experiments.hssh_floor import CORRIDORS, ROUTE, at, experience, places_of, world
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import driven_tour

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "hssh-tree"
TITLE = "The tree of topological maps on a floor with nested loops (Beeson et al. 2010)"
PAPER: dict[str, Figures] = {
    "paths": 6,
    "places": 9,
    "local_topologies": 4,
    "travel_actions": 14,
    "maps": 83,
    "minimal_maps": 4,
    "planar_maps": 46,
    "minimal_planar_maps": 1,
    "correct_map_is_minimal": True,
    "milliseconds": 200.0,
}
ASKED = 0.8
"""Share of simulated robots whose preferred map must be the correct one in the end."""
BY_STARS = "robots, by stars alone"
BY_MAPS = "robots, by stars and local maps"
BY_ODOMETRY = "robots, by stars, local maps and odometry"
_AGAIN = 20
"""How often the tree is built to time it."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What became of one simulated robot's map."""

    visits: int
    """Number of visits that it perceived."""
    right: bool
    """Whether its preferred map says rightly of every visit which place it was to."""
    maps: int
    """Number of maps left."""
    minimal: int
    """Number of minimal maps left."""
    has_right: bool
    """Whether the correct map of the visits that have ended is one of the minimal ones."""


def grow(planar: bool) -> MapTree:
    """Return the tree after the route, by the stars as they are drawn."""
    star, travels = experience()
    tree = MapTree(star, TreeConfig(planar=planar, limit=100_000))
    for travel in travels:
        tree.travel(travel)
    return tree


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Build the tree by the drawn stars, and by those that simulated robots perceive.

    Raises:
        InputError: No seeds.
    """
    drives: dict[str, list[Drive]] = {name: [] for name in (BY_STARS, BY_MAPS, BY_ODOMETRY)}
    config = HsshConfig()
    papers = replace(config.places, drift=math.inf)
    configs = {
        BY_STARS: replace(config, places=replace(papers, overlap=0.0, gateway_error=100.0)),
        BY_MAPS: replace(config, places=papers),
        BY_ODOMETRY: config,
    }
    last: Hssh | None = None
    for seed in each_seed(seeds, progress):
        floor = world()
        journey = driven_tour(floor, floor.tours["route"], np.random.default_rng(seed))
        for name, each in configs.items():
            last = Hssh(each)
            for reading in journey.readings:
                last.update(reading)
            drives[name].append(_drive(last))
    assert last is not None
    return report(seeds, drives, picture(last))


def _drive(mapper: Hssh) -> Drive:
    tree, leaf = mapper.tree, mapper.believed_map
    minimal = [] if tree is None else tree.minimal
    known = [[visit.place for visit in each.visits] for each in minimal]
    return Drive(
        has_right=bool(known) and places_of()[: len(known[0])] in known,
        visits=len(leaf.visits),
        right=[visit.place for visit in leaf.visits] == places_of(),
        maps=1 if tree is None else len(tree.maps),
        minimal=max(len(minimal), 1),
    )


def report(seeds: range, drives: Mapping[str, Sequence[Drive]], figure: Figure) -> Report:
    """Return the report of these robots."""
    free, planar = grow(False), grow(True)
    begun = time.process_time()
    for _ in range(_AGAIN):
        grow(True)
    spent = (time.process_time() - begun) / _AGAIN
    right = [[visit.place for visit in leaf.visits] == places_of() for leaf in free.minimal]
    correct = any(right) and [visit.place for visit in planar.best.visits] == places_of()
    star, travels = experience()
    kinds = {each.kind for each in (star, *(travel.star for travel in travels))}
    measured: dict[str, Figures] = {
        "paths": planar.best.paths,
        "places": planar.best.places,
        "local_topologies": len(kinds),
        "travel_actions": len(travels),
        "maps": len(free.maps),
        "minimal_maps": len(free.minimal),
        "planar_maps": len(planar.maps),
        "minimal_planar_maps": len(planar.minimal),
        "correct_map_is_minimal": correct,
        "seeds": len(seeds),
        "milliseconds": 1000.0 * spent,
        **{name: _figures(each) for name, each in drives.items()},
    }
    share = float(np.mean([drive.right for drive in drives[BY_MAPS]]))
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=correct and len(planar.minimal) == 1 and share >= ASKED,
        conditions={
            "environment": (
                "an office with nested loops; offices and cubicles left out",
                f"corridors with nested loops, drawn: {len(CORRIDORS)} between nine places",
            ),
            "route": ("given in a picture", "chosen, so that the outcome is of the same kind"),
            "stars": ("perceived by a robot", "as drawn; and perceived by simulated robots"),
            "processor": ("Pentium III, 450 MHz", "one of today; in Python"),
            "trials": ("one run", f"the drawn stars, and {len(seeds)} robots"),
        },
        text=_text(seeds),
        pictures={"floor": figure},
    )


def _figures(drives: Sequence[Drive]) -> dict[str, Figures]:
    return {
        "robots": len(drives),
        "visits": float(np.median([drive.visits for drive in drives])),
        "map_is_correct": round(float(np.mean([drive.right for drive in drives])), 2),
        "correct_is_minimal": round(float(np.mean([drive.has_right for drive in drives])), 2),
        "maps": float(np.median([drive.maps for drive in drives])),
        "minimal": float(np.median([drive.minimal for drive in drives])),
    }


def picture(mapper: Hssh) -> Figure:
    """Draw the floor with its route, and the gateways and places that a robot found on it."""
    from matplotlib.figure import Figure as NewFigure

    floor = world()
    figure = NewFigure(figsize=(9.0, 6.5), layout="constrained")
    axes = figure.subplots()
    draw_floor(axes, floor.walls)
    tour = np.array([at(junction) for junction in ROUTE])
    axes.plot(*tour.T, color="0.6", lw=1.0, label="route")
    graph = mapper.snapshot().place_graph
    start = floor.starts[0]
    for k, node in enumerate(graph.nodes):
        pose = compose(start, node.pose)
        for line in transform_segments(pose, node.segments):
            axes.plot(line[[0, 2]], line[[1, 3]], color=EXIT, lw=2.0)
        axes.text(float(pose[0]), float(pose[1]), node.label, color=PLACE, ha="center", va="center")
        axes.plot([], [], color=EXIT, label="gateways") if k == 0 else None
    axes.legend(loc="lower left", fontsize="small")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    return figure


def _text(seeds: range) -> str:
    return f"""
The paper's floor is not given as a plan. Ours has its numbers of paths, places and local
topologies: a lattice of three corridors along and three across, of which one ends dead. Floor and
route were chosen among random ones for an outcome of the paper's kind: without planarity several
maps are minimal, and with it one is, the correct one. That the number of planar maps is the paper's
is by this choice; all maps are fewer than the paper's, and so are the minimal ones.

Then a robot with the odometer `pioneer` is led over the floor, {len(ROUTE) - 1} travel actions,
once for each of the seeds {seeds.start} to {seeds.stop - 1}. The mapper `hssh` perceives gateways
and stars by its laser. It compares visits by the stars alone, by stars and local maps as in the
paper, or by the odometry as well, as by default. `map_is_correct`: the share of robots whose
preferred map says rightly of every visit which place it was to. `correct_is_minimal`: the share for
which that map is among the minimal ones of the visits that have ended. Asked are one minimal planar
map by the drawn stars, the correct one, and {ASKED:.0%} of the robots with a correct map by stars
and local maps. Maps and minimal maps are medians; they are those that agree with the visits that
have ended. Thresholds were chosen on seeds 500 to 579.

Paths and places are minimised in this order (Remolina and Kuipers 2004).
"""
