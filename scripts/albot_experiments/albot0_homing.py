"""Albot0 drives out and home by sonars alone (Schmidt, Wong and Yeap, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.geometry.types import Points
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.mapper import POINT
from albot_core.planning.gap_explorer import GapExplorer
from albot_core.planning.leading import LED
from albot_core.planning.percept import Percept
from albot_core.planning.sonar_driver import SonarDriver
from albot_core.sensing.reading import Reading
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_env.sim.sonar import SONARS
from albot_experiments.albot0_runs import (
    BORDER,
    BOTH_SONARS,
    CUES,
    MAPPERS,
    SONAR_CONDITIONS,
    Tracked,
)
from albot_experiments.report import Figures, Report, each_seed
from albot_maps import World, load_world

ID = "albot0-homing"
TITLE = "Albot0 drives out and home by sonars alone (Schmidt et al., section 4)"
HALL, OFFICE, OFFICES = "office-hall", "random:office:{number}?rooms=12", 2
"""The office of the paper, with one trial per seed; random offices; and their number per seed."""
HEARING = {"without specular loss": "ideal", "with specular loss": "pioneer"}
"""The sonars; `pioneer` has cross-talk too."""
OUT = 40.0
"""The way out has this length (m)…"""
MOST, STEPS = 900, 1800
"""…or this number of steps of 0.1 s, if that comes first; the way home has at most STEPS steps."""
EXPLORED, EXPLORED_STEPS = (30.0, 100.0), 3000
"""Range of the length of the gap explorer's way out (m), and maximum number of steps of the way
home, as in `Albot/Homing-v0`."""
EXPLORER = "random offices, with specular loss, out by the gap explorer"
"""Name of the trials in which a laser finds the way out; the mapper gets no laser data."""
PAPER = {"home_reached_and_known": 0.7}
"""Albot0's success rate of returning home (Hossain 2014, section 2.3.4)."""
ASKED = {"albot0-paper": 0.7, "albot0": 0.9}
"""Minimum share of trials in which home must be reached and known, in each group of trials: of the
letter the thesis's 70 %."""
GUIDES = {"retraced": False, "loops cut": True}
"""The ways home: the way out backwards, as in the paper's two journeys; and along the way out, but
with its loops cut off (`albot_core.mappers.albot0.way_back`)."""
_SPACING = 0.5
"""Spacing of the points by which the way out is retraced (m)."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The outcome of a robot's way home for one mapper."""

    asrs: int
    """Number of ASRs of the way out."""
    known: Mapping[str, bool]
    """By the choice of cues: whether the robot was in its home ASR when it first believed to be."""
    nearest: bool
    """Whether the way out's nearest reading was then of the home ASR, with the mapper's own
    cues."""
    reached: bool
    """Whether the robot entered its home ASR at all."""


Trials = dict[str, Trial]
"""The outcomes of one way home, by mapper: all have the same readings."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home: once per seed in the hall, and twice in each of its random offices.

    In the first of these offices the gap explorer drives out once more. Each way home is driven
    twice: retraced, and with the loops of the way out cut off.

    Raises:
        InputError: No seeds.
    """
    trials: dict[str, list[Trials]] = {}
    hall = load_world(HALL)
    for seed in each_seed(seeds, progress):
        offices = [load_world(OFFICE.format(number=seed + k * len(seeds))) for k in range(OFFICES)]
        for way, cuts in GUIDES.items():
            trials.setdefault(f"{HALL}, with specular loss, {way}", []).append(
                drive(hall, "pioneer", seed, cuts)
            )
            for office in offices:
                for hearing, sonar in HEARING.items():
                    trials.setdefault(f"random offices, {hearing}, {way}", []).append(
                        drive(office, sonar, seed, cuts)
                    )
            trials.setdefault(f"{EXPLORER}, {way}", []).append(
                drive_explored(offices[0], seed, cuts)
            )
    return _report(seeds, trials)


def drive(world: World, sonar: str, seed: int, cuts: bool) -> Trials:
    """Drive a robot out and home, with the loops of its way cut off or not; return the outcome."""
    rng = np.random.default_rng(seed)
    sensors = Sensors(laser=None, odometer=ODOMETERS["pioneer"], sonar=SONARS[sonar])
    simulator, driver = Simulator(world, sensors=sensors), SonarDriver()
    reading = simulator.reset(rng, world.starts[seed % len(world.starts)])
    driver.reset(rng)
    readings, truth, gone = [reading], [simulator.pose[:2].copy()], 0.0
    while gone < OUT and len(readings) < MOST:
        reading = _step(simulator, driver, reading, None)
        readings.append(reading)
        truth.append(simulator.pose[:2].copy())
        gone += float(np.hypot(*(truth[-1] - truth[-2])))
    return _go_home(simulator, driver, readings, np.array(truth), STEPS, cuts)


