"""Journeys that robots have behind them when an episode begins, and the cache that keeps them.

A journey depends on its world, start and number alone (and on the robot's equipment), not on who
asks for it or when. So it may be kept and given to any robot, made again, or made in another
process: the result is the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from threading import Lock
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Pose
from albot_core.ranges import COUNT
from albot_maps import World, WorldSet

KEPT_BYTES = 256 * 2**20
"""How much the journeys weigh that are kept in a process, whoever made them (bytes, see
`journey_bytes`); those that were longest not asked for are made again."""
ASSUMED_BYTES = 256 * 2**10
"""What a journey is taken to weigh before one of its kind was made (bytes)."""


@runtime_checkable
class Journey(Protocol):
    """A journey that is over: a frozen dataclass."""

    @property
    def world(self) -> World:
        """Where it was."""


Kept = TypeVar("Kept", bound=Journey)


class JourneySpec(NamedTuple):
    """What a journey is a function of."""

    world: World
    """Where it is."""
    start: Pose
    """Where it begins (world frame)."""
    number: int
    """Which of those that begin there."""


def journey_bytes(journey: Any) -> int:
    """What a journey weighs: the bytes of all arrays in it, one that it holds twice only once.

    Worlds weigh nothing: they are there anyway, and many journeys share one. Nor does what is
    worked out of a journey later.
    """
    seen: dict[int, Any] = {}
    left = [journey]
    while left:
        item = left.pop()
        if id(item) in seen or isinstance(item, World | str):
            continue
        seen[id(item)] = item
        if isinstance(item, Mapping):
            left.extend(item.values())
        elif isinstance(item, tuple | list):
            left.extend(item)
        elif not isinstance(item, np.ndarray) and hasattr(item, "__dict__"):
            left.extend(vars(item).values())
    return sum(item.nbytes for item in seen.values() if isinstance(item, np.ndarray))


class JourneyCache:
    """The journeys that are kept. Each holds its world, so that no other gets its id.

    A key begins with the kind of its journey.

    Args:
        limit: How much they weigh at most, all together (bytes). One that weighs more is not kept.
    """

    def __init__(self, limit: int = KEPT_BYTES) -> None:
        self.limit = limit
        self._kept: OrderedDict[tuple[Any, ...], tuple[Any, int]] = OrderedDict()
        self._bytes = 0
        self._heaviest: dict[Any, int] = {}
        self._lock = Lock()

    def __contains__(self, key: tuple[Any, ...]) -> bool:
        """Whether the journey with this key is kept."""
        with self._lock:
            return key in self._kept

    def fetch(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """The journey with this key, which is made where it is not kept."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key][0]
        journey = make()
        self.put(key, journey)
        return journey

    def put(self, key: tuple[Any, ...], journey: Any) -> None:
        """Keep a journey; those that were longest not asked for go where it would be too much."""
        size = journey_bytes(journey)
        with self._lock:
            self._heaviest[key[0]] = max(size, self._heaviest.get(key[0], 0))
            if size > self.limit:
                return
            _, before = self._kept.pop(key, (None, 0))
            self._kept[key] = journey, size
            self._bytes += size - before
            while self._bytes > self.limit:
                _, (_, dropped) = self._kept.popitem(last=False)
                self._bytes -= dropped

    def room_for(self, kind: Any) -> int:
        """How many journeys of a kind could be kept if there were no others.

        Each is taken to weigh what the heaviest of them did that was made so far; `ASSUMED_BYTES`
        before the first.
        """
        with self._lock:
            return self.limit // max(1, self._heaviest.get(kind, ASSUMED_BYTES))

    def clear(self) -> None:
        """Drop all."""
        with self._lock:
            self._kept.clear()
            self._heaviest.clear()
            self._bytes = 0


JOURNEY_CACHE = JourneyCache()
"""The journeys that are kept in this process."""


class Journeys(ABC, Generic[Kept]):
    """Makes journeys of one kind, and keeps them.

    Args:
        environment: Its id, for the errors.
        kind: What journeys depend on besides their specs.
        count: How many different ones there are from a start; 0 for a new one each time.

    Raises:
        InputError: The number of journeys is negative.
    """

    def __init__(self, environment: str, kind: tuple[Any, ...], count: int) -> None:
        if count not in COUNT:
            raise InputError(environment, COUNT.expected, str(count), place="journeys")
        self._kind = kind
        self._count = count

    @abstractmethod
    def travel(self, spec: JourneySpec) -> Kept:
        """Make a journey."""

    def draw(self, world: World, start: Pose, rng: np.random.Generator) -> Kept:
        """A journey from a start, drawn at random."""
        if not self._count:
            return self.travel(JourneySpec(world, start, int(rng.integers(2**63))))
        spec = JourneySpec(world, start, int(rng.integers(self._count)))
        kept: Kept = JOURNEY_CACHE.fetch(self._key(spec), lambda: self.travel(spec))
        return kept

    def missing(self, worlds: Sequence[WorldSet]) -> list[JourneySpec]:
        """The journeys through these worlds that are not kept yet; none where not all could be.

        Whether they could is an estimate (see `JourneyCache.room_for`).
        """
        room = JOURNEY_CACHE.room_for(self._kind)
        if not self._count or self._count * sum(map(len, worlds)) > room:
            return []
        specs = [
            JourneySpec(world, np.asarray(start, np.float64), number)
            for some in worlds
            for world in some
            for start in world.starts
            for number in range(self._count)
        ]
        if len(specs) > room:
            return []
        keys = {self._key(spec): spec for spec in specs}
        return [spec for key, spec in keys.items() if key not in JOURNEY_CACHE]

    def keep(self, spec: JourneySpec, journey: Kept) -> None:
        """Keep a journey that was made elsewhere."""
        JOURNEY_CACHE.put(self._key(spec), replace(journey, world=spec.world))  # type: ignore[type-var]

    def _key(self, spec: JourneySpec) -> tuple[Any, ...]:
        return (self._kind, id(spec.world), spec.start.tobytes(), spec.number)
