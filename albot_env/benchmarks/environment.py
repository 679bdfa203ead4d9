"""How many steps a second the environments take."""

from __future__ import annotations

import time

import gymnasium

import albot_env  # noqa: F401  (registers the environments)

_STEPS = 2000


def measure_environments(rounds: int = 3) -> list[dict[str, float | int | str]]:
    """Time random actions in a single `Albot/Explore-v0`, by mapper.

    Returns:
        For each mapper `id`, `mode`, `num_envs`, `mapper` and `steps_per_second` on one
        core (the best of `rounds` runs of 2000 steps).
    """
    rows: list[dict[str, float | int | str]] = []
    for mapper in ("albot1", "odometry"):
        env = gymnasium.make("Albot/Explore-v0", mapper=mapper)
        env.action_space.seed(0)
        actions = [env.action_space.sample() for _ in range(_STEPS)]
        best = 0.0
        for _ in range(rounds):
            env.reset(seed=0)
            started = time.perf_counter()
            for action in actions:
                env.step(action)
            best = max(best, _STEPS / (time.perf_counter() - started))
        env.close()
        rows.append(
            {
                "id": "Albot/Explore-v0",
                "mode": "single",
                "num_envs": 1,
                "mapper": mapper,
                "steps_per_second": best,
            }
        )
    return rows
