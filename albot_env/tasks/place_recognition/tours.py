"""Tours: robots guided through a building, in whose rooms they stop more than once.

The guide sees where the robot truly is, so that what it errs does not change the way.
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
from albot_core.ranges import SHARE, check_fields
from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import THESIS_STEPS, Simulator, follow_leg
from albot_env.tasks.core.journeys import Journeys, JourneySpec
from albot_env.tasks.core.settings import Equipment
from albot_env.tasks.place_recognition.arrivals import PlaceDatabase
from albot_env.tasks.place_recognition.spaces import arrivals_observation
from albot_maps import ROBOT_RADIUS, World
from albot_maps.freespace import FreeSpace
from albot_maps.geodesic import DistanceField
from albot_maps.same_place import same_places

AROUND = 8
"""At each stop the robot turns round in so many parts, and looks after each."""
_WORLDS_KEPT = 1024
"""In so many worlds it is kept where tours can stop."""
_ROOM = 0.1
"""How much farther than it must the robot keeps from walls on its way (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TourStop:
    """An arrival: what the robot then knew, and how things truly were."""

    candidates: Float32[np.ndarray, "arrivals features"]
    """The features of each arrival before (see `spaces.FEATURES`)."""
    reading: Reading
    """The last reading."""
    belief: Pose
    """Where it believed to be (map frame)."""
    snapshot: MapSnapshot
    """Its map."""
    activity: Activity | None
    """The activity of its attractor network; None where its mapper has none."""
    pose: Pose
    """Where it was (world frame)."""
    room: int
    """In which room of the world."""
    path_length: float
    """How far it had driven (m)."""
    collided: bool
    """Whether it had touched something since the arrival before."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tour:
    """A tour that is over."""

    world: World
    """Where it was."""
    start: Pose
    """Where it began (world frame)."""
    stops: tuple[TourStop, ...]
    """Its arrivals, that where it began the first."""
    most: int
    """How many earlier arrivals there can be on such a tour."""

    @cached_property
    def same(self) -> Bool[np.ndarray, "arrivals arrivals"]:
        """Which arrivals truly were at one place (see `albot_maps.same_place`)."""
        rooms = np.array([stop.room for stop in self.stops])
        return same_places(self.world, np.array([stop.pose[:2] for stop in self.stops]), rooms)

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The arrivals in arrays, a row each, by the names of `reward.TourTable`."""
        stops, beliefs = self.stops, np.array([stop.belief for stop in self.stops])
        poses = np.array([stop.pose for stop in stops])
        sonars = [stop.reading.sonar for stop in stops]
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
        }


class Tours(Journeys[Tour]):
    """Makes tours, and keeps them.

    Args:
        environment: Its id, for the errors.
        equipment: What the robots set out with. What moves is left out.
        config: How long tours are, and where they lead.
        count: How many different ones there are from a start; 0 for a new one each time.

    Raises:
        InputError: The number of journeys is negative, or the robot has no laser.
    """

    def __init__(
        self, environment: str, equipment: Equipment, config: TourConfig, count: int
    ) -> None:
        if equipment.sensors.laser is None:
            expected = "a laser, by whose panoramas earlier stops are compared"
            raise InputError(environment, expected, "none", place="laser")
        super().__init__(environment, (replace(equipment, threads=1), config), count)
        self._equipment = equipment
        self._config = config
        self._stops: OrderedDict[int, StoppingRooms] = OrderedDict()

    def check(self, world: World) -> None:
        """Refuse a world through which there is no tour.

        Raises:
            InputError: It has no two rooms in which a robot can stop, or not those wanted.
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
    """Leads a robot, which takes notes, from stop to stop."""

    def __init__(
        self, world: World, equipment: Equipment, start: Pose, rng: np.random.Generator
    ) -> None:
        self._world = world
        self._simulator = Simulator(world, sensors=equipment.sensors, movables=False)
        self._places = PlaceDatabase(equipment.single_mapper(rng.spawn(1)[0]))
        self._places.follow(self._simulator.reset(rng, start))
        self._path_length = 0.0
        self._collided = False

    def go(self, goal: Float64[np.ndarray, "2"]) -> bool:
        """Lead the robot to a point (m, world frame); whether there is a way for it."""
        simulator = self._simulator
        field = DistanceField(self._world.walls, ROBOT_RADIUS + _ROOM, goal)
        way = field.path(simulator.pose[:2])
        if not len(way):
            way = DistanceField(self._world.walls, ROBOT_RADIUS, goal, tight=True).path(
                simulator.pose[:2]
            )
        for turn in way:
            before = simulator.pose[:2]
            for reading in follow_leg(simulator, turn, THESIS_STEPS):
                self._places.follow(reading)
                self._collided |= simulator.collided
            self._path_length += float(np.hypot(*(simulator.pose[:2] - before)))
        return len(way) > 0

    def arrive(self) -> TourStop:
        """Let the robot look around, and note where it is."""
        simulator = self._simulator
        readings = [simulator.turn(2 * math.pi / AROUND) for _ in range(AROUND)]
        candidates = self._places.arrive(readings)
        pose = simulator.pose
        collided, self._collided = self._collided, False
        return TourStop(
            candidates=candidates,
            reading=readings[-1],
            belief=self._places.belief,
            snapshot=self._places.snapshot,
            activity=self._places.activity,
            pose=pose,
            room=_room_at(self._world, pose),
            path_length=self._path_length,
            collided=collided,
        )


def _room_at(world: World, pose: Pose) -> int:
    """The number of the room at a pose; -1 between rooms."""
    name = world.room_at(float(pose[0]), float(pose[1]))
    return -1 if name is None else [room.name for room in world.rooms].index(name)


CLEARANCE = 0.4
"""How far from walls, and from the room's outline, a tour stops (m)."""
SMALLEST = 0.15
"""Where less of a room is left, no tour stops there (m²)."""
NEAREST = 4
"""The next room is one of so many that are nearest."""
_DRAWN = 32
"""Points drawn at a time until one is free."""


