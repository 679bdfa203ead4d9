"""Albot0's seven local spaces, out and home (Hossain 2014, figure 2.21)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from albot_core.drawing.labels import Label, place_labels
from albot_core.drawing.palette import SERIES
from albot_core.geometry.types import Points
from albot_core.mappers.albot0.geometric_map import GeometricMap
from albot_env.sim.sonar import SONARS
from albot_experiments.albot0_runs import MAPPERS, SONAR_CONDITIONS, Tracked
from albot_experiments.drawing import MARK, PATH, SURFACE, draw_floor, finish_maps
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import driven_tour
from albot_maps import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "albot0-spaces"
TITLE = "Albot0's seven local spaces, out and home (Hossain 2014, figure 2.21)"
SPACES: tuple[tuple[float, float, float, float], ...] = (
    (0.0, 0.0, 6.0, 6.0),
    (6.0, 2.0, 16.0, 4.0),
    (16.0, 0.0, 23.0, 6.0),
    (18.5, 6.0, 20.5, 15.0),
    (15.0, 15.0, 24.0, 22.0),
    (5.0, 17.5, 15.0, 19.5),
    (-2.0, 15.0, 5.0, 22.0),
)
"""Low and high corners of the floor's seven spaces (m): rooms and the corridors between them."""
BORDERS = np.array(((6.0, 3.0), (16.0, 3.0), (19.5, 6.0), (19.5, 15.0), (15.0, 18.5), (5.0, 18.5)))
"""The middles of the openings from each space into the next (m)."""
START = np.array((1.5, 3.0))
"""Where the robot starts, in the first room (m)."""
AWAY, TURNS = 1.3, 2
"""Distance from a room's walls at which the robot turns (m), and how often it does at most."""
NEAR = 2.0
"""A border is found if an ASR ends within this distance of it on the way out (m)."""
HEARING = "pioneer"
"""The sonars: with specular loss and cross-talk."""
PAPER: Mapping[str, Figures] = {
    "local_spaces": 7,
    "maps_differ": True,
    "sums_alike": True,
    "home_believed": 0.7,
}
"""Of the figure's trial: seven local spaces on the way out, different maps out and home, and "the
sum of the distance traversed is almost the same"; of all trials: "success rate … was 70%"."""
LEAST_FOUND, MOST_OFF, LEAST_HOME = 0.9, 0.1, 0.7
"""Bounds: least share of borders that are found; largest median difference of the summed lengths
of the two maps, as a share; and the least share of runs in which the robot knows home."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A journey out and home, as a mapper had it."""

    robot: Tracked
    home: Points
    """(readings, 2): the robot's true positions on its way home (m)."""
    is_home: bool
    """Whether the robot believes to be in its home ASR at the end."""

    @property
    def maps(self) -> tuple[GeometricMap, GeometricMap]:
        """The map of the way out, and that of the way home."""
        out, home = self.robot.mapper.geometric_maps
        return out, home

    @property
    def found(self) -> int:
        """Number of borders that the way out has found."""
        ends = self.robot.out[np.flatnonzero(np.diff(self.robot.places))]
        away = np.hypot(*(BORDERS[:, None] - ends[None]).transpose(2, 0, 1))
        return int((away.min(axis=1, initial=np.inf) <= NEAR).sum())

    @property
    def difference(self) -> float:
        """Difference of the summed lengths of the two maps, as a share of that of the way out."""
        out, home = (float(each.regions.lengths.sum()) for each in self.maps)
        return abs(home - out) / out

    @property
    def do_maps_differ(self) -> bool:
        """Whether the two maps have other ASRs: another number, or one of another length by 0.5 m.

        A place has one length on both ways if it was mapped alike.
        """
        out, home = (each.regions.lengths for each in self.maps)
        return len(out) != len(home) or bool((np.abs(out - home[::-1]) > 0.5).any())


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home once per seed.

    Raises:
        InputError: No seeds.
    """
    floor = world()
    runs: dict[str, list[Run]] = {mapper: [] for mapper in MAPPERS}
    for seed in each_seed(seeds, progress):
        for mapper, each in drive(floor, seed).items():
            runs[mapper].append(each)
    return report(floor, runs, seeds)


def world() -> World:
    """Return the floor."""
    floor = shapely.union_all([shapely.box(*space) for space in SPACES]).simplify(0.0)
    ring = np.array(floor.exterior.coords)
    walls = np.hstack((ring[:-1], ring[1:]))
    start = np.array((*START, 0.0))
    return World(name="albot0-spaces", walls=walls, starts=start[None])


def way_out(rng: np.random.Generator) -> Points:
    """Return a way through all spaces: through the corridors, and with turns in the rooms (m)."""
    stops = [START]
    for space, border in zip(SPACES, (*BORDERS, None), strict=True):
        if min(space[2] - space[0], space[3] - space[1]) > 2 * AWAY:
            count = int(rng.integers(1, TURNS + 1))
            low, high = np.array(space[:2]) + AWAY, np.array(space[2:]) - AWAY
            stops += list(rng.uniform(low, high, (count, 2)))
        if border is not None:
            stops.append(border)
    return np.array(stops)


def drive(floor: World, seed: int) -> dict[str, Run]:
    """Drive a robot out, and home by other turns in the same rooms; return each mapper's run."""
    rng = np.random.default_rng(seed)
    out, back = way_out(rng), way_out(rng)[::-1]
    stops = np.concatenate((out, back))
    journey = driven_tour(floor, stops, rng, sonar=SONARS[HEARING])
    truth = journey.truth[:, :2]
    turned = int(np.hypot(*(truth - out[-1]).T).argmin())
    runs = {}
    for mapper, cues in MAPPERS.items():
        robot = Tracked(mapper)
        robot.go_out(journey.readings[: turned + 1], truth[: turned + 1])
        for reading, place in zip(journey.readings[turned + 1 :], truth[turned + 1 :], strict=True):
            robot.go_home(reading, place)
        robot.end(truth[-1])
        is_home = robot.believes_in(cues) == 0
        runs[mapper] = Run(robot=robot, home=truth[turned:], is_home=is_home)
    return runs


