"""The way home by ASR lengths and turns (Schmidt, Wong and Yeap, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from albot_env.sim.sonar import SONARS
from albot_experiments.albot0_runs import (
    BORDER,
    BOTH_SONARS,
    MAPPERS,
    SONAR_CONDITIONS,
    Stop,
    Tracked,
)
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import TourRecord, driven_tour
from albot_maps import Room, World, load_world
from albot_maps.routes import Routes

ID = "albot0-1"
TITLE = "The way home by ASR lengths and turns (Schmidt et al., section 4)"
BUILDING, TOUR, PART = "office-ring", "single-loop", 0.75
"""The way out is this share of the tour's waypoints."""
OFFICE = "random:office:{seed}?rooms=12"
"""Office in which the way out leads from one room to the one farthest from it."""
HEARING = {"without specular loss": "ideal", "with specular loss": "pioneer"}
"""The sonars; `pioneer` has cross-talk too."""
LONGEST = 3.0
"""A part of the floor that is more than this many times as long as it is wide is a corridor."""
INSIDE = 1.0
"""A reading was taken inside a room if it was at least this far from all exits (m)."""
LEG, NEAR = 6.0, 2.0
"""Two corridors count if the way leads at least this far through both (m). They are separated if an
ASR ends within NEAR of where the way leads from one into the other (m)."""
PAPER = {"large_room_one_asr": 1.0, "home_believed": 0.7}
"""Results of the paper's two experiments and of the thesis (Hossain 2014, section 2.3.4)."""
ASKED = {
    "albot0-paper": {"large_room_one_asr": 0.9, "right_or_border": 0.7, "home_believed": 0.7},
    "albot0": {"large_room_one_asr": 0.9, "right_or_border": 0.9, "home_believed": 0.9},
}
"""The figures that each mapper must reach: the letter those of its paper and of the thesis."""
LEAST_ASRS = 3
"""Localisation is judged on ways out of at least this many ASRs: with fewer, the robot can hardly
be wrong."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a way home."""

    stops: Mapping[str, tuple[Stop, ...]]
    """The beliefs at every stop, by the choice of cues."""
    asrs: int
    """Number of ASRs of the way out."""
    is_whole: bool | None
    """Whether the largest room that the way out entered once was a single ASR; None without one."""
    bends: tuple[bool, ...]
    """For each corridor that the way out enters from another: whether the two were separated."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home once per seed, building and kind of sonars.

    Raises:
        InputError: No seeds.
    """
    building = load_world(BUILDING)
    tour = building.tours[TOUR]
    outcomes: dict[str, dict[str, list[Outcome]]] = {mapper: {} for mapper in MAPPERS}
    for seed in each_seed(seeds, progress):
        office = load_world(OFFICE.format(seed=seed))
        ways = {
            BUILDING: (building, tour[: round(PART * len(tour))]),
            "random offices": (office, way_across(office, seed)),
        }
        for where, (world, way) in ways.items():
            for hearing, sonar in HEARING.items():
                journey, turned = drive(world, way, sonar, seed)
                for mapper, groups in outcomes.items():
                    runs = groups.setdefault(f"{where}, {hearing}", [])
                    runs.append(follow(world, journey, turned, mapper))
    return _report(seeds, outcomes)


def way_across(world: World, seed: int) -> np.ndarray:
    """Return the way from a room drawn at random to the one farthest from it."""
    rooms = [room.name for room in world.reachable_rooms]
    home = rooms.pop(int(np.random.default_rng(seed).integers(len(rooms))))
    ways = [Routes(world).through_rooms([home, room]) for room in rooms]
    return max(ways, key=lambda way: float(np.hypot(*np.diff(way, axis=0).T).sum()))


def drive(world: World, way: np.ndarray, sonar: str, seed: int) -> tuple[TourRecord, int]:
    """Drive a robot along a way and back; return the journey and the turning point's reading."""
    both = np.concatenate((way, way[-2::-1]))
    rng = np.random.default_rng(seed)
    journey = driven_tour(world, both, rng, sonar=SONARS[sonar])
    # The way may pass its end earlier, so the turning point is searched only near the middle.
    travelled = np.cumsum(np.hypot(*np.diff(journey.truth[:, :2], axis=0).T))
    about = np.flatnonzero(np.abs(travelled / travelled[-1] - 0.5) < 0.05)
    away = np.hypot(*(journey.truth[about, :2] - way[-1]).T)
    return journey, int(about[away.argmin()])


