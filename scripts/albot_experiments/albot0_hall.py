"""Two journeys through a room larger than the sonars reach (Schmidt, Wong and Yeap, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from albot_core.drawing.labels import Label, place_labels
from albot_core.drawing.palette import SERIES
from albot_core.geometry.types import Points
from albot_core.mappers.albot0.geometric_map import GeometricMap
from albot_core.mappers.albot0.localisation import CUES as CUE_MAPS
from albot_core.mappers.albot0.localisation import Confidences
from albot_env.sim.sonar import SONARS
from albot_experiments.albot0_runs import (
    BORDER,
    CUES,
    MAPPERS,
    SONAR_CONDITIONS,
    Stop,
    Tracked,
)
from albot_experiments.drawing import MARK, PATH, SURFACE, draw_floor, finish_maps
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import driven_tour
from albot_maps import Room, World, load_world
from albot_maps.routes import Routes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "albot0-2"
TITLE = "ASRs of a room larger than the sonars reach (Schmidt et al., figures 1 to 4)"
WORLD, ROOM = "office-hall", "hall"
ENDS = ("W1", "W2", "W3", "E1", "E2", "E3")
"""The rooms beside the world's corridors."""
TURNS = {"journey-1": (23.5, 9.4), "journey-2": (23.4, 14.6)}
"""The journeys, and the point where the robot turns round on each (m)."""
STOPS = "ABCDEF"
"""Stops for which the confidences are drawn: evenly spread over the way home, as the paper's."""
INSIDE = 1.0
"""The robot is inside the room if it is at least this far from its walls and exits (m)."""
NEAR = 2.0
"""A split point is near an exit of the room if it is at most this far from it along the way (m)."""
CHANCE = "ways drawn at random"
"""Name of the journeys from one room to another through the large room, where they turn often."""
TURNED = (1, 7)
"""Minimum and maximum number of turns in the large room on a way drawn at random."""
AWAY = 1.2
"""Minimum distance of these turns from the room's walls (m)."""
PAPER = {"large_room_one_asr": 1.0, "splits_near_exits": True}
ASKED = {"albot0-paper": 0.7, "albot0": 0.9}
"""For each mapper, minimum share of the stops at which its ASR must be right or one at a border,
and of the runs in which it must know home: for the letter the success rate of its robot (Hossain
2014, section 2.3.4)."""
WHOLE = 0.9
"""Minimum share of the runs in which the large room must be one ASR: on the paper's two journeys
for the letter, and on ways drawn at random too for ours."""


@dataclass(frozen=True, kw_only=True)
class Split:
    """The split of the large room on a way drawn at random."""

    asrs: int
    """Number of ASRs of the way."""
    is_whole: bool
    """Whether the large room is one ASR."""
    distances: tuple[float, float]
    """Distances of the room's split points from where the way first entered and last left it
    (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A journey out and home."""

    robot: Tracked
    stops: tuple[Stop, ...]
    """The beliefs at all stops."""
    home: Points
    """(readings, 2): the robot's true positions on its way home (m)."""
    drawn: tuple[tuple[Points, tuple[Confidences, ...]], ...]
    """For each stop: the robot's position, and the confidences of each cue and of both together."""
    is_whole: bool
    """Whether the large room is one ASR."""
    split_distance: float
    """Distance of the room's split points from its exits, the median along the way (m)."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home once per seed and journey, and once more out on a way drawn at random.

    Raises:
        InputError: No seeds.
    """
    world = load_world(WORLD)
    runs: dict[str, list[dict[str, Run]]] = {name: [] for name in TURNS}
    splits: dict[str, list[Split]] = {mapper: [] for mapper in MAPPERS}
    for seed in each_seed(seeds, progress):
        for name in TURNS:
            runs[name].append(drive(world, name, seed))
        for mapper in MAPPERS:
            splits[mapper].append(drive_at_random(world, seed, mapper))
    return _report(seeds, world, runs, splits)