def drive_explored(world: World, seed: int, cuts: bool) -> Trials:
    """Drive a robot out by the gap explorer and its laser, and home by sonars alone."""
    rng = np.random.default_rng(seed)
    sensors = Sensors(odometer=ODOMETERS["pioneer"], sonar=SONARS["pioneer"])
    simulator, driver = Simulator(world, sensors=sensors), SonarDriver()
    explorer = GapExplorer()
    readings = [simulator.reset(rng, world.starts[seed % len(world.starts)])]
    driver.reset(rng)
    explorer.reset(rng)
    length = float(rng.uniform(*EXPLORED))
    pose, truth, gone = np.zeros(3), [simulator.pose[:2].copy()], 0.0
    while gone < length and len(readings) < 40 * length + 400:
        laser = readings[-1].required_laser(ID)
        percept = Percept(
            ranges=np.minimum(laser.ranges, laser.geometry.max_range),
            laser=laser.geometry,
            pose=pose,
            motion=readings[-1].motion,
        )
        readings.append(simulator.step(*explorer.command(percept).tolist()))
        pose = compose(pose, readings[-1].motion)
        truth.append(simulator.pose[:2].copy())
        gone += float(np.hypot(*(truth[-1] - truth[-2])))
    return _go_home(simulator, driver, readings, np.array(truth), EXPLORED_STEPS, cuts)


def _go_home(
    simulator: Simulator,
    driver: SonarDriver,
    out: list[Reading],
    truth: Points,
    steps: int,
    cuts: bool,
) -> Trials:
    """Drive home until both mappers believe to be there, with every choice of cues."""
    robots = {name: Tracked(name) for name in MAPPERS}
    for robot in robots.values():
        robot.go_out(tuple(out), truth)
    guide = robots["albot0"].mapper
    way = _driven(simulator, driver, out[-1], guide, steps) if cuts else _retraced(simulator, truth)
    homings = {name: _Homing(robot, MAPPERS[name]) for name, robot in robots.items()}
    for reading in way:
        place = simulator.pose[:2].copy()
        for name, homing in homings.items():
            robots[name].go_home(reading, place)
            homing.judge(place)
        if all(homing.is_over for homing in homings.values()):
            break
    place = simulator.pose[:2].copy()
    for name, homing in homings.items():
        robots[name].end(place)
        homing.judge(place)
    return {name: homing.trial for name, homing in homings.items()}


class _Homing:
    """What one mapper believes of home on its way there.

    Args:
        robot: The mapper, at the end of its way out.
        own: Its own choice of cues.
    """

    def __init__(self, robot: Tracked, own: str) -> None:
        self._robot, self._own = robot, own
        self._known: dict[str, bool] = {}
        self._reached = self._nearest = False

    @property
    def is_over(self) -> bool:
        """Whether it has believed to be at home with every choice of cues."""
        return len(self._known) == len(self._robot.cues)

    def judge(self, place: Points) -> None:
        """Note whether it believes to be at home for the first time, at a true position (m)."""
        robot, is_home = self._robot, self._robot.is_at(place, 0)
        self._reached |= is_home
        for cues in robot.cues.keys() - self._known:
            if robot.believes_in(cues) == 0:
                self._known[cues] = is_home
                if cues == self._own:
                    self._nearest = robot.true_asr(place) == 0

    @property
    def trial(self) -> Trial:
        """The outcome so far."""
        return Trial(
            asrs=int(self._robot.places.max()) + 1,
            known={cues: self._known.get(cues, False) for cues in self._robot.cues},
            nearest=self._nearest,
            reached=self._reached,
        )


def _driven(
    simulator: Simulator, driver: SonarDriver, reading: Reading, guide: Albot0, steps: int
) -> Iterator[Reading]:
    """Drive home by a mapper's guide; yield the reading of each step."""
    for _ in range(steps):
        reading = _step(simulator, driver, reading, guide)
        yield reading


def _retraced(simulator: Simulator, truth: Points) -> Iterator[Reading]:
    """Lead the robot back over the true positions of its way out; yield the readings."""
    points = [truth[-1]]
    for point in truth[::-1]:
        if np.hypot(*(point - points[-1])) >= _SPACING:
            points.append(point)
    for point in (*points, truth[0]):
        while (command := LED.command_towards(point, simulator.pose)) is not None:
            yield simulator.step(*command.tolist())


