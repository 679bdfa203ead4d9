"""How fast a learner goes, and which share of its time the environment takes.

Needs the extra `train`.
"""

from __future__ import annotations

import importlib.util
import time
from typing import Any

from gymnasium import spaces

from albot_benchmarks.environment import ENVIRONMENT, WORLD
from albot_env.vector import TRAINING_EXTRA
from albot_env.vector.spinning import spin_briefly

BATCH, EPOCHS = 4096, 4
"""Samples in a gradient step, and how often each is used."""
LAYERS = (64, 64)
"""Units in the layers of policy and value."""


def measure_learner(num_envs: int = 1024, steps: int = 16, rollouts: int = 3) -> dict[str, Any]:
    """Time stable-baselines3's PPO on `Albot/Explore-v0`, and on one that costs nothing.

    Args:
        num_envs: Environments in the batch.
        steps: Steps of each in a rollout, after which PPO learns.
        rollouts: Rollouts that are timed, after one that is not.

    Returns:
        `learner` (its name), `num_envs`, `batch`, `epochs`, `steps`, `observation` (how
        many numbers one has: the learner's time goes by it), and `runs`: for each
        environment `id` (`free` for the one that costs nothing: the same spaces, always
        the same answer), `mapper`, `samples_per_second` and `environment_share`, the share
        of the time in which the environment stepped. Where the learner is not installed:
        `missing`, which says what is.
    """
    missing = [
        name for name in ("torch", "stable_baselines3") if importlib.util.find_spec(name) is None
    ]
    if missing:
        return {"missing": f"{' and '.join(missing)}; {TRAINING_EXTRA}"}
    spin_briefly()
    from albot_benchmarks.timed_batch import FreeBatch, TimedBatch
    from albot_env.vector.sb3 import make_batch
    from albot_maps import load_world

    world = load_world(WORLD)
    runs, length = [], 0
    for name, mapper in (("free", None), (ENVIRONMENT, "none"), (ENVIRONMENT, "albot1")):
        batch = make_batch(ENVIRONMENT, num_envs, world=world, mapper=mapper or "none")
        length = spaces.flatdim(batch.observation_space)
        timed = TimedBatch(batch if mapper else FreeBatch(batch))
        runs.append({"id": name, "mapper": mapper, **_measure(timed, steps, rollouts)})
        timed.close()
    return {
        "learner": "stable-baselines3 PPO",
        "num_envs": num_envs,
        "batch": BATCH,
        "epochs": EPOCHS,
        "steps": steps,
        "observation": length,
        "runs": runs,
    }


def _measure(batch: Any, steps: int, rollouts: int) -> dict[str, float]:
    """Samples a second, and the environment's share of the time."""
    from stable_baselines3 import PPO

    samples = batch.num_envs * steps
    learner = PPO(
        "MlpPolicy",
        batch,
        n_steps=steps,
        batch_size=min(BATCH, samples),
        n_epochs=EPOCHS,
        policy_kwargs={"net_arch": list(LAYERS)},
        device="cpu",
        seed=0,
    )
    learner.learn(samples)
    batch.seconds = 0.0
    began = time.perf_counter()
    learner.learn(rollouts * samples, reset_num_timesteps=False)
    elapsed = time.perf_counter() - began
    return {
        "samples_per_second": rollouts * samples / elapsed,
        "environment_share": batch.seconds / elapsed,
    }
