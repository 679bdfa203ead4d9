"""Tours: robots are guided through a building and stop in its rooms more than once.

The guide uses the robot's true pose, so that mapping errors do not change the path.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from jaxtyping import Bool, Float32, Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.ranges import FROM_TWO, SHARE, check_fields
from albot_core.sensing.faults.effect import ReadingFault
from albot_core.sensing.faults.fault import Clock
from albot_core.sensing.faults.injector import FaultInjector
from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import THESIS_STEPS, Simulator, follow_leg
from albot_env.tasks.core.faulty_readings import FAULT_STREAM, faults_of_readings
from albot_env.tasks.core.journeys import Journeys, JourneySpec
from albot_env.tasks.core.settings import Equipment
from albot_env.tasks.place_recognition.arrivals import PlaceDatabase
from albot_env.tasks.place_recognition.spaces import arrivals_observation
from albot_maps import World
from albot_maps.freespace import FreeSpace
from albot_maps.geodesic import DistanceField
from albot_maps.same_place import same_places

AROUND = 8
"""Number of parts of the turn at each stop; a reading is taken after each."""
_WORLDS_KEPT = 1024
"""Maximum number of worlds whose stopping rooms are cached."""
_ROOM = 0.1
"""Extra clearance from walls on the path (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TourStop:
    """An arrival: the robot's knowledge at that time, and the truth."""

    candidates: Float32[np.ndarray, "arrivals features"]
    """The features of each earlier arrival (see `spaces.FEATURES`)."""
    reading: Reading
    """The last reading."""
    belief: Pose
    """Believed pose (map frame)."""
    snapshot: MapSnapshot
    """The robot's map."""
    activity: Activity | None
    """The activity of its attractor network; None if its mapper has none."""
    pose: Pose
    """True pose (world frame)."""
    room: int
    """Index of the true room in the world; -1 between rooms."""
    path_length: float
    """True path length (m)."""
    collided: bool
    """Whether the robot touched something since the previous arrival."""
    fault: str = ""
    """Names of the faults that struck since the previous arrival, joined by `+`."""
    struck: int = 0
    """Number of strikes that have begun since the tour began."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tour:
    """A completed tour."""

    world: World
    """World of the tour."""
    start: Pose
    """Start pose (world frame)."""
    stops: tuple[TourStop, ...]
    """The arrivals; the first is the start."""
    most: int
    """Maximum number of earlier arrivals on such a tour."""

    @cached_property
    def same(self) -> Bool[np.ndarray, "arrivals arrivals"]:
        """Which arrivals truly were at the same place (see `albot_maps.same_place`)."""
        rooms = np.array([stop.room for stop in self.stops])
        return same_places(self.world, np.array([stop.pose[:2] for stop in self.stops]), rooms)

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """Return the arrivals as arrays, one row each, by the names of `reward.TourTable`."""
        stops, beliefs = self.stops, np.array([stop.belief for stop in self.stops])
        poses = np.array([stop.pose for stop in stops])
        sonars = [stop.reading.sonar for stop in stops]
        compasses = [stop.reading.compass for stop in stops]
        return {
            "observations": np.array(
                [arrivals_observation(stop.candidates, self.most) for stop in stops]
            ),
            "rooms": np.array([stop.room for stop in stops]),
            "poses": poses,
            "beliefs": beliefs,
            "errors": np.hypot(*(compose(self.start[None], beliefs) - poses)[:, :2].T),
            "path_lengths": np.array([stop.path_length for stop in stops]),
            "times": np.array([stop.reading.stamp for stop in stops]),
            "collided": np.array([stop.collided for stop in stops]),
            "ranges": np.array([stop.reading.required_laser("a tour").ranges for stop in stops]),
            "echoes": np.array([() if sonar is None else sonar.ranges for sonar in sonars], float),
            "compasses": np.array([0.0 if heading is None else heading for heading in compasses]),
        }


class Tours(Journeys[Tour]):
    """Makes tours, and caches them.

    Args:
        environment: Id of the environment, for error messages.
        equipment: Equipment of the robots. Dynamic obstacles are left out.
        config: Length and destinations of tours.
        count: Number of different tours per start; 0 for a new one each time.

    Raises:
        InputError: `count` is negative, the robot has no laser, or a fault is none of readings.
    """

    def __init__(
        self, environment: str, equipment: Equipment, config: TourConfig, count: int
    ) -> None:
        if equipment.sensors.laser is None:
            expected = "a laser, by whose panoramas earlier stops are compared"
            raise InputError(environment, expected, "none", place="laser")
        for fault in equipment.faults:
            if not isinstance(fault, ReadingFault):
                expected = "faults of readings: a guide leads the robot, and nothing moves"
                raise InputError(environment, expected, fault.name, place="faults")
        super().__init__(environment, (replace(equipment, threads=1), config), count)
        self._equipment = equipment
        self._config = config
        self._stops: OrderedDict[int, StoppingRooms] = OrderedDict()

    def check(self, world: World) -> None:
        """Raise InputError if a world has no tour.

        Raises:
            InputError: It does not have two rooms to stop in, or lacks a room of the config.
        """
        self._find_stops(world).named(self._config.rooms)

    def _find_stops(self, world: World) -> StoppingRooms:
        if id(world) not in self._stops:
            self._stops[id(world)] = StoppingRooms(world)
            if len(self._stops) > _WORLDS_KEPT:
                self._stops.popitem(last=False)
        return self._stops[id(world)]

    def travel(self, spec: JourneySpec) -> Tour:
        """Make a tour."""
        world, start, number = spec
        rng = np.random.default_rng((number, *start.view(np.uint64).tolist()))
        stops = self._find_stops(world)
        guide = _Guide(world, self._equipment, start, rng)
        made = [guide.arrive()]
        rooms: Iterator[int] = iter(stops.named(self._config.rooms))
        if not self._config.rooms:
            rooms = stops.drawn(made[0].room, self._config, rng)
        for room in rooms:
            if not guide.go(stops.point(room, rng)):
                break
            made.append(guide.arrive())
        return Tour(world=world, start=start.copy(), stops=tuple(made), most=self._config.most)


class _Guide:
    """Leads a robot with a place database from stop to stop."""

    def __init__(
        self, world: World, equipment: Equipment, start: Pose, rng: np.random.Generator
    ) -> None:
        self._world = world
        self._simulator = Simulator(
            world, robot=equipment.robot, sensors=equipment.sensors, movables=False
        )
        self._places = PlaceDatabase(equipment.single_mapper(rng.spawn(1)[0]))
        first = self._simulator.reset(rng, start)
        self._path_length, self._collided = 0.0, False
        faults, geometries = faults_of_readings(equipment.faults), equipment.sensors.geometries
        seed = self._simulator.key, FAULT_STREAM
        self._injector = FaultInjector(faults, seed, *geometries)
        self._faults: dict[str, None] = {}
        for reading in self._arrived(first):
            self._places.follow(reading)

    def _arrived(self, reading: Reading) -> list[Reading]:
        """Return the readings that arrive when one was taken."""
        simulator = self._simulator
        clock = Clock(simulator.time, self._path_length)
        arrived = self._injector.feed(reading, clock, contact=simulator.collided)
        self._faults |= dict.fromkeys(self._injector.active)
        return arrived

    def go(self, goal: Float64[np.ndarray, "2"]) -> bool:
        """Lead the robot to a point (m, world frame); return whether there is a path."""
        simulator = self._simulator
        walls, radius = self._world.walls, self._world.robot_radius
        way = DistanceField(walls, radius, goal, spare=_ROOM).path(simulator.pose[:2])
        if not len(way):
            way = DistanceField(walls, radius, goal, tight=True).path(simulator.pose[:2])
        for turn in way:
            before = simulator.pose[:2]
            for taken in follow_leg(simulator, turn, THESIS_STEPS):
                for reading in self._arrived(taken):
                    self._places.follow(reading)
                self._collided |= simulator.collided
            self._path_length += float(np.hypot(*(simulator.pose[:2] - before)))
        return len(way) > 0

    def arrive(self) -> TourStop:
        """Let the robot look around; return the stop."""
        simulator = self._simulator
        taken = [simulator.turn(2 * math.pi / AROUND) for _ in range(AROUND)]
        readings = [reading for each in taken for reading in self._arrived(each)]
        candidates = self._places.arrive(readings)
        pose = simulator.pose
        collided, self._collided = self._collided, False
        fault, self._faults = "+".join(self._faults), {}
        return TourStop(
            candidates=candidates,
            reading=readings[-1] if readings else taken[-1],
            belief=self._places.belief,
            snapshot=self._places.snapshot,
            activity=self._places.activity,
            pose=pose,
            room=_room_at(self._world, pose),
            path_length=self._path_length,
            collided=collided,
            fault=fault,
            struck=self._injector.struck,
        )


def _room_at(world: World, pose: Pose) -> int:
    """Return the index of the room at a pose; -1 between rooms."""
    name = world.room_at(float(pose[0]), float(pose[1]))
    return -1 if name is None else [room.name for room in world.rooms].index(name)


CLEARANCE = 0.15
"""Minimum distance of the robot's body at a stop from walls and from the room's outline (m)."""
SMALLEST = 0.15
"""Minimum area of a room, after that clearance, for a tour to stop there (m²)."""
NEAREST = 4
"""The next room is drawn from this many nearest rooms."""
_DRAWN = 32
"""Number of points drawn at a time until one is free."""


@dataclass(frozen=True, kw_only=True)
class TourConfig:
    """Length and destinations of a tour."""

    arrivals: int = 20
    """Number of arrivals, including the start."""
    revisits: float = 0.5
    """Share of the stops after the first two that are in rooms visited before."""
    rooms: tuple[str, ...] = ()
    """Names of the rooms to stop in, in order; empty to draw rooms."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_TWO, "arrivals")
        check_fields(self, SHARE, "revisits")

    @property
    def most(self) -> int:
        """Maximum number of earlier arrivals."""
        return (len(self.rooms) + 1 if self.rooms else self.arrivals) - 1


class StoppingRooms:
    """The rooms of a world in which a tour can stop.

    Args:
        world: The world; its dynamic obstacles are left out.

    Raises:
        InputError: It does not have two rooms in which a robot can stop.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        radius = world.robot_radius + CLEARANCE
        floor = FreeSpace(world.walls, radius).region_at(world.starts[0, :2])
        insides = [shapely.Polygon(room.boundary).buffer(-radius) for room in world.rooms]
        parts = [floor.intersection(inside) for inside in insides]
        self._parts = {k: part for k, part in enumerate(parts) if part.area > SMALLEST}
        if len(self._parts) < 2:
            expected = "a world with two rooms in which a robot can stop"
            raise InputError(world.source or world.name, expected, str(len(self._parts)))
        for part in self._parts.values():
            shapely.prepare(part)
        middles = [part.representative_point().coords[0] for part in self._parts.values()]
        self._middles = dict(zip(self._parts, np.array(middles), strict=True))

    @property
    def rooms(self) -> list[int]:
        """Indices of these rooms."""
        return list(self._parts)

    def named(self, names: tuple[str, ...]) -> list[int]:
        """Return the indices of the rooms with these names.

        Raises:
            InputError: A room is unknown, or a robot cannot stop in it.
        """
        numbers = {room.name: number for number, room in enumerate(self.world.rooms)}
        rooms = [numbers.get(name, -1) for name in names]
        for name, room in zip(names, rooms, strict=True):
            if room not in self._parts:
                expected = "a room of this world in which a robot can stop"
                raise InputError(self.world.source or self.world.name, expected, repr(name))
        return rooms

    def drawn(self, first: int, config: TourConfig, rng: np.random.Generator) -> Iterator[int]:
        """Yield the rooms to stop in after the first: near, and visited with share `revisits`.

        No room follows itself. The first may be one where a robot cannot stop. If all rooms are
        visited, visited ones follow; if only one is, a new one follows.
        """
        here, known = first, [first] if first in self._parts else []
        for _ in range(config.arrivals - 1):
            new = [room for room in self._parts if room not in known]
            old = [room for room in known if room != here]
            again = old and (not new or (len(known) > 2 and rng.random() < config.revisits))
            here = self._near(here, old if again else new, rng)
            if here not in known:
                known.append(here)
            yield here

    def _near(self, here: int, rooms: list[int], rng: np.random.Generator) -> int:
        """Return one of the nearest rooms, by straight-line distance."""
        middle = self._middles.get(here, self._middles[next(iter(self._middles))])
        away = [float(np.hypot(*(self._middles[room] - middle))) for room in rooms]
        nearest = np.argsort(away, kind="stable")[:NEAREST]
        return rooms[int(rng.choice(nearest))]

    def point(self, room: int, rng: np.random.Generator) -> Float64[np.ndarray, "2"]:
        """Return a point of a room in which to stop (m), drawn uniformly."""
        part = self._parts[room]
        x_min, y_min, x_max, y_max = part.bounds
        while True:
            points = rng.uniform((x_min, y_min), (x_max, y_max), (_DRAWN, 2))
            free = np.flatnonzero(shapely.contains_xy(part, *points.T))
            if len(free):
                return np.asarray(points[free[0]])
