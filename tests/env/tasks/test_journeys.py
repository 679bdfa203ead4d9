"""The cache of journeys: what it keeps, what goes first, and what is made beforehand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from albot_env.tasks.core import journeys
from albot_env.tasks.core.journeys import (
    ASSUMED_BYTES,
    KEPT_BYTES,
    JourneyCache,
    Journeys,
    JourneySpec,
    journey_bytes,
)
from albot_maps import World, WorldSet

LIMIT = 1000


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trip:
    """A journey of as many bytes as are wanted."""

    world: World | None
    load: Any


def _trip(size: int, world: World | None = None) -> _Trip:
    return _Trip(world=world, load=np.zeros(size, np.uint8))


class _Body(NamedTuple):
    counts: np.ndarray
    number: int


class _Field:
    def __init__(self) -> None:
        self.anchors = np.zeros((4, 4))


def test_a_journey_weighs_the_arrays_in_it_wherever_they_are(two_rooms: World) -> None:
    shared = np.zeros(100, np.float32)
    load = {
        "body": _Body(np.zeros(3), 7),
        "stops": ([shared, None], (shared, "name")),
        "field": _Field(),
        "scalar": np.array(1.0),
        "inside": _trip(11, two_rooms),
    }
    assert journey_bytes(_Trip(world=two_rooms, load=load)) == 24 + 400 + 128 + 8 + 11
    assert journey_bytes(_trip(0, two_rooms)) == 0


def _cache(**sizes: int) -> JourneyCache:
    cache = JourneyCache(LIMIT)
    for name, size in sizes.items():
        cache.put(("kind", name), _trip(size))
    return cache


def _kept(cache: JourneyCache) -> str:
    return "".join(name for name in "abcdef" if ("kind", name) in cache)


def test_they_are_kept_by_what_they_weigh_not_by_their_number() -> None:
    many = JourneyCache(LIMIT)
    for number in range(LIMIT):
        many.put(("kind", number), _trip(1))
    assert all(("kind", number) in many for number in range(LIMIT))
    many.put(("kind", LIMIT), _trip(10))
    assert [("kind", number) in many for number in (9, 10)] == [False, True]
    assert _kept(_cache(a=400, b=400, c=200)) == "abc"
    assert _kept(_cache(a=400, b=400, c=201)) == "bc"
    assert _kept(_cache(a=400, b=400, c=1000)) == "c"


def test_those_that_were_longest_not_asked_for_go_first() -> None:
    cache = _cache(a=300, b=300, c=300)
    kept = cache.fetch(("kind", "a"), lambda: pytest.fail("made again"))
    assert kept.load.nbytes == 300
    assert cache.fetch(("kind", "d"), lambda: _trip(300)).load.nbytes == 300
    assert _kept(cache) == "acd"
    cache.put(("kind", "c"), _trip(300))
    cache.put(("kind", "e"), _trip(600))
    assert _kept(cache) == "ce"


def test_what_is_put_twice_or_dropped_or_cleared_weighs_no_more() -> None:
    cache = _cache(a=400)
    for _ in range(5):
        cache.put(("kind", "a"), _trip(400))
    cache.put(("kind", "b"), _trip(600))
    assert _kept(cache) == "ab"
    cache.put(("kind", "a"), _trip(100))
    cache.put(("kind", "c"), _trip(300))
    assert _kept(cache) == "abc"
    cache.clear()
    assert _kept(cache) == ""
    cache.put(("kind", "d"), _trip(LIMIT))
    assert _kept(cache) == "d"


def test_what_is_too_large_is_handed_out_and_drives_nothing_out() -> None:
    cache, made = _cache(a=400, b=400), []

    def make() -> _Trip:
        made.append(_trip(LIMIT + 1))
        return made[-1]

    for number in (1, 2):
        assert cache.fetch(("kind", "c"), make) is made[-1]
        assert len(made) == number
    assert _kept(cache) == "ab"


class _Trips(Journeys[Any]):
    """Trips of one weight."""

    def __init__(self, count: int, size: int) -> None:
        super().__init__("Trips", ("trips", size), count)
        self._size = size

    def travel(self, spec: JourneySpec) -> _Trip:
        return _trip(self._size, spec.world)


def test_nothing_is_made_beforehand_that_would_not_fit(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two starts: six journeys fit into six times their weight, not into less."""
    worlds, rng = [WorldSet((two_rooms,))], np.random.default_rng(1)
    for limit, missing in ((600, 6 - 1), (599, 0)):
        monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache(limit))
        trips = _Trips(3, 100)
        assert trips.missing(worlds) == []  # Before the first each is taken to weigh much.
        trips.draw(two_rooms, two_rooms.starts[0], rng)
        assert len(trips.missing(worlds)) == missing
    monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache(6 * ASSUMED_BYTES))
    trips = _Trips(3, 7 * ASSUMED_BYTES)
    assert len(trips.missing(worlds)) == 6
    trips.draw(two_rooms, two_rooms.starts[0], rng)  # Though too large to be kept it is weighed.
    assert trips.missing(worlds) == []
    assert len(_Trips(3, 100).missing(worlds)) == 6  # Which says nothing of another kind.


def test_new_journeys_are_made_once_for_robots_that_are_compared(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And again in another world, from another start, for another number or another equipment."""
    monkeypatch.setattr(journeys, "_LATEST", JourneyCache(LIMIT))
    monkeypatch.setattr(journeys, "JOURNEY_CACHE", JourneyCache(0))
    start, twin = two_rooms.starts[0], replace(two_rooms, name="twin")

    def draw(size: int, world: World, start: np.ndarray, seed: int) -> Any:
        return _Trips(0, size).draw(world, start, np.random.default_rng(seed))

    first = draw(10, two_rooms, start, 1)
    assert draw(10, two_rooms, start, 1) is first
    others = [
        draw(11, two_rooms, start, 1),
        draw(10, twin, start, 1),
        draw(10, two_rooms, two_rooms.starts[1], 1),
        draw(10, two_rooms, start, 2),
    ]
    assert all(other is not first for other in others)
    assert others[1].world is twin


def test_the_process_keeps_a_gibibyte() -> None:
    assert journeys.JOURNEY_CACHE.limit == KEPT_BYTES == 2**30
    assert JourneyCache().room_for("never made") == 4096
