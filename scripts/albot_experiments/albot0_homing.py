"""Albot0 drives out and home by sonars alone (Schmidt, Wong and Yeap, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, transform_points
from albot_core.geometry.types import Points
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.mapper import POINT
from albot_core.planning.gap_explorer import GapExplorer
from albot_core.planning.percept import Percept
from albot_core.planning.sonar_driver import SonarDriver
from albot_core.sensing.reading import Reading
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_env.sim.sonar import SONARS
from albot_experiments.albot0_runs import BORDER, CUES, Tracked
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
ASKED = 0.9
"""Minimum share of trials in which home must be reached and known."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The outcome of a robot's way home."""

    asrs: int
    """Number of ASRs of the way out."""
    known: Mapping[str, bool]
    """By the names of `CUES`: whether the robot was in its home ASR when it first believed to
    be."""
    nearest: bool
    """Whether the way out's nearest reading was then of the home ASR, with the default cues."""
    reached: bool
    """Whether the robot entered its home ASR at all."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive out and home: once per seed in the hall, and twice in each of its random offices.

    In the first of these offices the gap explorer drives out once more.

    Raises:
        InputError: No seeds.
    """
    trials: dict[str, list[Trial]] = {}
    hall = load_world(HALL)
    for seed in each_seed(seeds, progress):
        trials.setdefault(f"{HALL}, with specular loss", []).append(drive(hall, "pioneer", seed))
        for k in range(OFFICES):
            office = load_world(OFFICE.format(number=seed + k * len(seeds)))
            for hearing, sonar in HEARING.items():
                key = f"random offices, {hearing}"
                trials.setdefault(key, []).append(drive(office, sonar, seed))
        office = load_world(OFFICE.format(number=seed))
        trials.setdefault(EXPLORER, []).append(drive_explored(office, seed))
    return _report(seeds, trials)


def drive(world: World, sonar: str, seed: int) -> Trial:
    """Drive a robot out and home; return the outcome."""
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
    return _go_home(simulator, driver, readings, np.array(truth), STEPS)


def drive_explored(world: World, seed: int) -> Trial:
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
    return _go_home(simulator, driver, readings, np.array(truth), EXPLORED_STEPS)


def _go_home(
    simulator: Simulator, driver: SonarDriver, out: list[Reading], truth: Points, steps: int
) -> Trial:
    """Drive home until the robot believes to be there, with every choice of cues."""
    robot = Tracked()
    robot.go_out(tuple(out), truth)
    reading = out[-1]
    known: dict[str, bool] = {}
    reached = nearest = False
    for _ in range(steps):
        reading = _step(simulator, driver, reading, robot.mapper)
        place = simulator.pose[:2].copy()
        robot.go_home(reading, place)
        is_home = robot.is_at(place, 0)
        reached |= is_home
        for name in CUES.keys() - known:
            if robot.believes_in(name) == 0:
                known[name] = is_home
                if name == "default":
                    nearest = robot.true_asr(place) == 0
        if len(known) == len(CUES):
            break
    return Trial(
        asrs=int(robot.places.max()) + 1,
        known={name: known.get(name, False) for name in CUES},
        nearest=nearest,
        reached=reached,
    )


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


def _report(seeds: range, trials: Mapping[str, list[Trial]]) -> Report:
    everyone = [trial for group in trials.values() for trial in group]
    if not any(trial.asrs > 1 for trial in everyone):
        raise InputError("seeds", "a way out of two ASRs at least", "none")
    shares = {where: _shares(group) for where, group in trials.items()}
    measured: dict[str, Figures] = {
        "seeds": len(seeds),
        "trials": len(everyone),
        "home_reached_and_known": _shares(everyone)["default"],
    }
    for where, group in trials.items():
        measured[where] = {
            "trials": len(group),
            "asrs": float(np.median([trial.asrs for trial in group])),
            "home_reached": round(float(np.mean([trial.reached for trial in group])), 2),
            "nearest": round(float(np.mean([trial.nearest for trial in group])), 2),
            **{f"known_by_{name}": share for name, share in shares[where].items()},
        }
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=all(share["default"] >= ASKED for share in shares.values()),
        text=_text(seeds),
    )


def _shares(trials: list[Trial]) -> dict[str, float]:
    """Return the share of trials in which home was reached and known, by each choice of cues."""
    return {name: round(float(np.mean([t.known[name] for t in trials])), 2) for name in CUES}


def _text(seeds: range) -> str:
    return f"""
A robot without a laser drives {OUT:g} m, or {MOST / 10:g} s, through `{HALL}`, once for each of
the seeds {seeds.start} to {seeds.stop - 1}, and through {OFFICES * len(seeds)} random offices of
twelve rooms, each with and without specular loss. It drives as the paper's does: straight on until
an obstacle, then round it. Then it turns round, makes a second map, and drives home along its way
out (`albot_core.mappers.albot0.way_back`) for {STEPS / 10:g} s at the most. Sonars and odometer are
`pioneer`, or `ideal` sonars, which hear every wall and not each other. All was chosen on seeds
below 140, and how the driver passes doors on seeds from 200 to 424.

In one random office for each seed the gap explorer drives out, too, by a laser, as in
`Albot/Homing-v0`: {EXPLORED[0]:g} to {EXPLORED[1]:g} m, and {EXPLORED_STEPS / 10:g} s for the way
home. The mapper hears the sonars alone. What is asked is asked of each group of trials.

`home_reached`: in which share of the trials the robot came into its home ASR: its way out comes by
in that ASR no more than {BORDER:g} m farther away than in any. `known_by_…`: in which share it was
there when it first believed to be, by each cue alone, by the paper's two (`paper`), and by `albot0`
as it comes (`default`). All of them are asked on the same drives. `nearest`: the same as
`known_by_default`, where the very nearest reading of the way out must be of the home ASR: the way
out often comes by its home again, and is in another ASR then.
"""
