"""Journeys that robots have made before an episode begins, and their cache.

A journey is a function of its world, start and number (and of the robot's equipment). It does
not depend on who asks for it or when. So it may be cached, given to any robot, or made in
another process: the result is the same.
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

KEPT_BYTES = 2**30
"""Size limit of the process-wide cache of journeys (bytes, see `journey_bytes`); the least
recently used journeys are dropped and made again when needed."""
ASSUMED_BYTES = 256 * 2**10
"""Assumed size of a journey of a kind that has not been made yet (bytes)."""


@runtime_checkable
class Journey(Protocol):
    """A completed journey: a frozen dataclass."""

    @property
    def world(self) -> World:
        """The world of the journey."""


Kept = TypeVar("Kept", bound=Journey)


class JourneySpec(NamedTuple):
    """The arguments that determine a journey."""

    world: World
    """World of the journey."""
    start: Pose
    """Start pose (world frame)."""
    number: int
    """Number of the journey among those from this start."""


def journey_bytes(journey: Any) -> int:
    """Return the size of a journey: the bytes of all arrays in it, each counted once.

    Worlds do not count: they exist anyway, and many journeys share one. Values that are
    computed from a journey later do not count either.
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
    """A cache of journeys. Each entry holds its world, so that the world's id stays unique.

    The first item of a key is the kind of the journey.

    Args:
        limit: Maximum size of all entries together (bytes). A larger journey is not kept.
    """

    def __init__(self, limit: int = KEPT_BYTES) -> None:
        self.limit = limit
        self._kept: OrderedDict[tuple[Any, ...], tuple[Any, int]] = OrderedDict()
        self._bytes = 0
        self._heaviest: dict[Any, int] = {}
        self._lock = Lock()

    def __contains__(self, key: tuple[Any, ...]) -> bool:
        """Whether the journey with this key is in the cache."""
        with self._lock:
            return key in self._kept

    def fetch(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """Return the journey with this key; make and keep it if it is not in the cache."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key][0]
        journey = make()
        self.put(key, journey)
        return journey

    def put(self, key: tuple[Any, ...], journey: Any) -> None:
        """Keep a journey; drop the least recently used ones if the limit is exceeded."""
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
        """Return how many journeys of a kind would fit if there were no others.

        Each is assumed to be as large as the largest of its kind so far; `ASSUMED_BYTES` before
        the first is made.
        """
        with self._lock:
            return self.limit // max(1, self._heaviest.get(kind, ASSUMED_BYTES))

    def clear(self) -> None:
        """Drop all entries."""
        with self._lock:
            self._kept.clear()
            self._heaviest.clear()
            self._bytes = 0


JOURNEY_CACHE = JourneyCache()
"""The cache of this process."""
_LATEST = JourneyCache(limit=16 * 2**20)
"""The latest journeys of those that are new each time: agents that are compared, one after another
in the same episode, make the same one if they have the same equipment."""


class Journeys(ABC, Generic[Kept]):
    """Makes journeys of one kind, and caches them.

    Args:
        environment: Id of the environment, for error messages.
        kind: What the journeys depend on besides their specs.
        count: Number of different journeys per start; 0 for a new one each time.

    Raises:
        InputError: The number of journeys is negative.
    """

    def __init__(self, environment: str, kind: tuple[Any, ...], count: int) -> None:
        if count not in COUNT:
            raise InputError(environment, COUNT.expected, str(count), place="journeys")
        self.kind = kind
        """What the journeys depend on besides their specs."""
        self._count = count

    @abstractmethod
    def travel(self, spec: JourneySpec) -> Kept:
        """Make a journey."""

    def draw(self, world: World, start: Pose, rng: np.random.Generator) -> Kept:
        """Draw a journey from a start at random."""
        spec = JourneySpec(world, start, int(rng.integers(self._count or 2**63)))
        cache = JOURNEY_CACHE if self._count else _LATEST
        kept: Kept = cache.fetch(self._key(spec), lambda: self.travel(spec))
        return kept

    def missing(self, worlds: Sequence[WorldSet]) -> list[JourneySpec]:
        """Return the journeys in these worlds that are not cached; none if not all would fit.

        Whether they would fit is an estimate (see `JourneyCache.room_for`).
        """
        room = JOURNEY_CACHE.room_for(self.kind)
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

    def keep(self, spec: JourneySpec, journey: Kept) -> Kept:
        """Cache a journey that was made elsewhere; return it with the world of `spec`."""
        kept = replace(journey, world=spec.world)  # type: ignore[type-var]
        JOURNEY_CACHE.put(self._key(spec), kept)
        return kept

    def _key(self, spec: JourneySpec) -> tuple[Any, ...]:
        return (self.kind, id(spec.world), spec.start.tobytes(), spec.number)
