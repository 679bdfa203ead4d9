"""The way home by ASR lengths and turns (Schmidt, Wong and Yeap, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from albot_core.mappers.albot0.config import Albot0Config
from albot_core.mappers.albot0.localisation import LocalisationConfig
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.paths import PathConfig
from albot_env.sim.sonar import SONARS
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import Journey, driven_tour
from albot_maps import World, load_world
from albot_maps.routes import Routes

ID = "albot0-1"
TITLE = "The way home by ASR lengths and turns (Schmidt et al., section 4)"
BUILDING, TOUR, PART = "office-ring", "single-loop", 0.75
"""The way out is this share of the tour's waypoints."""
OFFICE, VISITS = "random:office:{seed}?rooms=12", 4
"""The way out leads through so many rooms."""
HEARING = {"without specular loss": "ideal", "with specular loss": "pioneer"}
"""The sonars."""
CUES = {"paper": ("distance", "orientation"), "extent": ("extent", "orientation")}
"""The paper's cues; and those with the distance compared with all of an ASR, not with its end."""
INSIDE = 1.0
"""A reading was taken inside a room if it was so far from all exits (m)."""
PAPER = {"large_room_one_asr": 1.0, "home_believed": 0.7}
"""Of the paper's two experiments and in the thesis (Hossain 2014, section 2.3.4)."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How the way home went."""

    right: float
    """Share of the readings at which the believed ASR was the true one…"""
    beside: float
    """…or a neighbour of it."""
    sure: float
    """Share of the readings at which the robot was sure of its ASR."""
    is_home: bool
    """Whether it believed to be in the home ASR when it had come home."""
    asrs: int
    """How many ASRs the way out had."""
    is_whole: bool | None
    """Whether the largest room that the way out came into once was a single ASR; None without."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home once a seed, a building and a kind of sonars.

    Raises:
        InputError: No seeds.
    """
    building = load_world(BUILDING)
    tour = building.tours[TOUR]
    outcomes: dict[str, dict[str, list[Outcome]]] = {}
    for seed in each_seed(seeds, progress):
        office = load_world(OFFICE.format(seed=seed))
        ways = {
            BUILDING: (building, tour[: round(PART * len(tour))]),
            "random offices": (office, _visits(office, seed)),
        }
        for where, (world, way) in ways.items():
            for hearing, sonar in HEARING.items():
                journey, turned = drive(world, way, sonar, seed)
                group = outcomes.setdefault(f"{where}, {hearing}", {name: [] for name in CUES})
                for name, cues in CUES.items():
                    group[name].append(follow(world, journey, turned, cues))
    return _report(seeds, outcomes)


def _visits(world: World, seed: int) -> np.ndarray:
    """A way through some rooms, drawn at random."""
    rooms = [room.name for room in world.reachable_rooms]
    drawn = np.random.default_rng(seed).permutation(len(rooms))[:VISITS]
    return Routes(world).through_rooms([rooms[k] for k in drawn])


def drive(world: World, way: np.ndarray, sonar: str, seed: int) -> tuple[Journey, int]:
    """Drive a robot along a way and back; and the reading at which it turned round."""
    both = np.concatenate((way, way[-2::-1]))
    rng = np.random.default_rng(seed)
    journey = driven_tour(world, both, rng, sonar=SONARS[sonar])
    # The way may come by its end earlier, so that it is looked for about the middle only.
    travelled = np.cumsum(np.hypot(*np.diff(journey.truth[:, :2], axis=0).T))
    about = np.flatnonzero(np.abs(travelled / travelled[-1] - 0.5) < 0.05)
    away = np.hypot(*(journey.truth[about, :2] - way[-1]).T)
    return journey, int(about[away.argmin()])


