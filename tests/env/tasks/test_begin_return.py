"""Mappers that map the way home apart are told where it begins."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.odometry.batch import OdometryBatch
from albot_env.tasks.homing.env import HomingEnv
from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
from albot_env.tasks.homing.task import HomingConfig
from albot_maps import World

FAR = HomingConfig(outing=OutwardJourneyConfig(shortest=3.0, longest=3.0, away=2.0))


def test_the_way_home_begins_at_the_end_of_the_outward_journey(
    two_rooms: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The mapper is told once, when it knows all of the journey."""
    poses: list[np.ndarray] = []
    monkeypatch.setattr(
        OdometryBatch,
        "begin_return",
        lambda mappers, row: poses.append(mappers.poses[row].copy()),
    )
    env = HomingEnv(two_rooms, mapper="odometry", config=FAR)
    for episode in (1, 2):
        _, info = env.reset(seed=episode)
        env.step(np.array((1, 0, -1), np.float32))
        assert len(poses) == episode
        assert np.hypot(*poses[-1][:2]) > 1.5
        np.testing.assert_allclose(poses[-1], info["belief"], atol=0.01)
