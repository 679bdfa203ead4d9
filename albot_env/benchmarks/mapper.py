"""How many readings a second a mapper takes in, and that a large map costs no more."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from albot_core.albot1.mapper import Albot1
from albot_core.albot1.memory import add_surface, empty_memory, stored_memory
from albot_core.geometry.poses import inverse, transform_segments
from albot_core.geometry.types import Segments
from albot_core.mapper import Mapper
from albot_core.perception.reading import Reading
from albot_core.registry import make_mapper
from albot_env.experiments.guided_tour import Journey, guided_tour
from albot_maps import load_world

_SIZES = (1_000, 100_000)
_SPREAD = 50.0
"""Distance (m) between the copies of the floor that a large map remembers."""


def measure_mappers(
    names: Sequence[str], readings: Sequence[Reading] | None = None, rounds: int = 5
) -> list[dict[str, float | int | str]]:
    """Time mappers on a run of readings, by default on a simulated tour of `office-ring`.

    Returns:
        For each mapper its `name`, the `surfaces` of its map at the end, and
        `readings_per_second` of its updates alone (the best of `rounds` runs, compiled).
    """
    readings = readings or tour_readings()
    rows: list[dict[str, float | int | str]] = []
    for name in names:
        mapper = make_mapper(name)
        rate = _rate(mapper, readings, rounds)
        rows.append({"name": name, "surfaces": len(mapper.surfaces), "readings_per_second": rate})
    return rows


def measure_growth(rounds: int = 5) -> list[dict[str, float | int | str]]:
    """Time `albot1` on the same tour with maps that remember ever more besides.

    The floor is remembered many times over, in copies that lie apart; the robot is in one.
    """
    world, tour = load_world("office-ring"), _tour()
    floor = transform_segments(inverse(tour.truth[0]), world.walls)
    rows: list[dict[str, float | int | str]] = []
    for size in _SIZES:
        mapper = Albot1.default()
        mapper.update(tour.readings[0])
        known = knowing(mapper.state(), copies_of(floor, size))
        best = 0.0
        for _ in range(rounds):
            mapper.restore(known)
            best = max(best, _timed(mapper, tour.readings[1:]))
        rows.append({"name": "albot1", "surfaces": size, "readings_per_second": best})
    return rows


def tour_readings() -> list[Reading]:
    """What a robot senses when guided round `office-ring`, about 140 readings."""
    return list(_tour().readings)


def _tour() -> Journey:
    world = load_world("office-ring")
    return guided_tour(world, world.tours["single-loop"], np.random.default_rng(0))


def copies_of(floor: Segments, count: int) -> Float64[np.ndarray, "copies 4"]:
    """`count` walls: the floor's where it is, and again and again in copies that lie apart."""
    copies = -(-count // len(floor))
    side = int(np.ceil(np.sqrt(copies)))
    offsets = [(i // side * _SPREAD, i % side * _SPREAD) for i in range(copies)]
    return np.concatenate([floor + np.array([dx, dy, dx, dy]) for dx, dy in offsets])[:count]


def knowing(state: dict[str, np.ndarray], surfaces: Segments) -> dict[str, np.ndarray]:
    """The state of a mapper that also remembers `surfaces`."""
    memory = empty_memory(len(state["memory.ids"]) + len(surfaces))
    stable = np.full(2, 2, np.int8)
    alive = state["memory.ids"] >= 0
    for surface in (*state["memory.surfaces"][alive], *surfaces):
        add_surface(memory, surface, stable)
    return state | {f"memory.{name}": array for name, array in stored_memory(memory).items()}


def _rate(mapper: Mapper, readings: Sequence[Reading], rounds: int) -> float:
    """Readings a second, the best of several runs after one that compiles."""
    best = 0.0
    for _ in range(rounds + 1):
        mapper.reset()
        best = max(best, _timed(mapper, readings))
    return best


def _timed(mapper: Mapper, readings: Sequence[Reading]) -> float:
    started = time.perf_counter()
    for reading in readings:
        mapper.update(reading)
    return len(readings) / (time.perf_counter() - started)
