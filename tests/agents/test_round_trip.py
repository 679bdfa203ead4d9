"""Out and back in time."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.spaces import Box

from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import run_trial
from albot_agents.registry import make_agent
from albot_core.errors import InputError
from albot_env.tasks.explore_and_home.task import RoundTripConfig


def test_it_explores_and_is_home_in_time() -> None:
    config = RoundTripConfig(shortest=60.0, longest=60.0, ground=20.0)
    trial = Trial(
        task="Albot/ExploreAndHome-v0",
        agent="round-trip",
        world="office-ring",
        seed=3,
        settings={"config": config, "mapper": "albot1"},
    )
    outcome = run_trial(trial)
    assert outcome.info["is_success"]
    assert outcome.info["time_left"] > 0
    assert outcome.driven > 8.0
    assert outcome.collisions == 0


def test_where_no_time_is_shown_it_says_so() -> None:
    agent = make_agent("round-trip")
    with pytest.raises(InputError, match="round-trip: expected observations with the part time"):
        agent.reset(np.random.default_rng(1), Box(-1, 1, (3,), np.float32))
