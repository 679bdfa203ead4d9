"""Faults of the world and of the robot's place in it: what somebody does to both.

Where a strike is impossible, because a world has no such door for example, nothing happens, and it
does not count as one.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
import shapely

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.sensing.faults.fault import Fault, LastingFault, Need, quantity
from albot_core.sensing.faults.span import DEGREES, METRES, Span
from albot_env.tasks.homing_by_map.changes import (
    carried_pose,
    doors_of,
    shut_on_way_home,
    with_door_shut,
    with_furniture_moved,
)
from albot_maps import World
from albot_maps.geodesic import DistanceField
from albot_maps.movables import SMALLEST_SIDE, TOLERANCE, Box
from albot_maps.world import Exit

HEAVY = 1000.0
"""Mass of what stands in an exit (kg): no robot pushes it."""
_SPARE = 0.2
"""It leaves so much room beside the robot (m)."""
_CRACK = 2 * TOLERANCE
"""Width of the crack that a shut door leaves on either side (m)."""
_BODY = 0.5
"""Width of a person (m)."""
_TRIES = 60
"""Number of random poses that are tried."""


class Situation(NamedTuple):
    """Where a fault strikes."""

    world: World
    """The world at this moment."""
    pose: Pose
    """Pose of the robot (world frame)."""
    home: Points
    """Where its episode began (m)."""


class Change(NamedTuple):
    """What a strike changes."""

    pose: Pose | None = None
    """Where the robot is put; None for where it is."""
    box: Box | None = None
    """What stands in an exit from now on, for as long as the strike lasts."""
    walls: Segments | None = None
    """The walls from now on, as many as before; None for the same."""


class WorldFault(Fault, ABC):
    """A fault of the world, or of the robot's place in it."""

    needs: ClassVar[tuple[Need, ...]] = ("world",)

    @abstractmethod
    def strike(
        self, here: Situation, values: dict[str, float], rng: np.random.Generator
    ) -> Change | None:
        """Return what changes; None if a strike is impossible.

        Args:
            here: Where it strikes.
            values: The quantities of the strike.
            rng: Its random numbers.
        """


@dataclass(frozen=True, kw_only=True)
class Kidnap(WorldFault):
    """The robot is lifted, carried to another place and turned, and its wheels stand still."""

    name: ClassVar[str] = "kidnap"
    summary: ClassVar[str] = (
        "The robot is lifted and put elsewhere, into another room if there is one, and turned."
    )
    away: Span = quantity("5m", METRES, most=1000.0)
    """Smallest distance that it is carried where there is no other room."""

    def strike(
        self, here: Situation, values: dict[str, float], rng: np.random.Generator
    ) -> Change | None:
        """Return the new pose."""
        position = here.pose[:2]
        field = DistanceField(here.world.walls, here.world.robot_radius, here.home)
        pose = carried_pose(here.world, field, position, rng)
        if pose is None:
            pose = _anywhere(here, values["away"], rng)
        return None if pose is None else Change(pose=pose)


def _anywhere(here: Situation, away: float, rng: np.random.Generator) -> Pose | None:
    """Draw a free pose that the robot can reach, some distance away; None if none is found."""
    world = here.world
    low, high = np.array(world.bounds).reshape(2, 2)
    for _ in range(_TRIES):
        point, heading = rng.uniform(low, high), rng.uniform(-math.pi, math.pi)
        is_free = world.movables.gap(*point.tolist()) > 2 * world.robot_radius
        if math.dist(point, here.pose[:2]) >= away and is_free and world.reaches(point):
            return np.array((*point, heading))
    return None


@dataclass(frozen=True, kw_only=True)
class Turned(WorldFault):
    """The robot is turned where it stands, and its wheels stand still."""

    name: ClassVar[str] = "turned"
    summary: ClassVar[str] = "The robot is lifted, turned to either side and put down again."
    angle: Span = quantity("60..180deg", DEGREES, most=180.0)
    """Angle by which it is turned."""

    def strike(
        self, here: Situation, values: dict[str, float], rng: np.random.Generator
    ) -> Change | None:
        """Return the new pose."""
        side = 1.0 if rng.integers(2) else -1.0
        return Change(pose=here.pose + np.array((0.0, 0.0, side * values["angle"])))


