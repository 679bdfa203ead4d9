"""A run of many kilometres from room to room: time per reading, and size of the map."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import islice

import numpy as np

from albot_benchmarks.environment import WORLD
from albot_core.geometry.types import Pose
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import Simulator, StartStop, follow_leg
from albot_env.tasks.place_recognition.tours import StoppingRooms
from albot_maps import ROBOT_RADIUS, load_world
from albot_maps.geodesic import DistanceField

Row = dict[str, float | int | str]

_CHUNK = 250
"""Readings simulated ahead of the mapper's updates, which alone are timed."""
_ADDITIONS = 50_000
"""Additions in Python, timed after each chunk as a reference."""
STEPS = StartStop(move=0.5, turn=np.radians(30.0))
"""Motion between readings: about that of real logs."""
_CLEARANCE = 0.1
"""Extra distance from walls beyond the robot's radius, where there is space (m)."""


def measure_long_run(
    path_m: float = 10_000.0, stage_m: float = 500.0, world: str = WORLD, seed: int = 1000
) -> list[Row]:
    """Lead `albot1` from room to room of one building for hours, to see whether it slows down.

    Args:
        path_m: Length of the run by the odometer (m).
        stage_m: Length of a stage, after which a row is added (m).
        world: The building's spec.
        seed: Seed of the rooms and of the sensors' errors.

    Returns:
        One row per stage: `path_km` at its end; `us_per_reading`, the mean processor time of an
        update; `ratio`, that time over a thousand additions in Python, measured in between; and
        the content of the map at its end: `surfaces` of the perceptual map, `places`, their
        `exits` and `described` surfaces, `visits`, `events`, `trail_points`, `trail_links`, and
        `memory_bytes` of the whole state.
    """
    mapper, building = make_mapper("albot1"), load_world(world)
    simulator = Simulator(building, movables=False)
    for reading in islice(patrol(simulator, np.random.default_rng(seed)), 4 * int(stage_m)):
        mapper.update(reading)  # compiles
    mapper.reset(np.random.default_rng(seed))
    readings = patrol(simulator, np.random.default_rng(seed))
    rows: list[Row] = []
    path = 0.0
    for end in np.arange(stage_m, path_m + stage_m / 2, stage_m):
        count, seconds, additions = 0, 0.0, []
        while path < end:
            chunk = list(_stretch(readings, end - path))
            began = time.process_time()
            for reading in chunk:
                mapper.update(reading)
            seconds += time.process_time() - began
            additions.append(_addition())
            count += len(chunk)
            path += sum(map(_length, chunk))
        cost = {
            "path_km": path / 1000,
            "readings": count,
            "us_per_reading": 1e6 * seconds / count,
            "ratio": seconds / count / (1000 * float(np.mean(additions))),
        }
        rows.append({"name": mapper.spec.name, "world": world} | cost | _remembered(mapper))
    return rows


def _stretch(readings: Iterator[Reading], way: float) -> Iterator[Reading]:
    """Yield the next readings, at most `_CHUNK`, up to the one that completes `way` (m)."""
    for reading in islice(readings, _CHUNK):
        yield reading
        way -= _length(reading)
        if way <= 0:
            return


def _length(reading: Reading) -> float:
    return float(np.hypot(*reading.motion[:2]))


def _addition() -> float:
    """Return the processor time of an addition in Python (s)."""
    began, total = time.process_time(), 0
    for number in range(_ADDITIONS):
        total += number
    return (time.process_time() - began) / _ADDITIONS


def _remembered(mapper: Mapper) -> Row:
    """Return the size of the mapper's state."""
    state = mapper.state()
    return {
        "surfaces": len(mapper.snapshot().segments),
        "places": len(state["places.ids"]),
        "exits": len(state["places.lines"]),
        "described": len(state["places.surfaces"]),
        "visits": len(state["places.visits"]) - 1,
        "events": len(state["places.events"]),
        "trail_points": len(state["places.trail"]),
        "trail_links": len(state["places.trail_links"]),
        "memory_bytes": sum(array.nbytes for array in state.values()),
    }


def patrol(
    simulator: Simulator, rng: np.random.Generator, start: Pose | None = None
) -> Iterator[Reading]:
    """Yield the readings of a robot that is guided endlessly between randomly drawn rooms.

    It stops anywhere in a room. The guide uses the true pose, so that the odometer's errors (preset
    `pioneer`) do not change the path.

    Args:
        simulator: The robot in its world.
        rng: Source of the rooms and of the sensors' errors.
        start: Where it sets out (m, rad; world frame); by default at the world's first start.

    Raises:
        InputError: The world has fewer than two rooms in which a robot can stop.
    """
    world = simulator.world
    stops = StoppingRooms(world)
    yield simulator.reset(rng, start)
    here = -1
    while True:
        here = int(rng.choice([room for room in stops.rooms if room != here]))
        goal = stops.point(here, rng)
        way = DistanceField(world.walls, ROBOT_RADIUS, goal, spare=_CLEARANCE).path(
            simulator.pose[:2]
        )
        if not len(way):
            tight = DistanceField(world.walls, ROBOT_RADIUS, goal, tight=True)
            way = tight.path(simulator.pose[:2])
        for turn in way:
            yield from follow_leg(simulator, turn, STEPS)