def drive(world: World, name: str, seed: int) -> dict[str, Run]:
    """Drive a robot along a journey; return the run of each mapper."""
    journey = driven_tour(
        world, world.tours[name], np.random.default_rng(seed), sonar=SONARS["pioneer"]
    )
    truth = journey.truth[:, :2]
    turned = int(np.hypot(*(truth - TURNS[name]).T).argmin())
    runs = {}
    for mapper, cues in MAPPERS.items():
        robot = Tracked(mapper)
        drawn: list[tuple[Points, tuple[Confidences, ...]]] = []
        robot.go_out(journey.readings[: turned + 1], truth[: turned + 1])
        for reading, place in zip(journey.readings[turned + 1 :], truth[turned + 1 :], strict=True):
            robot.go_home(reading, place)
            if len(drawn) < len(robot.stops[cues]):
                drawn.append((place, _confidences(robot, cues)))
        robot.end(truth[-1])
        whole, distances = _judge_room(world, robot)
        runs[mapper] = Run(
            robot=robot,
            stops=tuple(robot.stops[cues]),
            home=truth[turned:],
            drawn=tuple(drawn),
            is_whole=whole,
            split_distance=float(np.median(distances)),
        )
    return runs


def drive_at_random(world: World, seed: int, mapper: str = "albot0") -> Split:
    """Drive a robot out through the large room on a way drawn at random, and map the way."""
    rng = np.random.default_rng(seed)
    journey = driven_tour(world, _way_at_random(world, rng), rng, sonar=SONARS["pioneer"])
    robot = Tracked(mapper)
    robot.go_out(journey.readings, journey.truth[:, :2])
    whole, distances = _judge_room(world, robot)
    return Split(asrs=int(robot.places.max()) + 1, is_whole=whole, distances=distances)


def _way_at_random(world: World, rng: np.random.Generator) -> Points:
    """Return a way from a room into the large one, through points there, and to another room."""
    boundary = _large_room(world).boundary
    low, high = boundary.min(axis=0) + AWAY, boundary.max(axis=0) - AWAY
    exits = [each.segment for each in world.exits if ROOM in each.rooms]
    entry, way_out = rng.permutation(len(exits))[:2].tolist()
    turns = rng.uniform(low, high, (int(rng.integers(TURNED[0], TURNED[1] + 1)), 2))
    rooms = [room.boundary for room in world.rooms if room.name in ENDS]
    start, end = rng.permutation(len(rooms))[:2].tolist()
    stops = [
        0.5 * (rooms[start].min(axis=0) + rooms[start].max(axis=0)),
        0.5 * (exits[entry][:2] + exits[entry][2:]),
        *turns,
        0.5 * (exits[way_out][:2] + exits[way_out][2:]),
        0.5 * (rooms[end].min(axis=0) + rooms[end].max(axis=0)),
    ]
    return Routes(world).through(np.array(stops))


def _large_room(world: World) -> Room:
    return next(room for room in world.rooms if room.name == ROOM)


def _confidences(robot: Tracked, cues: str) -> tuple[Confidences, ...]:
    """Return the confidences of each cue of a choice, and of all together."""
    stop, config = robot.mapper.last_stop, robot.mapper.config.localisation
    return (*(CUE_MAPS[name](stop, config) for name in CUES[cues]), robot.confidences[cues])


def _judge_room(world: World, robot: Tracked) -> tuple[bool, tuple[float, float]]:
    """Return whether the large room is one ASR, and how far its exits are from the splits (m)."""
    boundary = _large_room(world).boundary
    low, high = boundary.min(axis=0) + INSIDE, boundary.max(axis=0) - INSIDE
    is_inside = ((robot.out > low) & (robot.out < high)).all(axis=1)
    places = np.unique(robot.places[is_inside])
    gone = np.concatenate((np.zeros(1), np.cumsum(np.hypot(*np.diff(robot.out, axis=0).T))))
    in_room = [world.room_at(*place) == ROOM for place in robot.out.tolist()]
    exits = gone[np.flatnonzero(np.diff(np.array(in_room, int)))]
    largest = np.bincount(robot.places[is_inside]).argmax()
    own = np.flatnonzero(robot.places == largest)
    first, last = np.abs(gone[own[[0, -1]]] - exits[[0, -1]]).tolist()
    return len(places) == 1, (first, last)


