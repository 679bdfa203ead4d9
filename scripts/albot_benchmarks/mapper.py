"""Readings per second of the mappers, and the effect of a large map on them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from albot_benchmarks.timing import best_rates
from albot_core.geometry.poses import inverse, transform_segments
from albot_core.geometry.types import Segments
from albot_core.mappers.mapper import Mapper, MapperBatch
from albot_core.mappers.registry import make_mapper, make_mappers, mapper_spec
from albot_core.sensing.reading import Reading, Readings
from albot_core.sensing.view import CORNER
from albot_env.sim.compass import COMPASSES, CompassConfig
from albot_env.sim.sonar import SONARS, SonarConfig
from albot_experiments.tours import TourRecord, guided_tour
from albot_maps import load_world

_SIZES = (1_000, 100_000)
_BATCH = 256
"""Number of robots in a batch."""
BATCHED_FROM = 2000.0
"""Least readings per second of a mapper that is timed in batches: with slower ones, 256 robots
would take minutes."""
_BATCH_STEPS = 20
"""Readings per robot of a batch."""
_SPREAD = 50.0
"""Distance (m) between the copies of the floor in a large map."""


def measure_mappers(
    names: Sequence[str], readings: Sequence[Reading] | None = None, rounds: int = 5
) -> list[dict[str, float | int | str]]:
    """Time mappers on readings, by default those of a simulated tour of `office-ring`.

    Returns:
        One row per mapper whose sensors the readings have: `name`, `surfaces` of the map at the
        end, `readings_per_second` of the updates alone (the best of `rounds` runs, without
        compiling). From `BATCHED_FROM` readings per second on also `batch`, the number of robots in
        a batch, which all get the same first few readings; `batch_readings_per_second`, summed over
        all robots; and `row_readings_per_second`, when the batch is updated one robot at a time.
    """
    rows: list[dict[str, float | int | str]] = []
    for name in names:
        sensed = _readings_for(name, readings)
        if not sensed:
            continue
        mapper = make_mapper(name)
        rate = _rate(mapper, sensed, rounds)
        alone = {"surfaces": len(mapper.snapshot().segments), "readings_per_second": rate}
        batch = _batch_rates(name, sensed, rounds) if rate >= BATCHED_FROM else {}
        rows.append({"name": name} | alone | batch)
    return rows


def measure_growth(rounds: int = 5) -> list[dict[str, float | int | str]]:
    """Time `albot1` on the same tour with increasingly large maps.

    A map holds many copies of the floor, apart from each other; the robot is in one of them.
    """
    world, tour = load_world("office-ring"), _tour()
    floor = transform_segments(inverse(tour.truth[0]), world.walls)
    rows: list[dict[str, float | int | str]] = []
    for size in _SIZES:
        mapper = make_mapper("albot1")
        mapper.update(tour.readings[0])
        known = with_surfaces(mapper.state(), copies_of(floor, size))
        best = 0.0
        for _ in range(rounds):
            mapper.restore(known)
            best = max(best, _timed(mapper, tour.readings[1:]))
        rows.append({"name": "albot1", "surfaces": size, "readings_per_second": best})
    return rows


def measure_looping(
    names: Sequence[str], readings: Sequence[Reading] | None = None, rounds: int = 5
) -> list[dict[str, float | int | str]]:
    """Time the overhead of a batch that loops over single mappers.

    The batch and the same number of single mappers get the same first few readings, in turns.

    Returns:
        One row per mapper without a batch implementation: `name`; `robots`, the size of the
        batch; `own_us`, the processor time of a single mapper's `update` (µs); `above_us`, the
        additional time per robot and reading in the batch (µs); and `ratio`, the batch's time over
        the single mapper's.
    """
    rows: list[dict[str, float | int | str]] = []
    for name in names:
        sensed = _readings_for(name, readings)
        if mapper_spec(name).batch is not None or not sensed:
            continue
        rates = best_rates(
            {
                "own": _single_turn(name, [shared[0] for shared in _shared(sensed, 1)]),
                "looped": _batch_turn(name, _shared(sensed, _BATCH)),
            },
            rounds,
        )
        own, looped = (1e6 / rates[turn].cpu for turn in ("own", "looped"))
        took = {"own_us": own, "above_us": looped - own, "ratio": looped / own}
        rows.append({"name": name, "robots": _BATCH, **took})
    return rows


def relative_cost(name: str, readings: Sequence[Reading], rounds: int = 3) -> float:
    """Return a mapper's processor time a reading, in those of `odometry`.

    Both process all readings in turns; the best of several rounds counts.

    Args:
        name: The mapper.
        readings: Readings with all sensors that it needs, and a laser.
        rounds: Number of rounds.
    """
    beside = "odometry"
    rates = best_rates({each: _whole_turn(each, readings) for each in (beside, name)}, rounds)
    return rates[beside].cpu / rates[name].cpu


def _whole_turn(name: str, readings: Sequence[Reading]) -> Callable[[], int]:
    """Return a workload in which a mapper processes all readings."""
    mapper = make_mapper(name)

    def turn() -> int:
        mapper.reset(np.random.default_rng(0))
        for reading in readings:
            mapper.update(reading)
        return len(readings)

    return turn


def _single_turn(name: str, readings: Sequence[Reading]) -> Callable[[], int]:
    """Return a workload in which single mappers process all readings."""
    mappers = [make_mapper(name) for _ in range(_BATCH)]

    def turn() -> int:
        for row, mapper in enumerate(mappers):
            mapper.reset(np.random.default_rng(row))
        for reading in readings:
            for mapper in mappers:
                mapper.update(reading)
        return len(mappers) * len(readings)

    return turn


def _batch_turn(name: str, readings: Sequence[Readings]) -> Callable[[], int]:
    """Return a workload in which a batch processes all readings."""
    mappers, everyone = make_mappers(name, _BATCH), np.arange(_BATCH)

    def turn() -> int:
        for row in everyone.tolist():
            mappers.reset(row, np.random.default_rng(row))
        for reading in readings:
            mappers.update(everyone, reading)
        return len(everyone) * len(readings)

    return turn


def _readings_for(name: str, readings: Sequence[Reading] | None) -> Sequence[Reading]:
    """Return the readings, by default the tour's; none if they lack a sensor the mapper needs."""
    needed = mapper_spec(name).sensors
    if readings is None:
        return tour_readings(has_sonars="sonar" in needed, has_compass="compass" in needed)
    lacks_sonars = "sonar" in needed and readings[0].sonar is None
    lacks_compass = "compass" in needed and readings[0].compass is None
    return [] if lacks_sonars or lacks_compass else readings


