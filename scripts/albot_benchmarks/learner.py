"""Speed of a learner, and the environment's share of its time.

Needs the extra `train`.
"""

from __future__ import annotations

import importlib.util
import time
from typing import Any, NamedTuple

from gymnasium import spaces

from albot_agents.training.plan import PolicyPlan
from albot_benchmarks.environment import ENVIRONMENT, WORLD
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.parts.map_patch import MapPatchConfig
from albot_env.tasks.explore.task import ExploreConfig
from albot_env.vector import TRAINING_EXTRA
from albot_env.vector.spinning import spin_briefly

BATCH, EPOCHS = 4096, 4
"""Samples per gradient step, and number of times that each sample is used."""
LAYERS = (64, 64)
"""Units of each layer of policy and value network."""
PATCH = ObservationConfig(
    laser_sectors=36,
    parts=("laser", "motion", "home", "map_patch"),
    map_patch=MapPatchConfig(sides=(16.0,), cells=16, channels=("walls", "free", "trail", "home")),
)
"""Observations with a patch of the mapper's map, as the plan for homing by the map has them."""


class _Case(NamedTuple):
    """What is timed."""

    mapper: str
    observations: ObservationConfig = ObservationConfig()
    policy: str = "mlp"
    """See `PolicyPlan.kind`."""
    free: bool = False
    """Whether the environment costs nothing."""


_CASES = (
    _Case("none", free=True),
    _Case("none"),
    _Case("albot1"),
    _Case("albot1", PATCH, "cnn", free=True),
    _Case("albot1", PATCH),
    _Case("albot1", PATCH, "cnn"),
    _Case("albot1", PATCH, "planner"),
)


def measure_learner(num_envs: int = 1024, steps: int = 16, rollouts: int = 3) -> dict[str, Any]:
    """Time stable-baselines3's PPO on `Albot/Explore-v0`, and on an environment without cost.

    Args:
        num_envs: Environments in the batch.
        steps: Steps per environment and rollout, after which PPO updates.
        rollouts: Timed rollouts, after one that is not timed.

    Returns:
        `learner` (its name), `num_envs`, `batch`, `epochs`, `steps`, and `runs`, one row per
        environment and policy: `id` (`free` for the one without cost, which has the same spaces
        and always returns the same), `mapper`, `parts` (those observed), `observation` (its
        length, on which the learner's time depends), `policy`, `samples_per_second` and
        `environment_share`, the share of the time spent in the environment. If the learner is not
        installed, only `missing`: what must be installed.
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
    runs = []
    for case in _CASES:
        config = ExploreConfig(observations=case.observations)
        batch = make_batch(ENVIRONMENT, num_envs, world=world, mapper=case.mapper, config=config)
        observations = batch.batch.observation_config
        timed = TimedBatch(FreeBatch(batch) if case.free else batch)
        row = {
            "id": "free" if case.free else ENVIRONMENT,
            "mapper": None if case.free else case.mapper,
            "parts": list(observations.shapes),
            "observation": spaces.flatdim(batch.observation_space),
            "policy": case.policy,
        }
        runs.append(row | _measure(timed, observations, case.policy, steps, rollouts))
        timed.close()
    return {
        "learner": "stable-baselines3 PPO",
        "num_envs": num_envs,
        "batch": BATCH,
        "epochs": EPOCHS,
        "steps": steps,
        "runs": runs,
    }


def _measure(
    batch: Any, observations: ObservationConfig, policy: str, steps: int, rollouts: int
) -> dict[str, float]:
    """Return the samples per second, and the environment's share of the time."""
    from stable_baselines3 import PPO

    from albot_agents.training.encoders import extractor_settings
    from albot_agents.training.plan_check import policy_encoders

    encoders = policy_encoders(PolicyPlan(kind=policy), observations)
    samples = batch.num_envs * steps
    learner = PPO(
        "MlpPolicy",
        batch,
        n_steps=steps,
        batch_size=min(BATCH, samples),
        n_epochs=EPOCHS,
        policy_kwargs={"net_arch": list(LAYERS), **extractor_settings(encoders)},
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