def report(floor: World, runs: Mapping[str, Sequence[Run]], seeds: range) -> Report:
    """Return the report of the runs of each mapper."""
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    verdicts = {}
    for mapper, each in runs.items():
        spaces = float(np.median([run.maps[0].regions.count for run in each]))
        off = float(np.median([run.difference for run in each]))
        found = float(np.mean([run.found for run in each])) / len(BORDERS)
        home = float(np.mean([run.is_home for run in each]))
        differ = float(np.mean([run.do_maps_differ for run in each]))
        measured[mapper] = {
            "local_spaces": spaces,
            "local_spaces_home": float(np.median([run.maps[1].regions.count for run in each])),
            "exactly_seven": round(
                float(np.mean([run.maps[0].regions.count == len(SPACES) for run in each])), 2
            ),
            "borders_found": round(found, 2),
            "maps_differ": round(differ, 2),
            "sums_differ_by": round(off, 3),
            "home_believed": round(home, 2),
        }
        is_alike = off <= MOST_OFF
        verdicts[mapper] = (
            spaces == len(SPACES)
            and found >= LEAST_FOUND
            and differ > 0.5
            and is_alike
            and home >= LEAST_HOME
        )
        if mapper == "albot0":
            measured |= {
                "local_spaces": spaces,
                "maps_differ": differ > 0.5,
                "sums_alike": is_alike,
                "home_believed": round(home, 2),
            }
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=verdicts["albot0"],
        verdicts=verdicts,
        conditions={
            **SONAR_CONDITIONS,
            "environment": (
                "an office floor, in a picture that is not in the text",
                "seven spaces: four rooms and the three corridors between them",
            ),
            "trials": ("one shown", f"{len(seeds)}, each with other turns in the rooms"),
            "way home": ("by its map", "led through the same spaces, with other turns"),
        },
        text=_text(seeds),
        pictures={f"spaces-{mapper}": _picture(floor, each[0]) for mapper, each in runs.items()},
    )