def _report(
    seeds: range,
    world: World,
    runs: dict[str, list[dict[str, Run]]],
    splits: Mapping[str, Sequence[Split]],
) -> Report:
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    verdicts = {}
    for mapper in MAPPERS:
        everyone = [each[mapper] for group in runs.values() for each in group]
        distance = float(np.median([run.split_distance for run in everyone]))
        figures = {name: _figures([each[mapper] for each in group]) for name, group in runs.items()}
        chance = float(np.mean([split.is_whole for split in splits[mapper]]))
        measured |= {f"{mapper}, {name}": each for name, each in figures.items()}
        measured[f"{mapper}, {CHANCE}"] = _split_figures(splits[mapper])
        whole = min(each["large_room_one_asr"] for each in figures.values())
        known = min(each[key] for each in figures.values() for key in ("right_or_border", "home"))
        verdicts[mapper] = (
            min(whole, 1.0 if mapper == "albot0-paper" else chance) >= WHOLE
            and known >= ASKED[mapper]
            and distance <= NEAR
        )
        if mapper == "albot0":
            measured["large_room_one_asr"] = whole
            measured["split_distance_m"] = round(distance, 2)
            measured["splits_near_exits"] = distance <= NEAR
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=verdicts["albot0"],
        verdicts=verdicts,
        conditions={
            **SONAR_CONDITIONS,
            "environment": ("an office with a room of 9 x 15 m", f"`{WORLD}`, with such a room"),
            "trials": (
                "two journeys",
                f"{2 * len(seeds)} journeys, and {len(seeds)} ways out drawn at random",
            ),
        },
        text=_text(seeds),
        pictures={
            f"{name}-{mapper}": _picture(world, group[0][mapper])
            for name, group in runs.items()
            for mapper in MAPPERS
        },
    )


def _split_figures(splits: Sequence[Split]) -> dict[str, float]:
    figures = {
        "asrs": np.mean([split.asrs for split in splits]),
        "large_room_one_asr": np.mean([split.is_whole for split in splits]),
        "split_distance_m": np.median([split.distances for split in splits]),
        "both_splits_near": np.mean([max(split.distances) <= NEAR for split in splits]),
    }
    return {name: round(float(value), 2) for name, value in figures.items()}


def _figures(runs: Sequence[Run]) -> dict[str, float]:
    stops = [run.stops for run in runs]
    shares: dict[str, list[Any]] = {
        "asrs": [int(run.robot.places.max()) + 1 for run in runs],
        "large_room_one_asr": [run.is_whole for run in runs],
        "right": [np.mean([stop.believed == stop.true for stop in each]) for each in stops],
        "right_or_border": [np.mean([stop.is_near for stop in each]) for each in stops],
        "home": [each[-1].believed == 0 for each in stops],
    }
    return {name: round(float(np.mean(values)), 2) for name, values in shares.items()}


def _text(seeds: range) -> str:
    return f"""
The office `{WORLD}` has a room of 9 x 15 m in its middle, of which a robot with sonars that reach
4 m does not see the walls from where it stands. It is driven along two journeys, with the sonars
and the odometer `pioneer`. On its way home it comes through the room by another way than on its
way out. Means over the seeds {seeds.start} to {seeds.stop - 1}.

On further ways, drawn at random, it comes out of a room, into the large one, turns there
{TURNED[0]} to {TURNED[1]} times, and leaves by another exit. All was chosen on seeds below 140.

`large_room_one_asr`: how often the room is a single ASR of the way out, farther than {INSIDE:g} m
from its walls; `split_distance_m`: how far its split points are from its exits along the way, the
median; `both_splits_near`: how often both are no more than {NEAR:g} m away. `right`: the share of
stops on the way home at which the believed ASR is that of the way out's nearest reading;
`right_or_border`: the same, or an ASR in which the way out comes by no more than {BORDER:g} m
farther away; `home`: how often the robot believes to be home at the end.

`albot0-paper` is the paper's robot to the letter: average widths by area and length, merging by the
h of two regions, the cues distance and orientation. Asked of it is that the room is one ASR in
{WHOLE:.0%} of the runs of either journey, as in the paper's two, and {ASKED["albot0-paper"]:.0%} of
the stops and of the homes. Asked of `albot0` is {ASKED["albot0"]:.0%}, and {WHOLE:.0%} of the ways
drawn at random, too. The split points of either must lie within {NEAR:g} m of the exits.

The pictures show the first seed as the paper's figures 1 to 4 do. Above: the office with the way
out (solid), the way home (dashed), the ASRs of the way out as ellipses, and six stops, A to F; the
map of the way out and that of the way home as the odometer has them, with split points. Below: the
confidence of each ASR at the six stops, by the first cue (dotted), by orientation (dashed), and by
both (solid).
"""


