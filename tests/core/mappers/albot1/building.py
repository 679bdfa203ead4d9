"""A building of rooms, no two alike, through whose doors a network of places is led."""

from __future__ import annotations

import numpy as np

from albot_core.geometry.poses import compose, transform_segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.places.network import PlaceNetwork
from albot_core.mappers.albot1.places.place import middle
from albot_core.mappers.albot1.places.recognition import candidate_gates, recognize_place
from albot_core.mappers.albot1.places.relocalisation import Sight

SIDE = 8.0
"""Side of a square room (m); its middle is at SIDE times its column and row."""

Room = tuple[int, int]

RING: list[Room] = [(1, 0), (1, 1), (0, 1), (0, 0)]
"""A way round four rooms, back to where it sets out."""


def door_between(room: Room, other: Room) -> np.ndarray:
    """The line across the door from a room to the next, with the room to its left (m)."""
    along = np.array(other) - np.array(room)
    across = 0.45 * np.array([-along[1], along[0]])
    at = SIDE * (np.array(room) + 0.5 * along)
    return np.array([*(at - across), *(at + across)])


def walls_of(room: Room) -> np.ndarray:
    """Ten walls (10, 4) in a room, as in no other."""
    rng = np.random.default_rng([room[0] + 100, room[1] + 100])
    middles, turns = rng.uniform(-3, 3, (10, 2)), rng.uniform(-np.pi, np.pi, 10)
    half = 0.5 * rng.uniform(0.8, 2, 10)[:, None] * np.stack((np.cos(turns), np.sin(turns)), 1)
    return np.concatenate((middles - half, middles + half), 1) + SIDE * np.array([*room, *room])


class Walker:
    """A robot that goes from room to room; its map lies at `drift` off the building."""

    def __init__(self, config: PlacesConfig | None = None) -> None:
        self.network = PlaceNetwork(config or PlacesConfig())
        self.room: Room = (0, 0)
        self.step = 1
        self.rooms: list[Room | None] = [None, (0, 0)]
        self.drift = np.zeros(3)

    def seen(self) -> np.ndarray:
        """The present room's walls in the map."""
        return transform_segments(self.drift, walls_of(self.room))

    def sight(self) -> Sight:
        """What it has seen since it was carried into the present room, all of it in view."""
        return Sight(seen=self.seen(), view=self.seen(), pose=self.pose())

    def pose(self, share: float = 0.0) -> np.ndarray:
        """In the present room's middle, or a share of 4 m towards +x."""
        at = SIDE * np.array(self.room) + np.array([4 * share, 0.0])
        return compose(self.drift, np.array([*at, 0.0]))

    def go(self, other: Room, drift: np.ndarray | None = None) -> None:
        """Through the door into the next room; the map may have drifted on the way."""
        self.step += 1
        line = door_between(self.room, other)
        left_seen = self.seen()
        if drift is not None:
            self.drift = compose(self.drift, drift)
        placed = transform_segments(self.drift, line[None])[0]
        left_of = middle(line) + 0.3 * (np.array(other) - np.array(self.room))
        pose = compose(self.drift, np.array([*left_of, 0.0]))
        self.network.remember_place(self.step, placed, left_seen, pose)
        self.room = other
        self.rooms.append(other)

    def recognize(self) -> bool:
        """Many walls of every earlier visit to this room are met: is it one of those places?"""
        visits = range(len(self.network.visits))
        reobserved = [20 if self.rooms[visit] == self.room else 0 for visit in visits]
        reobserved[-1] = 0
        return self.looks(np.array(reobserved, np.int32))

    def looks(self, reobserved: np.ndarray) -> bool:
        """So many walls of each earlier visit are met."""
        counts = np.stack((reobserved, candidate_gates(self.network, self.pose())), -1)
        no_exits = np.empty((0, 4))
        return recognize_place(self.network, self.step, counts, self.seen(), no_exits, self.pose())


def led(rooms: list[Room], config: PlacesConfig | None = None) -> Walker:
    """A robot that has gone from room to room."""
    walker = Walker(config)
    for room in rooms:
        walker.go(room)
    return walker


def happened(walker: Walker) -> list[tuple[EventKind, int, int]]:
    """What the robot's network recorded, each with its places."""
    return [(event.kind, event.place, event.other) for event in walker.network.log.events]


def check_links(network: PlaceNetwork) -> None:
    """Every exit's partner leads back to it, and no exit leads to where it is."""
    for key, place in network.places.items():
        assert place.id == key
        for index, door in enumerate(place.exits):
            assert door.leads_to in network.places
            assert door.leads_to != key
            partner = network.places[door.leads_to].exits[door.exit_there]
            assert (partner.leads_to, partner.exit_there) == (key, index)
    assert network.current in network.places
    assert network.visits[-1] == network.stays[-1][1] == network.current
    assert set(network.visits[1:]) <= network.places.keys()
    assert {place for _, place in network.stays} <= network.places.keys()
    assert len(network.visit_transforms) == len(network.visits)
    assert network.next_id > max(network.places)