@dataclass(frozen=True, kw_only=True)
class DoorShut(WorldFault):
    """A door is shut for good; every room can still be reached."""

    name: ClassVar[str] = "door-shut"
    needs: ClassVar[tuple[Need, ...]] = ("world", "movables")
    summary: ClassVar[str] = (
        "A door is shut: one on the way home to which there is another way, or else any one that "
        "cuts no room off."
    )

    def strike(
        self, here: Situation, values: dict[str, float], rng: np.random.Generator
    ) -> Change | None:
        """Return the door, as something that stands in its exit."""
        world, position = here.world, here.pose[:2]
        field = DistanceField(world.walls, world.robot_radius, here.home)
        shut = shut_on_way_home(world, field, position, here.home)
        if shut is not None:
            leaf = shut.world.walls[-1]
            box = _in_exit(here, leaf, math.dist(leaf[:2], leaf[2:]) - 2 * _CRACK)
            if box is not None:
                return Change(box=box)
        doors = doors_of(world)
        for k in rng.permutation(len(doors)).tolist():
            leaf = doors[k].segment
            box = _in_exit(here, leaf, math.dist(leaf[:2], leaf[2:]) - 2 * _CRACK)
            if box is not None and with_door_shut(world, doors[k]) is not None:
                return Change(box=box)
        return None


@dataclass(frozen=True, kw_only=True)
class FurnitureMoved(WorldFault):
    """Furniture is moved within its rooms."""

    name: ClassVar[str] = "furniture-moved"
    summary: ClassVar[str] = "Half of the furniture is moved within its rooms."

    def strike(
        self, here: Situation, values: dict[str, float], rng: np.random.Generator
    ) -> Change | None:
        """Return the walls after that."""
        moved = with_furniture_moved(here.world, here.pose[:2], rng)
        return None if moved is None else Change(walls=moved.walls)


@dataclass(frozen=True, kw_only=True)
class PersonInExit(LastingFault, WorldFault):
    """A person stands in an exit for a while, and lets nobody through."""

    name: ClassVar[str] = "person-in-exit"
    needs: ClassVar[tuple[Need, ...]] = ("world", "movables")
    summary: ClassVar[str] = (
        "A person stands in the only exit to home, or else in the first exit on the way home, or "
        "in the nearest."
    )
    lasting: Span = quantity("10..60s", "m", "s", least=1e-3)

    def strike(
        self, here: Situation, values: dict[str, float], rng: np.random.Generator
    ) -> Change | None:
        """Return the person, as something that stands in the exit."""
        for door in _by_importance(here):
            width = math.dist(door.segment[:2], door.segment[2:])
            body = max(_BODY, width - 3 * here.world.robot_radius)
            box = _in_exit(here, door.segment, min(body, width - 2 * _CRACK))
            if box is not None:
                return Change(box=box)
        return None


def _by_importance(here: Situation) -> Iterator[Exit]:
    """Yield the doors: the only ones on the way home first, then others on it, then the nearest."""
    world, position = here.world, here.pose[:2]
    field = DistanceField(world.walls, world.robot_radius, here.home)
    points = field.path(position)
    doors = list(doors_of(world))
    lines = [shapely.LineString(np.reshape(door.segment, (2, 2))) for door in doors]
    robot = shapely.Point(position)
    on_way = []
    if len(points):
        way = shapely.LineString(np.concatenate((position[np.newaxis], points)))
        met = [k for k, line in enumerate(lines) if way.intersects(line)]
        on_way = sorted(met, key=lambda k: way.project(way.intersection(lines[k]).centroid))
    only = [k for k in on_way if with_door_shut(world, doors[k]) is None]
    others = sorted(range(len(doors)), key=lambda k: lines[k].distance(robot))
    for k in dict.fromkeys((*only, *on_way, *others)):
        yield doors[k]


def _in_exit(here: Situation, segment: np.ndarray, width: float) -> Box | None:
    """Return something so wide (m) in the middle of an exit; None if the robot is in its way."""
    (x1, y1, x2, y2), radius = segment.tolist(), here.world.robot_radius
    if width < SMALLEST_SIDE:
        return None
    heading = math.atan2(y2 - y1, x2 - x1)
    box = Box(
        at=((x1 + x2) / 2, (y1 + y2) / 2),
        heading=heading,
        length=width,
        width=SMALLEST_SIDE,
        mass=HEAVY,
    )
    if box.outline.distance(shapely.Point(here.pose[:2])) < radius + _SPARE:
        return None
    return box if with_boxes(here.world, (box,)) is not None else None


def with_boxes(world: World, boxes: Sequence[Box]) -> World | None:
    """Return a world with more boxes, after its own; None if they have no room there."""
    if not boxes:
        return world
    movables = replace(world.movables, boxes=(*world.movables.boxes, *boxes))
    try:
        return replace(world, movables=movables)
    except InputError:
        return None
