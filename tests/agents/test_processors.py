"""A journey is the same to the last bit on processors that numpy has faster code for, or not."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import albot_env
from albot_agents.agent import EnvironmentConfigs, choose_action
from albot_agents.registry import make_agent
from albot_env.tasks.core.parts.sensors import LASER

assert albot_env.__doc__  # Importing it registers the environments.
ROOT = Path(__file__).parents[2]


def journey() -> str:
    """What explorers sense and do on a first walk, mapper and all, as a digest."""
    digest = hashlib.sha256()
    for world, name in (("office-ring", "gap-explorer"), ("random:hall:7", "nearest-frontier")):
        env = gymnasium.make("Albot/Explore-v0", world=world, max_episode_steps=250)
        agent = make_agent(name, EnvironmentConfigs.of(env))
        agent.reset(np.random.default_rng(3), env.action_space)
        observation, info = env.reset(seed=3)
        over = False
        while not over:
            action = choose_action(agent, observation, info)
            observation, _, _, over, info = env.step(action)
            ranges = env.get_wrapper_attr("observation_config").decode(LASER, observation)
            for part in (np.asarray(action), observation, ranges):
                digest.update(part.tobytes())
    return digest.hexdigest()


def test_a_journey_is_the_same_whatever_code_numpy_chooses() -> None:
    features = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    if not features:
        pytest.skip("numpy has no faster code for this processor")
    plain = os.environ | {
        "NPY_DISABLE_CPU_FEATURES": " ".join(features),
        "OPENBLAS_CORETYPE": "Nehalem",
        "PYTHONPATH": os.pathsep.join(map(str, (ROOT, *sys.path))),
    }
    program = "from tests.agents.test_processors import journey; print(journey())"
    ran = subprocess.run(
        (sys.executable, "-c", program), env=plain, capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == journey()
