"""The odometer's frame is lost between the journeys (Schmidt, Wong and Yeap, section 4)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from albot_core.geometry.poses import compose
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.registry import make_mapper
from albot_env.sim.sonar import SONARS
from albot_experiments import albot0_hall, albot0_return
from albot_experiments.albot0_runs import BORDER, MAPPERS, SONAR_CONDITIONS, is_at
from albot_experiments.report import Figures, Report, each_seed
from albot_experiments.tours import TourRecord, driven_tour
from albot_maps import load_world

ID = "albot0-lost-frame"
TITLE = "The way home in another frame than the way out (Schmidt et al., section 4, figure 1c)"
FRAMES: Mapping[str, tuple[float, float, float] | None] = {
    "kept": None,
    "turned by 180°": (0.0, 0.0, math.pi),
    "turned by 30°": (0.0, 0.0, math.radians(30.0)),
    "turned by -100°, shifted by 9 m": (8.0, -4.0, math.radians(-100.0)),
}
"""What the odometer's frame does where the robot turns round (m, m, rad); None: it goes on."""
MOVED = 0.4
"""Distance that the robot is moved while it is turned off, along its way home (m)."""
PAPER = {"home_believed": 0.7}
"""Albot0's success rate of returning home (Hossain 2014, section 2.3.4)."""
ASKED = {"albot0-paper": 0.7, "albot0": 0.9}
"""Minimum share of stops at which the ASR must be right or one at a border, and of runs in which
home must be known, in the mean over the ways and in each frame."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a way home."""

    right: float
    """Share of the stops at which the robot believed in its ASR, or one at a border."""
    is_home: bool
    """Whether it believed to be in its home ASR at the end."""
    kept: float | None
    """The probability that the frame was kept, as found at the end; None without a trail."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home once per seed and way, and come home in every frame with each mapper.

    Raises:
        InputError: No seeds.
    """
    outcomes: dict[tuple[str, str], list[Outcome]] = {}
    for seed in each_seed(seeds, progress):
        for journey, turned in _journeys(seed):
            for name in MAPPERS:
                for frame, outcome in come_home(name, journey, turned, seed):
                    outcomes.setdefault((name, frame), []).append(outcome)
    return _report(seeds, outcomes)


def _journeys(seed: int) -> Iterator[tuple[TourRecord, int]]:
    """Yield the journeys of a seed, each with the reading at which the robot turns round."""
    hall = load_world(albot0_hall.WORLD)
    for name, at in albot0_hall.TURNS.items():
        rng = np.random.default_rng(seed)
        journey = driven_tour(hall, hall.tours[name], rng, sonar=SONARS["pioneer"])
        yield journey, int(np.hypot(*(journey.truth[:, :2] - at).T).argmin())
    ring = load_world(albot0_return.BUILDING)
    tour = ring.tours[albot0_return.TOUR]
    way = tour[: round(albot0_return.PART * len(tour))]
    yield albot0_return.drive(ring, way, "pioneer", seed)
    office = load_world(albot0_return.OFFICE.format(seed=seed))
    yield albot0_return.drive(office, albot0_return.way_across(office, seed), "pioneer", seed)


def come_home(
    name: str, journey: TourRecord, turned: int, seed: int
) -> Iterator[tuple[str, Outcome]]:
    """Lead a mapper out, and home again from there in every frame; yield the outcomes."""
    truth, readings = journey.truth[:, :2], journey.readings
    mapper = _mapper(name, seed)
    for reading in readings[: turned + 1]:
        mapper.update(reading)
    mapper.begin_return()
    places = np.array([mapper.place_at(k) for k in range(turned + 1)])
    state = mapper.state()
    away = np.hypot(*(truth[turned + 1 :] - truth[turned]).T)
    first = turned + 1 + int((away >= MOVED).argmax())
    for frame, jump in FRAMES.items():
        mapper = _mapper(name, seed)
        mapper.restore(state)
        home = list(readings[turned + 1 :])
        if jump is not None:
            unnoticed = reduce(compose, [each.motion for each in readings[turned + 1 : first + 1]])
            motion = compose(unnoticed, np.array(jump, np.float64))
            home = [replace(readings[first], motion=motion), *readings[first + 1 :]]
        right = []
        for reading, place in zip(home, truth[-len(home) :], strict=True):
            if mapper.update(reading):
                right.append(is_at(truth[: turned + 1], places, place, mapper.events[-1].place))
        mapper.end_path()
        last = mapper.events[-1]
        yield (
            frame,
            Outcome(right=float(np.mean(right)), is_home=last.place == 0, kept=last.kept),
        )


def _mapper(name: str, seed: int) -> Albot0:
    mapper = make_mapper(name, rng=np.random.default_rng(seed))
    assert isinstance(mapper, Albot0)
    return mapper


def _report(seeds: range, outcomes: Mapping[tuple[str, str], Sequence[Outcome]]) -> Report:
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    verdicts = {}
    for name in MAPPERS:
        reached = []
        for frame in FRAMES:
            runs = outcomes[name, frame]
            right = float(np.mean([each.right for each in runs]))
            home = float(np.mean([each.is_home for each in runs]))
            kept = [each.kept > 0.5 for each in runs if each.kept is not None]
            measured[f"{name}, frame {frame}"] = {
                "right_or_border": round(right, 2),
                "home_believed": round(home, 2),
                "frame_believed_kept": round(float(np.mean(kept)), 2) if kept else None,
            }
            reached.append(min(right, home) >= ASKED[name])
        verdicts[name] = all(reached)
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
                "an office with a room of 9 x 15 m",
                "`office-hall`, `office-ring`, random offices",
            ),
            "trials": ("two journeys", f"{4 * len(seeds)} journeys, each home in every frame"),
            "between the journeys": (
                "turned off, and its position slightly changed; the way home begins in a frame of "
                "its own",
                f"moved by {MOVED:g} m unnoticed, and the frame turned and shifted",
            ),
        },
        text=_text(seeds),
    )


def _text(seeds: range) -> str:
    return f"""
The paper's robot is turned off between its way out and its way home, so that the two maps lie in
"different global coordinate systems, and the robot has no way of aligning them". Here it is led
along the two journeys of `albot0-2`, and out and back in `office-ring` and in random offices
(`albot0-1`), with sonars and odometer `pioneer`. At the turning point the odometer keeps its frame,
or loses it: then the robot is moved by {MOVED:g} m without noticing, and the odometer goes on in a
frame that is turned and shifted. The mapper is told only that the way home begins. Means over the
seeds {seeds.start} to {seeds.stop - 1}; all was chosen on seeds below 140.

`right_or_border`: at which share of the stops the ASR believed in is that of the way out's nearest
reading, or one in which the way out comes by no more than {BORDER:g} m farther away;
`home_believed`: how often the robot believes to be home at the end; `frame_believed_kept`: how
often it then believes that its odometer kept the frame. `albot0-paper` needs no frame. Asked is
{ASKED["albot0-paper"]:.0%} of each for `albot0-paper` and {ASKED["albot0"]:.0%} for `albot0`, in
every frame.
"""