@dataclass(frozen=True, kw_only=True)
class TourConfig:
    """How long a tour is, and where it leads."""

    arrivals: int = 20
    """How often the robot arrives somewhere, the place where it sets out counted."""
    revisits: float = 0.5
    """Share of the stops after the first two that are in rooms where it has been before."""
    rooms: tuple[str, ...] = ()
    """Names of the rooms to stop in, one after another; none given, they are drawn."""

    def __post_init__(self) -> None:
        if self.arrivals < 2:
            raise InputError("TourConfig.arrivals", "at least 2", str(self.arrivals))
        check_fields(self, SHARE, "revisits")

    @property
    def most(self) -> int:
        """How many earlier arrivals there can be."""
        return (len(self.rooms) + 1 if self.rooms else self.arrivals) - 1


class StoppingRooms:
    """The rooms of a world in which a tour can stop.

    Args:
        world: The world; what moves in it is left out.

    Raises:
        InputError: It has no two rooms in which a robot can stop.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        floor = FreeSpace(world.walls, CLEARANCE).region_at(world.starts[0, :2])
        insides = [shapely.Polygon(room.boundary).buffer(-CLEARANCE) for room in world.rooms]
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
        """The numbers of these rooms."""
        return list(self._parts)

    def named(self, names: tuple[str, ...]) -> list[int]:
        """The rooms of these names.

        Raises:
            InputError: There is no such room, or none in which a robot can stop.
        """
        numbers = {room.name: number for number, room in enumerate(self.world.rooms)}
        rooms = [numbers.get(name, -1) for name in names]
        for name, room in zip(names, rooms, strict=True):
            if room not in self._parts:
                expected = "a room of this world in which a robot can stop"
                raise InputError(self.world.source or self.world.name, expected, repr(name))
        return rooms

    def drawn(self, first: int, config: TourConfig, rng: np.random.Generator) -> Iterator[int]:
        """Rooms to stop in after the first one: near ones, new or known as the shares say.

        No room follows itself. The first one may be none in which a robot can stop. Where all are
        known, known ones follow; where only one is, a new one does.
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
        """One of the rooms that are nearest, as the crow flies."""
        middle = self._middles.get(here, self._middles[next(iter(self._middles))])
        away = [float(np.hypot(*(self._middles[room] - middle))) for room in rooms]
        nearest = np.argsort(away, kind="stable")[:NEAREST]
        return rooms[int(rng.choice(nearest))]

    def point(self, room: int, rng: np.random.Generator) -> Float64[np.ndarray, "2"]:
        """A point of a room in which to stop (m), each as likely."""
        part = self._parts[room]
        x_min, y_min, x_max, y_max = part.bounds
        while True:
            points = rng.uniform((x_min, y_min), (x_max, y_max), (_DRAWN, 2))
            free = np.flatnonzero(shapely.contains_xy(part, *points.T))
            if len(free):
                return np.asarray(points[free[0]])
