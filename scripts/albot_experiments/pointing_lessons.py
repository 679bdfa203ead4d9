"""Lessons of the pointing probes: a robot is shown targets, then blindfolded, then turned round.

The robot carries a laser, wheels and a compass. A guide leads it on a tour and tells it the
direction of each target that it can see nearby; the laser tells the distance. Then the robot is
turned a little without sight, and after that turned round many times while its wheels slip, as
the subjects of Wang and Spelke (2000) were rotated with their eyes closed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.sensing.faults.effect import ReadingFault
from albot_core.sensing.faults.fault import Clock
from albot_core.sensing.faults.injector import FaultInjector
from albot_core.sensing.faults.registry import READING_FAULTS, parse_faults
from albot_core.sensing.reading import Reading
from albot_env.sim.compass import COMPASSES
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator, StartStop, follow_leg
from albot_experiments.tours import lead
from albot_maps.world import World

OPEN, CLOSED, TURNED, AGAIN = "eyes open", "eyes closed", "disoriented", "eyes open again"
"""The phases in which targets are pointed to, in order; each ends with the pointing."""
PHASES = (OPEN, CLOSED, TURNED, AGAIN)
STEPS = StartStop(move=0.25, turn=np.radians(15.0))
"""Longest move and largest turn between two readings."""
ODOMETER, COMPASS = "pioneer", "polarised"
BRIEF = (90.0, 180.0)
"""Range of the brief turn, to either side (degrees)."""
TURNS = 8
"""Whole turns of the disorientation; a further part of a turn is drawn."""
_SPIN = np.radians(30.0)
"""Turn between two readings of the disorientation (rad)."""
BLIND = "laser-dropout:at=0s,lasting=1e6s"
"""The fault of a blindfolded robot."""
SLIP = "odometer-jump:at=0s,every=0.001s,length=0m,turn=0..60deg"
"""The fault of wheels that slip while the robot is turned: every second turn is told wrongly."""
_TOLERANCE = 0.2
"""A target is in view if the beam towards it ends within this distance of it (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """A target that the robot was shown while it could see it."""

    target: int
    """Number of the target."""
    reading: int
    """Number of the reading."""
    point: Float64[np.ndarray, "2"]
    """Where the laser saw it, in the robot's frame (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A world with targets, and the tour on which the robot is shown them."""

    world: World
    targets: Float64[np.ndarray, "targets 2"]
    """Their places (m, world frame)."""
    depth: float
    """Distance of a target's middle behind its surface, which the laser sees (m)."""
    tour: Float64[np.ndarray, "waypoints 2"]
    """The tour (m, world frame). It ends where the robot is to point."""
    near: float
    """The robot is shown the targets that it sees within this distance (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lesson:
    """All that a robot sensed on a tour and in the phases after it, and what was true."""

    readings: tuple[Reading, ...]
    """The readings as the robot gets them."""
    truth: Poses
    """(readings, 3): the true poses (world frame)."""
    ends: Mapping[str, int]
    """Number of the last reading of each phase, by phase."""
    sightings: tuple[Sighting, ...]
    """The sightings on the tour, in the order of the readings."""
    targets: Float64[np.ndarray, "targets 2"]
    """True places of the targets (m, world frame)."""


def teach(scene: Scene, seed: int, *, disorients: bool = True) -> Lesson:
    """Lead a robot through a scene's tour, and then through the phases.

    Args:
        scene: The scene.
        seed: Selects all errors of the sensors, the turns, and the slip of the wheels.
        disorients: Whether the wheels slip while the robot is turned round. Without it the robot
            is turned as often, but feels the turns rightly: the control.

    Raises:
        InputError: The tour is not clear of walls.
    """
    sensors = Sensors(odometer=ODOMETERS[ODOMETER], compass=COMPASSES[COMPASS])
    simulator = Simulator(scene.world, sensors=sensors)
    go_to = partial(follow_leg, simulator, steps=STEPS)
    rng = np.random.default_rng(seed)
    journey = lead(simulator, scene.world, scene.tour, rng, go_to)
    readings, truth = list(journey.readings), list(journey.truth)
    sightings = [
        sighting
        for k, (reading, pose) in enumerate(zip(readings, truth, strict=True))
        for sighting in sightings_of(scene, k, reading, pose)
    ]
    ends = {OPEN: len(readings) - 1}
    side = rng.choice((-1.0, 1.0))
    brief = side * np.radians(rng.uniform(*BRIEF))
    spun = -side * 2 * np.pi * (TURNS + rng.uniform())
    slip = (BLIND, SLIP) if disorients else (BLIND,)
    for phase, turn, step, faults in (
        (CLOSED, brief, STEPS.turn, (BLIND,)),
        (TURNED, spun, _SPIN, slip),
        (AGAIN, 2 * np.pi, STEPS.turn, ()),
    ):
        parts = int(np.ceil(abs(turn) / step - 1e-9))
        injector = _injector(faults, (seed, len(ends)), readings[-1])
        for _ in range(parts):
            reading = simulator.turn(turn / parts)
            readings += _felt(injector, reading, readings[-1], is_blind=bool(faults))
            truth.append(simulator.pose)
        ends[phase] = len(readings) - 1
    return Lesson(
        readings=tuple(readings),
        truth=np.array(truth),
        ends=ends,
        sightings=tuple(sightings),
        targets=scene.targets,
    )


def sightings_of(scene: Scene, number: int, reading: Reading, pose: Pose) -> list[Sighting]:
    """Return the targets that a robot sees near it, as it sees them.

    The true pose tells only which beam points to a target and whether something hides it; the
    point is where that beam ends, and by the target's depth behind it.

    Args:
        scene: The scene.
        number: The reading's number.
        reading: The reading.
        pose: The robot's true pose.
    """
    scan = reading.required_laser("a sighting")
    geometry = scan.geometry
    eye = np.asarray(geometry.mount)
    seen = _rotated(compose(pose, eye), scene.targets)
    found = []
    for target, (x, y) in enumerate(seen.tolist()):
        distance = float(np.hypot(x, y))
        beam = round((np.arctan2(y, x) - geometry.first_bearing) / geometry.spacing)
        if distance > scene.near or not 0 <= beam < geometry.beams:
            continue
        reach = scan.ranges[beam] + scene.depth
        if abs(reach - distance) < _TOLERANCE:
            point = eye[:2] + reach * geometry.directions[beam]
            found.append(Sighting(target=target, reading=number, point=point))
    return found


def _rotated(frame: Pose, points: Points) -> Points:
    """Return points of the world in a frame that is given in the world (m)."""
    poses = np.concatenate((points, np.zeros((len(points), 1))), axis=1)
    return relative(frame, poses)[:, :2]


def _injector(specs: tuple[str, ...], seed: tuple[int, ...], before: Reading) -> FaultInjector:
    """Return an injector whose first reading, which is never struck, is already past."""
    faults = parse_faults(specs, READING_FAULTS)
    kept = [each for each in faults if isinstance(each, ReadingFault)]
    geometry = before.required_laser("a lesson").geometry
    injector = FaultInjector(kept, seed, geometry, None)
    injector.feed(before, Clock(0.0, 0.0))
    return injector


def _felt(
    injector: FaultInjector, reading: Reading, before: Reading, *, is_blind: bool
) -> list[Reading]:
    """Return a reading as the robot gets it; without sight, also its sky compass stands still."""
    arrived = injector.feed(reading, Clock(reading.stamp, 0.0))
    return [replace(each, compass=before.compass) for each in arrived] if is_blind else arrived