def _step(
    simulator: Simulator, driver: SonarDriver, reading: Reading, guide: Albot0 | None
) -> Reading:
    """Make one step of the driver: straight on, or in the direction of the way home."""
    sonar = reading.required_sonar(ID)
    target = None
    if guide is not None:
        estimate, point = guide.estimate, guide.way_home[POINT]
        ahead = estimate.home[:2] if np.isnan(point).any() else point
        target = transform_points(inverse(estimate.pose), ahead)
    speed, turn_rate = driver.command(sonar.ranges, sonar.geometry, reading.motion, target)
    return simulator.step(float(speed), float(turn_rate))


def _report(seeds: range, trials: Mapping[str, list[Trials]]) -> Report:
    if not any(trial["albot0"].asrs > 1 for group in trials.values() for trial in group):
        raise InputError("seeds", "a way out of two ASRs at least", "none")
    verdicts: dict[str, bool] = {}
    groups: dict[str, Figures] = {}
    for name, own in MAPPERS.items():
        for where, group in trials.items():
            mine = [trial[name] for trial in group]
            shares = _shares(mine)
            groups[f"{name}, {where}"] = {
                "trials": len(mine),
                "asrs": float(np.median([trial.asrs for trial in mine])),
                "home_reached": round(float(np.mean([trial.reached for trial in mine])), 2),
                "nearest": round(float(np.mean([trial.nearest for trial in mine])), 2),
                "home_reached_and_known": shares[own],
                **{f"known_by_{cues}": shares.get(cues) for cues in CUES},
            }
        for way in GUIDES:
            key = name if way == "retraced" else f"{name} with {way}"
            verdicts[key] = all(
                _shares([trial[name] for trial in group])[own] >= ASKED[name]
                for where, group in trials.items()
                if where.endswith(way)
            )
    everyone = [trial["albot0"] for group in trials.values() for trial in group]
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={
            "seeds": len(seeds),
            "trials": len(everyone),
            "home_reached_and_known": _shares(everyone)["default"],
            **groups,
        },
        holds=verdicts["albot0"] and verdicts["albot0 with loops cut"],
        verdicts=verdicts,
        conditions={
            **SONAR_CONDITIONS,
            "sensors": BOTH_SONARS,
            "robot": ("Pioneer 3 by sonar, until an obstacle", "simulated Pioneer 3, the same"),
            "environment": (
                "an office with a room of 9 x 15 m",
                f"`{HALL}`, and random offices of twelve rooms",
            ),
            "way home": (
                "the way out, more or less retraced",
                "retraced, led along it; and driven by the mapper with its loops cut off",
            ),
            "trials": ("not told", f"{len(everyone)} ways home"),
        },
        text=_text(seeds),
    )


def _shares(trials: list[Trial]) -> dict[str, float]:
    """Return the share of trials in which home was reached and known, by each choice of cues."""
    return {
        name: round(float(np.mean([trial.known[name] for trial in trials])), 2)
        for name in trials[0].known
    }


def _text(seeds: range) -> str:
    return f"""
A robot without a laser drives {OUT:g} m, or {MOST / 10:g} s, through `{HALL}`, once for each of
the seeds {seeds.start} to {seeds.stop - 1}, and through {OFFICES * len(seeds)} random offices of
twelve rooms, each with and without specular loss. It drives as the paper's does: straight on until
an obstacle, then round it. Then it turns round and makes a second map. It is led home along its way
out backwards (`retraced`); and once more it drives home along its way out with its loops cut off
(`albot_core.mappers.albot0.way_back`, by the map of `albot0`), for {STEPS / 10:g} s at the most.
Both mappers hear the same. Sonars and odometer are `pioneer`, or `ideal` sonars, which hear every
wall and not each other. All was chosen on seeds below 140, and how the driver passes doors on seeds
from 200 to 424.

In one random office for each seed the gap explorer drives out, too, by a laser, as in
`Albot/Homing-v0`: {EXPLORED[0]:g} to {EXPLORED[1]:g} m, and {EXPLORED_STEPS / 10:g} s for the way
home. The mapper hears the sonars alone. What is asked is asked of each group of trials:
{ASKED["albot0-paper"]:.0%} of `albot0-paper`, as the thesis tells of Albot0, and
{ASKED["albot0"]:.0%} of `albot0`. A verdict without addition is that on ways retraced, as in the
paper.

`home_reached`: in which share of the trials the robot came into its home ASR: its way out comes by
in that ASR no more than {BORDER:g} m farther away than in any. `known_by_…`: in which share it was
there when it first believed to be, by each cue alone, by the paper's two (`paper`), and by those
of `albot0` (`default`), on the mapper's own ASRs; `home_reached_and_known` is that by the mapper's
own cues. All of them are asked on the same drives. `nearest`: the same, where the very nearest
reading of the way out must be of the home ASR: the way out often comes by its home again, and is in
another ASR then.
"""