def follow(world: World, journey: TourRecord, turned: int, mapper: str) -> Outcome:
    """Lead a mapper out and, after telling it to return, home; return the outcome."""
    truth, robot = journey.truth[:, :2], Tracked(mapper)
    robot.go_out(journey.readings[: turned + 1], truth[: turned + 1])
    for reading, place in zip(journey.readings[turned + 1 :], truth[turned + 1 :], strict=True):
        robot.go_home(reading, place)
    robot.end(truth[-1])
    return Outcome(
        stops={name: tuple(stops) for name, stops in robot.stops.items()},
        asrs=int(robot.places.max()) + 1,
        is_whole=_is_whole(world, robot.out, robot.places),
        bends=_bends(world, robot.out, robot.places),
    )


def _is_whole(world: World, out: np.ndarray, places: np.ndarray) -> bool | None:
    """Return whether the largest room entered once is a single ASR, except near its exits.

    Corridors are no rooms: they may be split where others cross them. None if the robot entered no
    room exactly once.
    """
    exits = np.array([way.segment for way in world.exits])
    middles = 0.5 * (exits[:, :2] + exits[:, 2:])
    is_inside = np.hypot(*np.moveaxis(out[:, None] - middles, -1, 0)).min(axis=1) > INSIDE
    rooms = [world.room_at(*place) for place in out.tolist()]
    come_into = [room for room, _ in groupby(rooms) if room is not None]
    inside: dict[str, set[int]] = {}
    for room, place, is_far in zip(rooms, places.tolist(), is_inside, strict=True):
        if is_far and room is not None and come_into.count(room) == 1:
            inside.setdefault(room, set()).add(place)
    areas = {room.name: _area(room.boundary) for room in world.rooms if not _is_long(room)}
    largest = max(areas.keys() & inside, key=lambda name: areas[name], default=None)
    return None if largest is None else len(inside[largest]) == 1


def _bends(world: World, out: np.ndarray, places: np.ndarray) -> tuple[bool, ...]:
    """Return, for each corridor that the way enters from another, whether the two are separated."""
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(out, axis=0).T))))
    splits = gone[np.flatnonzero(np.diff(places))]
    corridors = {room.name for room in world.rooms if _is_long(room)}
    rooms = [(world.room_at(*place), way) for place, way in zip(out.tolist(), gone, strict=True)]
    known = [(room, way) for room, way in rooms if room is not None]
    legs = [(room, [way for _, way in leg]) for room, leg in groupby(known, lambda each: each[0])]
    parted = []
    for (room, leg), (other, onward) in pairwise(legs):
        shorter = min(leg[-1] - leg[0], onward[-1] - onward[0])
        if {room, other} <= corridors and shorter > LEG:
            away = np.abs(splits - 0.5 * (leg[-1] + onward[0]))
            parted.append(bool((away < NEAR).any()))
    return tuple(parted)


def _is_long(room: Room) -> bool:
    """Return whether a part of the floor is a corridor."""
    width, length = np.sort(np.ptp(room.boundary, axis=0)).tolist()
    return bool(length > LONGEST * width)


def _area(corners: np.ndarray) -> float:
    """Return the area of a polygon (m²)."""
    x, y = corners.T
    return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2


