"""A network of places compared with the true rooms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.events import Event, EventKind
from albot_core.mappers.albot1.places.network import START
from albot_core.mappers.registry import make_mapper
from albot_core.maps.layers import PlaceGraph
from albot_experiments.mapping import ALBOT1, EVERY_READING
from albot_experiments.tours import TourRecord
from albot_maps import World

DOORWAY = 1.0
"""Within this distance of an exit's middle a robot may be in the room on either side (m)."""
NEARBY = 2.0
"""An exit that the robot goes through is seen at most this far from the robot (m)."""

Line = Float64[np.ndarray, "4"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossing:
    """The mapper's discovery that the robot has gone through an exit."""

    view: int
    """The view of the discovery."""
    exit: str
    """The true exit's name."""
    seen: Line
    """The exit as seen, in the map's frame (m); NaN if it was not seen."""
    expected: Line
    """The nearest expected exit of the place that the robot left (m); NaN if there was none."""

    @property
    def gap(self) -> float:
        """Distance between the middles of the exit seen and the one expected (m)."""
        return between(self.seen, self.expected)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedTour:
    """A mapper with a network of places at the end of a journey."""

    journey: TourRecord
    mapper: Albot1
    """The mapper after the last view."""
    poses: Poses
    """(views, 3): the estimated pose at every view, in the map's frame."""
    places: Int64[np.ndarray, "views"]
    """For every view, the final id of the place in which the robot believed to be."""
    crossings: tuple[Crossing, ...]
    """The exits that the robot went through, in order."""
    frames: Mapping[int, Pose]
    """The true pose of each place's frame (world): that of the robot when it began the place."""

    @property
    def events(self) -> tuple[Event, ...]:
        """The events of the network."""
        return self.mapper.events

    @property
    def place_graph(self) -> PlaceGraph:
        """The network at the end."""
        return self.mapper.snapshot().place_graph

    def rooms(self, world: World) -> dict[int, frozenset[str]]:
        """Return the rooms in which the robot truly was while it believed to be in each place.

        Positions in doorways do not count.
        """
        doors = np.array([door.segment.reshape(2, 2).mean(axis=0) for door in world.exits])
        rooms: dict[int, set[str]] = {}
        for place, (x, y) in zip(self.places.tolist(), self.journey.truth[:, :2], strict=True):
            room = world.room_at(x, y)
            if room is not None and np.hypot(*(doors - (x, y)).T).min() > DOORWAY:
                rooms.setdefault(place, set()).add(room)
        return {place: frozenset(found) for place, found in rooms.items()}

    def is_right(self, world: World) -> bool:
        """Return whether every place is one room, every room one place, and all exits join them."""
        rooms = self.rooms(world)
        names = [next(iter(found)) for found in rooms.values() if len(found) == 1]
        if len(names) < len(rooms) or sorted(names) != sorted(room.name for room in world.rooms):
            return False
        graph = self.place_graph
        if {node.id for node in graph.nodes} != rooms.keys():
            return False
        room_of = dict(zip(rooms, names, strict=True))
        links = {frozenset((room_of[one], room_of[other])) for one, other in graph.links}
        return links == {frozenset(door.rooms) for door in world.exits}


def place_tour(name: str, world: World, journey: TourRecord, config: object = None) -> PlacedTour:
    """Run a new mapper on a journey, and record its beliefs.

    `config` is as for `make_mapper`; by default every reading is a view.

    Raises:
        InputError: The mapper is not one of Albot1's.
    """
    if config is None and name in ALBOT1:
        config = EVERY_READING
    mapper = make_mapper(name, config=config)
    if not isinstance(mapper, Albot1):
        raise InputError("mapper", "one of Albot1's", name)
    poses, places = np.empty_like(journey.truth), np.zeros(len(journey.truth), np.int64)
    crossings: list[Crossing] = []
    frames = {START: journey.truth[0]}
    place, known = START, mapper.events
    for view, reading in enumerate(journey.readings):
        expected, before = mapper.predicted_exits, mapper.exits
        mapper.update(reading)
        new, known = new_events(known, mapper.events), mapper.events
        for event in new:
            if event.kind in (EventKind.NEW, EventKind.ENTERED, EventKind.LOST):
                place = event.other
            if event.kind in (EventKind.NEW, EventKind.LOST):
                frames[event.other] = journey.truth[view]
        poses[view], places[view] = mapper.estimate.pose, place
        if any(event.kind in (EventKind.NEW, EventKind.ENTERED) for event in new):
            line = _nearest(before, poses[view - 1 : view + 1, :2].mean(axis=0))
            crossing = Crossing(
                view=view,
                exit=_true_exit(world, journey.truth[view - 1 : view + 1, :2].mean(axis=0)),
                seen=line,
                expected=_nearest(expected, middle(line)),
            )
            crossings.append(crossing)
    same = same_in_the_end(mapper.events)
    return PlacedTour(
        journey=journey,
        mapper=mapper,
        poses=poses,
        places=np.array([same.get(place, place) for place in places.tolist()]),
        crossings=tuple(crossings),
        frames=frames,
    )


def new_events(before: Sequence[Event], after: Sequence[Event]) -> tuple[Event, ...]:
    """Return the events of `after` that are not in `before`, although the log may forget old ones.

    Both are a network's events, before and after a reading.
    """
    last = before[-1]
    return tuple(takewhile(lambda event: event is not last, reversed(after)))[::-1]


def same_in_the_end(events: Iterable[Event]) -> Mapping[int, int]:
    """Return the final id of every place that was merged: the least of the merged ids."""
    same: dict[int, int] = {}
    for event in events:
        if event.kind in (EventKind.RECOGNIZED, EventKind.FOLLOWED, EventKind.RELOCALISED):
            kept, gone = sorted((event.place, event.other))
            same[gone] = kept
            same = {place: kept if into == gone else into for place, into in same.items()}
    return same


def middle(line: Line) -> Points:
    """Return the middle of a line (m)."""
    return np.asarray(0.5 * (line[:2] + line[2:]))


def between(one: Line, other: Line) -> float:
    """Return the distance between the middles of two lines (m)."""
    return float(np.hypot(*(middle(one) - middle(other))))


def _nearest(lines: Float64[np.ndarray, "lines 4"], point: Points) -> Line:
    """Return the line whose middle is nearest to a point; NaN if none is near."""
    away = [float(np.hypot(*(middle(line) - point))) for line in lines]
    if not away or not min(away) < NEARBY:
        return np.full(4, np.nan)
    return np.asarray(lines[int(np.argmin(away))])


def _true_exit(world: World, point: Points) -> str:
    away = [float(np.hypot(*(middle(door.segment) - point))) for door in world.exits]
    return world.exits[int(np.argmin(away))].name
