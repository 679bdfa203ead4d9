"""How many steps a second the environments take, and how much memory a batch needs."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import albot_env  # noqa: F401  (registers the environments)

_ENVIRONMENT = "Albot/Explore-v0"
_WORLD = "office-ring"
_SINGLE_STEPS = 2000
_BATCHES = (256, 1024)
_LARGE = 32768
"""Steps of environments in one run of a batch without a mapper…"""
_SMALL = 8192
"""…and with one."""


def measure_environments(rounds: int = 3) -> list[dict[str, float | int | str]]:
    """Time random actions in `Albot/Explore-v0`, alone and in batches, by mapper.

    Returns:
        For each `id`, `mode` (single or vector), `num_envs`, `mapper` and
        `steps_per_second` of all environments together, on one core (the best of `rounds`
        runs, compiled); of the heaviest batch of 256 also `memory_mib`, by how much the
        process grew (where the system tells; else 0).
    """
    # First the batch whose memory counts: later ones use what it has given back.
    before = _resident_mib()
    heavy = _measure_batch(_BATCHES[0], "albot1", _SMALL, rounds)
    heavy["memory_mib"] = _resident_mib() - before
    rows = [_measure_single(mapper, rounds) for mapper in ("none", "odometry", "albot1")]
    rows += [_measure_batch(count, "none", _LARGE, rounds) for count in _BATCHES]
    return [*rows, heavy]


def _measure_single(mapper: str, rounds: int) -> dict[str, float | int | str]:
    env = gymnasium.make(_ENVIRONMENT, world=_WORLD, mapper=mapper)
    rng = np.random.default_rng(0)
    actions = list(rng.uniform(-1, 1, (_SINGLE_STEPS, 2)).astype(np.float32))
    rate = _rate(lambda seed: env.reset(seed=seed), env.step, actions, rounds)
    env.close()
    return _row("single", 1, mapper, rate)


def _measure_batch(
    count: int, mapper: str, steps: int, rounds: int
) -> dict[str, float | int | str]:
    env = gymnasium.make_vec(_ENVIRONMENT, num_envs=count, world=_WORLD, mapper=mapper)
    rng = np.random.default_rng(0)
    actions = list(rng.uniform(-1, 1, (steps // count, count, 2)).astype(np.float32))
    rate = _rate(lambda seed: env.reset(seed=seed), env.step, actions, rounds) * count
    env.close()
    return _row("vector", count, mapper, rate)


def _row(mode: str, count: int, mapper: str, rate: float) -> dict[str, float | int | str]:
    return {
        "id": _ENVIRONMENT,
        "mode": mode,
        "num_envs": count,
        "mapper": mapper,
        "steps_per_second": rate,
    }


def _rate(
    reset: Callable[[int], Any],
    step: Callable[[np.ndarray], Any],
    actions: list[np.ndarray],
    rounds: int,
) -> float:
    """Steps a second, the best of several runs after one step that compiles."""
    reset(0)
    step(actions[0])
    best = 0.0
    for _ in range(rounds):
        reset(0)
        started = time.perf_counter()
        for action in actions:
            step(action)
        best = max(best, len(actions) / (time.perf_counter() - started))
    return best


def _resident_mib() -> float:
    """Memory that this process holds (MiB)."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="ascii").splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    return 0.0
