"""Speed of RatSLAM: on a floor, in batches of environments, and of correcting a large map."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from albot_benchmarks.environment import WORLD, Case, make_workload
from albot_benchmarks.timing import best_rates
from albot_core.mappers.ratslam.correction import correct_link_by_link
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading
from albot_experiments.ratslam_floor import FLOOR
from albot_maps import load_world

_EXPERIENCES, _TRANSITIONS = 12_881, 14_485
"""Size of a large map: five to ten times the floor's map."""
_BATCH = 64
"""Number of environments that step together."""
_PASSES = 200
_RATE = 0.5

Row = dict[str, float | int | str]


def measure_ratslam(minutes: int = 60, rounds: int = 3, steps: int = 200 * _BATCH) -> list[Row]:
    """Time the mappers alone, ours in batches too, and the correction.

    `ratslam-scenes` is led over `office-floor` for `minutes` minutes; `ratslam-paper`, and
    `ratslam`, which uses a laser, for a third of that.

    Returns:
        One row per mapper: `name`, the `experiences` and `transitions` at the end,
        `readings_per_second`, and the time per reading in the second and in the last quarter of
        the run, `us_early` and `us_late` (µs). One row per batch of environments with a mapper,
        stepped `steps` times in total by one thread: `name`, `num_envs`, `steps_per_second`. One
        row for the correction of a large random map: `experiences`, `transitions`,
        `passes_per_second`. All are the best of `rounds` rounds, in processor time.
    """
    journey = FLOOR.journey(seed=0, minutes=minutes)
    seen = len(journey.readings) // 3
    return [
        _mapping("ratslam-scenes", journey.readings, rounds),
        _mapping("ratslam-paper", journey.readings[:seen], rounds),
        _mapping("ratslam", journey.readings[:seen], rounds),
        *_batches(steps, rounds),
        _correction(rounds),
    ]


def _mapping(name: str, readings: Sequence[Reading], rounds: int) -> Row:
    mapper = make_mapper(name)
    quarters = np.array_split(np.arange(len(readings)), 4)
    best = np.full(4, np.inf)
    for _ in range(rounds):
        mapper.reset(np.random.default_rng(0))
        for quarter, indices in enumerate(quarters):
            began = time.process_time()
            for index in indices:
                mapper.update(readings[index])
            best[quarter] = min(best[quarter], (time.process_time() - began) / len(indices))
    graph = mapper.snapshot().place_graph
    return {
        "name": name,
        "experiences": len(graph.nodes) if graph else 0,
        "transitions": len(graph.edges) if graph else 0,
        "readings_per_second": float(1 / best.mean()),
        "us_early": float(1e6 * best[1]),
        "us_late": float(1e6 * best[3]),
    }


def _batches(steps: int, rounds: int) -> list[Row]:
    """Time batches of robots that wander about in an office, each with its own mapper."""
    world = load_world(WORLD)
    cases = {
        name: Case(mapper=name, num_envs=_BATCH, steps=steps, scenes=scenes)
        for name, scenes in (("ratslam-scenes", "paper"), ("ratslam", "none"))
    }
    workloads = {name: make_workload(case, world) for name, case in cases.items()}
    rates = best_rates(workloads, rounds)
    return [
        {"name": name, "num_envs": _BATCH, "steps_per_second": rate.cpu}
        for name, rate in rates.items()
    ]


def _correction(rounds: int) -> Row:
    """Time the correction of a random path with loops."""
    rng = np.random.default_rng(0)
    poses = np.cumsum(rng.normal(0, 0.3, (_EXPERIENCES, 3)), axis=0)
    loops = rng.integers(_EXPERIENCES, size=(_TRANSITIONS - _EXPERIENCES + 1, 2))
    along = np.arange(_EXPERIENCES - 1)
    sources = np.concatenate((along, loops[:, 0]))
    targets = np.concatenate((along + 1, loops[:, 1]))
    motions = rng.normal(0, 0.3, (_TRANSITIONS, 3))
    links, stiffness, best = (sources, targets, motions), np.ones(_TRANSITIONS), np.inf
    correct_link_by_link(poses, links, _TRANSITIONS, _RATE, stiffness)
    for _ in range(rounds):
        began = time.process_time()
        for _ in range(_PASSES):
            correct_link_by_link(poses, links, _TRANSITIONS, _RATE, stiffness)
        best = min(best, time.process_time() - began)
    return {
        "experiences": _EXPERIENCES,
        "transitions": _TRANSITIONS,
        "passes_per_second": _PASSES / best,
    }
