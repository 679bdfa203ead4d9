"""Journeys that robots have behind them when an episode begins, and the shelf that keeps them.

A journey is a function of its world, start and number alone (and of what the robot set out
with), whoever asks for it and when; so it may be kept and given to any robot, made again, or made
in another process, without making any difference.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from threading import Lock
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.ranges import COUNT
from albot_maps import World, WorldSet

KEPT = 1024
"""Journeys that are kept in a process, whoever made them; the one that was longest not asked
for is made again."""


@runtime_checkable
class InWorld(Protocol):
    """A journey that is over: a frozen dataclass."""

    @property
    def world(self) -> World:
        """Where it was."""


Kept = TypeVar("Kept", bound=InWorld)


class Ticket(NamedTuple):
    """What a journey is a function of."""

    world: World
    """Where it is."""
    start: Pose
    """Where it begins (world frame)."""
    number: int
    """Which of those that begin there."""


class Shelf:
    """The journeys that are kept. Each holds its world, whose id so is nobody else's."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Any, ...], Any] = OrderedDict()
        self._lock = Lock()

    def __contains__(self, key: tuple[Any, ...]) -> bool:
        """Whether the journey with this key is kept."""
        with self._lock:
            return key in self._kept

    def fetch(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """The journey with this key, which is made where it is not kept."""
        with self._lock:
            kept = self._kept.get(key)
        journey = make() if kept is None else kept
        self.put(key, journey)
        return journey

    def put(self, key: tuple[Any, ...], journey: Any) -> None:
        """Keep a journey."""
        with self._lock:
            self._kept[key] = journey
            self._kept.move_to_end(key)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)

    def clear(self) -> None:
        """Keep none any more."""
        with self._lock:
            self._kept.clear()


SHELF = Shelf()
"""The journeys that are kept in this process."""


class Journeys(ABC, Generic[Kept]):
    """Makes journeys of one kind, and keeps them.

    Args:
        task: Id of the environment, for the errors.
        kind: What journeys depend on besides their tickets.
        count: How many different ones there are from a start; 0 for a new one each time.

    Raises:
        InputError: There are fewer journeys than none.
    """

    def __init__(self, task: str, kind: tuple[Any, ...], count: int) -> None:
        if count not in COUNT:
            raise InputError(task, COUNT.expected, str(count), place="journeys")
        self._kind = kind
        self._count = count

    @abstractmethod
    def travel(self, ticket: Ticket) -> Kept:
        """Make a journey."""

    def draw(self, world: World, start: Pose, rng: np.random.Generator) -> Kept:
        """A journey from a start, drawn at random."""
        if not self._count:
            return self.travel(Ticket(world, start, int(rng.integers(2**63))))
        ticket = Ticket(world, start, int(rng.integers(self._count)))
        kept: Kept = SHELF.fetch(self._key(ticket), lambda: self.travel(ticket))
        return kept

    def missing(self, worlds: Sequence[WorldSet]) -> list[Ticket]:
        """The journeys through these worlds that are not kept yet; none where not all could be."""
        if not self._count or self._count * sum(map(len, worlds)) > KEPT:
            return []
        tickets = [
            Ticket(world, np.asarray(start, np.float64), number)
            for some in worlds
            for world in some
            for start in world.starts
            for number in range(self._count)
        ]
        if len(tickets) > KEPT:
            return []
        keys = {self._key(ticket): ticket for ticket in tickets}
        return [ticket for key, ticket in keys.items() if key not in SHELF]

    def keep(self, ticket: Ticket, journey: Kept) -> None:
        """Keep a journey that was made elsewhere."""
        SHELF.put(self._key(ticket), replace(journey, world=ticket.world))  # type: ignore[type-var]

    def _key(self, ticket: Ticket) -> tuple[Any, ...]:
        return (self._kind, id(ticket.world), ticket.start.tobytes(), ticket.number)