def follow(world: World, journey: Journey, turned: int, cues: tuple[str, ...]) -> Outcome:
    """Lead the mapper out and, once it is told to return, home."""
    mapper = Albot0(
        Albot0Config(
            paths=PathConfig(detects_return=False), localisation=LocalisationConfig(cues=cues)
        )
    )
    for reading in journey.readings[: turned + 1]:
        mapper.update(reading)
    mapper.begin_return()
    out, home = journey.truth[: turned + 1, :2], journey.truth[turned + 1 :, :2]
    places = np.array([mapper.place_at(k) for k in range(len(out))])
    nearest = [int(np.hypot(*(out - place).T).argmin()) for place in home]
    true = places[nearest]
    believed, sure = [], []
    for reading in journey.readings[turned + 1 :]:
        mapper.update(reading)
        estimate = mapper.estimate
        believed.append(estimate.place)
        sure.append(estimate.localised)
    off = np.abs(np.array(believed) - true)
    return Outcome(
        right=float(np.mean(off == 0)),
        beside=float(np.mean(off <= 1)),
        sure=float(np.mean(sure)),
        is_home=believed[-1] == 0,
        asrs=int(places.max()) + 1,
        is_whole=_is_whole(world, out, places),
    )


def _is_whole(world: World, out: np.ndarray, places: np.ndarray) -> bool | None:
    """Whether the largest room that was come through once is a single ASR, but near its exits.

    None where the robot came into no room just once.
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
    if not inside:
        return None
    areas = {room.name: _area(room.boundary) for room in world.rooms}
    return len(inside[max(inside, key=lambda name: areas[name])]) == 1


def _area(corners: np.ndarray) -> float:
    """The area of a polygon (m²)."""
    x, y = corners.T
    return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2


def _report(seeds: range, outcomes: dict[str, dict[str, list[Outcome]]]) -> Report:
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    everyone = [each for group in outcomes.values() for each in group["paper"]]
    measured["large_room_one_asr"] = _share([each.is_whole for each in everyone])
    measured["home_believed"] = _share([each.is_home for each in everyone])
    for where, group in outcomes.items():
        figures: dict[str, Figures] = {
            "asrs": float(np.median([each.asrs for each in group["paper"]])),
            "large_room_one_asr": _share([each.is_whole for each in group["paper"]]),
        }
        for name, runs in group.items():
            figures |= {
                f"{name}_right": _share([each.right for each in runs]),
                f"{name}_right_or_beside": _share([each.beside for each in runs]),
                f"{name}_sure": _share([each.sure for each in runs]),
                f"{name}_home": _share([each.is_home for each in runs]),
            }
        measured[where] = figures
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=all(float(str(measured[name])) >= value for name, value in PAPER.items()),
        text=_text(seeds),
    )


def _share(values: Sequence[float | None]) -> float:
    """The mean of those that are known."""
    return round(float(np.mean([value for value in values if value is not None])), 2)


def _text(seeds: range) -> str:
    return f"""
A robot with eight sonars and the odometer `pioneer` is driven out and back the same way: in
`{BUILDING}` along three quarters of its loop, and in random offices of twelve rooms through
{VISITS} rooms drawn at random, into most of which only one door leads. Once the sonars hear every
wall (`ideal`), and once only those that they meet within 25° of the perpendicular (`pioneer`). At
the end of the way out the mapper is told that the robot turns round. Means over the seeds
{seeds.start} to {seeds.stop - 1}.

`large_room_one_asr`: how often the largest room that the way out came into just once is a single
ASR, but within {INSIDE:g} m of exits. `home`: how often the robot believes to be in its home ASR
when it is back at its start. `right`: at which share of all readings on the way home the believed
ASR is the one in which the nearest reading of the way out was taken; `right_or_beside`: that, or a
neighbour of it; `sure`: how often one ASR is clearly the most confident. `paper` has the paper's
cues, `extent` compares the distance with all of an ASR and not only with its end.

The paper shows two journeys, in both of which the large room is one ASR, and gives no figure of its
localisation; Albot0's success rate of returning home was 70 % (Hossain 2014, section 2.3.4).
"""