def _picture(world: World, run: Run) -> Figure:
    """Draw the paper's figures 1 and 3: layout and maps above, confidences at six stops below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(18, 11), layout="constrained")
    grid = figure.add_gridspec(2, 6, height_ratios=(2, 1))
    shown = np.linspace(0, len(run.drawn) - 1, len(STOPS)).round().astype(int)
    _draw_layout(figure.add_subplot(grid[0, :2]), world, run, shown)
    titles = ("map of the way out", "map of the way home")
    for column, title, drawn in zip((2, 4), titles, run.robot.mapper.geometric_maps, strict=True):
        axes = figure.add_subplot(grid[0, column : column + 2])
        _draw_map(axes, drawn)
        axes.set_title(title)
    for column, index in enumerate(shown):
        axes = figure.add_subplot(grid[1, column])
        for confidences, style in zip(run.drawn[index][1], (":", "--", "-"), strict=True):
            axes.plot(confidences, style, color=SURFACE if style == "-" else PATH, marker=".")
        axes.set(title=STOPS[column], ylim=(-0.05, 1.05), xlabel="ASR")
    finish_maps(figure)
    return figure


def _draw_layout(axes: Axes, world: World, run: Run, shown: np.ndarray) -> None:
    """Draw figure 1(a): the office, the ways, the ASRs of the way out, and the stops."""
    from matplotlib.patches import Ellipse

    draw_floor(axes, world.walls, SURFACE)
    out = run.robot.out
    axes.plot(*out.T, color=PATH, lw=1.2, label="way out")
    axes.plot(*run.home.T, color=MARK, lw=1.0, ls="--", label="way home")
    labels = []
    for place in range(int(run.robot.places.max()) + 1):
        own = out[run.robot.places == place]
        spread = np.cov(own.T) if len(own) > 1 else np.zeros((2, 2))
        sizes, axis = np.linalg.eigh(spread)
        width, height = 4 * np.sqrt(np.maximum(sizes[::-1], 0)) + 1.0
        angle = np.degrees(np.arctan2(axis[1, 1], axis[0, 1]))
        colour = SERIES[place % len(SERIES)]
        middle = own.mean(axis=0)
        axes.add_patch(Ellipse(middle, width, height, angle=angle, fc="none", ec=colour, lw=1.5))
        at = (float(middle[0]), float(middle[1]))
        labels.append(Label(text=str(place), at=at, colour=colour, size=12.0, weight="bold"))
    for letter, index in zip(STOPS, shown, strict=True):
        x, y = run.drawn[index][0]
        axes.plot(x, y, ".", color=SURFACE)
        at = (float(x), float(y))
        labels.append(Label(text=letter, at=at, colour=SURFACE, radius=3.0, weight="bold"))
    ways = [np.hstack((way[:-1], way[1:])) for way in (out, run.home)]
    place_labels(axes, labels, segments=np.concatenate((world.walls, *ways)))


def _draw_map(axes: Axes, drawn: GeometricMap) -> None:
    """Draw figures 1(b) and 1(c): surfaces, the way, and split points."""
    draw_floor(axes, drawn.steps.surfaces, SURFACE, 1.2, "surfaces of the map")
    way = drawn.steps.lines
    axes.plot(
        *np.concatenate((way[:1, :2], way[:, 2:])).T, color=PATH, lw=1.0, label="path in the map"
    )
    points = np.concatenate((drawn.regions.lines[:, :2], drawn.regions.lines[-1:, 2:]))
    axes.plot(*points.T, "o", color=MARK, ms=5, ls="none", label="split points")