def _report(seeds: range, outcomes: Mapping[str, Mapping[str, Sequence[Outcome]]]) -> Report:
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    verdicts = {}
    for mapper, groups in outcomes.items():
        everyone = [outcome for runs in groups.values() for outcome in runs]
        judged = [outcome for outcome in everyone if outcome.asrs >= LEAST_ASRS]
        own = {
            "large_room_one_asr": _share([each.is_whole for each in everyone]),
            "ways_judged": len(judged),
            **_cue_figures(judged, MAPPERS[mapper]),
        }
        measured[f"{mapper}, ways of {LEAST_ASRS} ASRs or more"] = own
        verdicts[mapper] = all(own[name] >= value for name, value in ASKED[mapper].items())
        if mapper == "albot0":
            measured["corridors_parted"] = _share([each for run in everyone for each in run.bends])
            measured |= own
        for where, runs in groups.items():
            measured[f"{mapper}, {where}"] = {
                "asrs": float(np.median([each.asrs for each in runs])),
                "large_room_one_asr": _share([each.is_whole for each in runs]),
            }
        for where, runs in groups.items():
            for name in runs[0].stops:
                measured[f"{mapper}, {where}, cues {name}"] = _cue_figures(runs, name)
    journeys = sum(len(runs) for runs in outcomes["albot0"].values())
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=verdicts["albot0"],
        verdicts=verdicts,
        conditions={
            **SONAR_CONDITIONS,
            "sensors": BOTH_SONARS,
            "environment": (
                "an office with a room of 9 x 15 m",
                f"`{BUILDING}`, and random offices of twelve rooms",
            ),
            "trials": ("two journeys; of the 70 % it is not told", f"{journeys} journeys"),
            "way home": ("the way out retraced, more or less", "the way out retraced"),
        },
        text=_text(seeds),
    )


def _cue_figures(runs: Sequence[Outcome], name: str) -> dict[str, float]:
    """Return how well the robot knew its ASR with a choice of cues, as means over the runs."""
    stops = [run.stops[name] for run in runs]
    return {
        "right": _share(
            [float(np.mean([each.true == each.believed for each in run])) for run in stops]
        ),
        "right_or_border": _share(
            [float(np.mean([each.is_near for each in run])) for run in stops]
        ),
        "sure": _share([float(np.mean([each.is_sure for each in run])) for run in stops]),
        "home_believed": _share([run[-1].believed == 0 for run in stops]),
    }


def _share(values: Sequence[float | None]) -> float:
    """Return the mean of the known values; NaN if none is known."""
    known = [value for value in values if value is not None]
    return round(float(np.mean(known)), 2) if known else np.nan


def _text(seeds: range) -> str:
    return f"""
A robot with eight sonars and the odometer `pioneer` is driven out and back the same way: in
`{BUILDING}` along three quarters of its loop, and in random offices of twelve rooms from a room
drawn at random to the one farthest from it. Once the sonars hear every wall (`ideal`), and once
only those that they meet within 25° of the perpendicular, with cross-talk between them (`pioneer`).
At the end of the way out the mapper is told that the robot turns round. Means over the seeds
{seeds.start} to {seeds.stop - 1}; all was chosen on seeds below 140.

`large_room_one_asr`: how often the largest room that the way out came into just once is a single
ASR, but within {INSIDE:g} m of exits; what is more than {LONGEST:g} times as long as wide is a
corridor, and no room. The rooms of the random offices are smaller than the sonars reach, and full
of furniture; `albot0-2` has a large one.

`corridors_parted`: how often an ASR ends within {NEAR:g} m of where the way out leads from one
corridor into another, through more than {LEG:g} m of both.

`right`: at which share of the stops on the way home the ASR believed in is that in which the
nearest reading of the way out was taken; `right_or_border`: that, or one in which the way out comes
by no more than {BORDER:g} m farther away; `sure`: how often one ASR is clearly the most confident;
`home_believed`: how often the robot believes to be in its home ASR when it stands at its start.

`albot0-paper` is the paper's robot to the letter; its cues `paper` are `distance` and `orientation`
together. `albot0` is ours; its cues `default` have `way` in place of `distance`. On its ASRs the
paper's cues are asked, too. Localisation is judged on the ways out of {LEAST_ASRS} ASRs or more:
where the way out is one ASR, home is known without any. Asked of the means is
{ASKED["albot0"]["right_or_border"]:.0%} each of `albot0`; of `albot0-paper`
{ASKED["albot0-paper"]["home_believed"]:.0%}, and the large room as a whole as often as of `albot0`.

The paper shows two journeys, in both of which the large room is one ASR, and gives no figure of its
localisation; Albot0's success rate of returning home was 70 % (Hossain 2014, section 2.3.4).
"""