def _text(seeds: range) -> str:
    return f"""
The thesis shows a trial of Albot0 (figure 2.21, after Yeap 2011 and Wong 2009): on the way out it
computes seven local spaces; the map of the way home is another; "even though the number of local
spaces computed in the outward and inward journeys is different, the sum of the distance traversed
is almost the same", and so it came home in 70 % of its trials. The floor itself is a picture. Ours
has seven spaces in a row, four rooms and the corridors between them, and the robot is led through
them by one or two turns in each room, drawn at random, once for each of the seeds {seeds.start} to
{seeds.stop - 1}; on the way home by other turns. In the thesis the robot drives by itself.

`local_spaces` and `local_spaces_home`: the number of ASRs of the two maps, medians;
`exactly_seven`: in how many runs the way out has seven; `borders_found`: the share of the six
openings within {NEAR:g} m of which an ASR ends; `maps_differ`: in how many runs the two maps differ
in the number of their ASRs, or in the length of one by more than 0.5 m; `sums_differ_by`: by what
share the sums of their ASRs' lengths differ, the median; `home_believed`: how often the robot
believes to be in its home ASR when it stands at its start.

Reached where the median is {len(SPACES)} spaces, {LEAST_FOUND:.0%} of the borders are found, the
maps differ in most runs while the sums do by {MOST_OFF:.0%} at most, and home is known in
{LEAST_HOME:.0%} of the runs. Floor and bounds were chosen on seeds below 20. `albot0` parts
corridors where they bend (`regions.bend`); a room in which the way turns sharply is parted there,
too, so it has more spaces than the letter.

The pictures show the first seed as the figure does: above, the floor with the ways out and home,
each local space shaded; below, the two maps as the odometer has them, in which a local space lies
between two successive filled circles.
"""


def _picture(floor: World, run: Run) -> Figure:
    """Draw the figure: floor, way and spaces above, the maps below; out left, home right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 11), layout="constrained")
    axes = figure.subplots(2, 2)
    out, home = run.maps
    before = len(run.robot.out) - 1
    home_places = np.array([home.region_at(before + k) for k in range(len(run.home))])
    columns = (
        ("ab", "way out", run.robot.out, run.robot.places, out, ("start", "stop")),
        ("cd", "way home", run.home, home_places, home, ("stop", "start")),
    )
    for (above, below), (letters, name, way, places, drawn, ends) in zip(
        axes.T, columns, strict=True
    ):
        above.set_title(f"({letters[0]}) {name}")
        _draw_spaces(above, floor, way, places, ends)
        below.set_title(f"({letters[1]}) map of the {name}: {drawn.regions.count} local spaces")
        _draw_map(below, drawn)
    finish_maps(figure)
    return figure


def _draw_spaces(
    axes: Axes, floor: World, way: Points, places: np.ndarray, ends: tuple[str, str]
) -> None:
    """Draw the floor, a way, and the shaded local spaces along it."""
    from matplotlib.patches import Ellipse

    draw_floor(axes, floor.walls, SURFACE)
    labels = []
    for place in range(int(places.max()) + 1):
        own = way[places == place]
        spread = np.cov(own.T) if len(own) > 1 else np.zeros((2, 2))
        sizes, axis = np.linalg.eigh(spread)
        width, height = 4 * np.sqrt(np.maximum(sizes[::-1], 0)) + 1.0
        angle = np.degrees(np.arctan2(axis[1, 1], axis[0, 1]))
        colour, middle = SERIES[place % len(SERIES)], own.mean(axis=0)
        shade = Ellipse(middle, width, height, angle=angle, fc=colour, ec=colour, lw=1.5, alpha=0.3)
        axes.add_patch(shade)
        at = (float(middle[0]), float(middle[1]))
        labels.append(Label(text=str(place + 1), at=at, colour=colour, size=12.0, weight="bold"))
    axes.plot(*way.T, color=PATH, lw=1.2, label="true way")
    for name, (x, y) in zip(ends, way[[0, -1]].tolist(), strict=True):
        axes.plot(x, y, "s", color=MARK, ms=6)
        labels.append(Label(text=name, at=(x, y), colour=MARK, radius=4.0))
    place_labels(axes, labels, segments=floor.walls)


def _draw_map(axes: Axes, drawn: GeometricMap) -> None:
    """Draw a map: its surfaces, the way in it, and the points that part its local spaces."""
    draw_floor(axes, drawn.steps.surfaces, SURFACE, 1.2, "surfaces of the map")
    way = drawn.steps.lines
    points = np.concatenate((way[:1, :2], way[:, 2:]))
    axes.plot(*points.T, color=PATH, lw=1.0, label="way in the map")
    ends = np.concatenate((drawn.regions.lines[:, :2], drawn.regions.lines[-1:, 2:]))
    axes.plot(*ends.T, "o", color=MARK, ms=6, ls="none", label="ends of local spaces")