def tour_readings(*, has_sonars: bool = False, has_compass: bool = False) -> list[Reading]:
    """Return the readings, about 140, of a robot guided round `office-ring`."""
    sonar = SONARS["ideal"] if has_sonars else None
    return list(_tour(sonar, COMPASSES["polarised"] if has_compass else None).readings)


def _tour(sonar: SonarConfig | None = None, compass: CompassConfig | None = None) -> TourRecord:
    world = load_world("office-ring")
    tour, rng = world.tours["single-loop"], np.random.default_rng(0)
    return guided_tour(world, tour, rng, sonar=sonar, compass=compass)


def copies_of(floor: Segments, count: int) -> Float64[np.ndarray, "copies 4"]:
    """Return `count` walls: those of the floor, and of copies of it that lie apart."""
    copies = -(-count // len(floor))
    side = int(np.ceil(np.sqrt(copies)))
    offsets = [(i // side * _SPREAD, i % side * _SPREAD) for i in range(copies)]
    return np.concatenate([floor + np.array([dx, dy, dx, dy]) for dx, dy in offsets])[:count]


def with_surfaces(state: dict[str, np.ndarray], surfaces: Segments) -> dict[str, np.ndarray]:
    """Return the saved state of an `albot1` that also saw `surfaces` in its current visit."""
    # `restore` checks that the result is consistent.
    count, counts = len(surfaces), state["memory.counts"].copy()
    alive, _, next_id, used, visit, _ = range(len(counts))
    rows = {
        "surfaces": surfaces,
        "edges": np.full((count, 2), CORNER),
        "ids": counts[next_id] + np.arange(count),
        "marks": np.full(count, counts[visit]),
        "met_in": np.zeros(count),
    }
    counts[[alive, next_id, used]] += count
    grown = {
        key: np.concatenate((state[key], new.astype(state[key].dtype)))
        for key, new in ((f"memory.{name}", new) for name, new in rows.items())
    }
    return state | grown | {"memory.counts": counts}


def _rate(mapper: Mapper, readings: Sequence[Reading], rounds: int) -> float:
    """Return the readings per second: the best of several runs after one that compiles."""
    best = 0.0
    for _ in range(rounds + 1):
        mapper.reset(np.random.default_rng(0))
        best = max(best, _timed(mapper, readings))
    return best


def _batch_rates(
    name: str, readings: Sequence[Reading], rounds: int
) -> dict[str, float | int | str]:
    """Return the rates of a batch updated together, and one robot at a time."""
    mappers, shared = make_mappers(name, _BATCH), _shared(readings, _BATCH)
    everyone = np.arange(_BATCH)
    each = [everyone[row : row + 1] for row in range(_BATCH)]
    return {
        "batch": _BATCH,
        "batch_readings_per_second": _batch_rate(mappers, shared, [everyone], rounds),
        "row_readings_per_second": _batch_rate(mappers, shared, each, rounds),
    }


def _shared(readings: Sequence[Reading], count: int) -> list[Readings]:
    """Return the first few readings, each repeated for `count` robots.

    Only readings of the first reading's laser are used, because a batch needs one laser.
    """
    lasers = [reading.required_laser("the benchmark") for reading in readings]
    laser = lasers[0].geometry
    return [
        Readings(
            stamps=np.full(count, reading.stamp),
            motions=np.tile(reading.motion, (count, 1)),
            laser=laser,
            ranges=np.tile(scan.ranges, (count, 1)),
            sonar=None if reading.sonar is None else reading.sonar.geometry,
            echoes=None if reading.sonar is None else np.tile(reading.sonar.ranges, (count, 1)),
            compasses=None if reading.compass is None else np.full(count, reading.compass),
        )
        for reading, scan in zip(readings[:_BATCH_STEPS], lasers, strict=False)
        if scan.geometry == laser
    ]


def _batch_rate(
    mappers: MapperBatch,
    readings: Sequence[Readings],
    groups: Sequence[Int64[np.ndarray, "some"]],
    rounds: int,
) -> float:
    """Return the readings per second of all robots, updated in groups: the best of several runs."""
    count, best = len(mappers.poses), 0.0
    for _ in range(rounds):
        for row in range(count):
            mappers.reset(row, np.random.default_rng(row))
        started = time.perf_counter()
        for reading in readings:
            for rows in groups:
                mappers.update(rows, reading)
        seconds = time.perf_counter() - started
        best = max(best, count * len(readings) / seconds)
    return best


def _timed(mapper: Mapper, readings: Sequence[Reading]) -> float:
    started = time.perf_counter()
    for reading in readings:
        mapper.update(reading)
    return len(readings) / (time.perf_counter() - started)
