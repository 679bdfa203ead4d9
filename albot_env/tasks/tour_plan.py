"""Which rooms a tour leads to, and where in them it stops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.ranges import SHARE, check_fields
from albot_maps import World
from albot_maps.freespace import FreeSpace

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


class Stops:
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
