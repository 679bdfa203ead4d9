"""Journeys that robots have behind them when an episode begins, and the cache that keeps them.

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


class JourneyCache:
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


JOURNEY_CACHE = JourneyCache()
"""The journeys that are kept in this process."""


class Journeys(ABC, Generic[Kept]):
    """Makes journeys of one kind, and keeps them.

    Args:
        environment: Its id, for the errors.
        kind: What journeys depend on besides their specs.
        count: How many different ones there are from a start; 0 for a new one each time.

    Raises:
        InputError: There are fewer journeys than none.
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
        """The journeys through these worlds that are not kept yet; none where not all could be."""
        if not self._count or self._count * sum(map(len, worlds)) > KEPT:
            return []
        specs = [
            JourneySpec(world, np.asarray(start, np.float64), number)
            for some in worlds
            for world in some
            for start in world.starts
            for number in range(self._count)
        ]
        if len(specs) > KEPT:
            return []
        keys = {self._key(spec): spec for spec in specs}
        return [spec for key, spec in keys.items() if key not in JOURNEY_CACHE]

    def keep(self, spec: JourneySpec, journey: Kept) -> None:
        """Keep a journey that was made elsewhere."""
        JOURNEY_CACHE.put(self._key(spec), replace(journey, world=spec.world))  # type: ignore[type-var]

    def _key(self, spec: JourneySpec) -> tuple[Any, ...]:
        return (self._kind, id(spec.world), spec.start.tobytes(), spec.number)
