"""The physics solves contacts in few passes, and robots end up where many would take them."""

from __future__ import annotations

import numpy as np
import pytest

from albot_env.sim import PIONEER_3DX, Sensors
from albot_env.sim import physics as physics_module
from albot_env.sim.batch_simulator import BatchSimulator
from albot_maps import load_world

WORLD = load_world("random:office:3?rooms=4")
ROBOTS, STEPS, HOLD = 128, 100, 10


def ends(passes: int, monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, np.ndarray]:
    """Where robots are after ten seconds of random driving, and how often each touched a wall."""
    monkeypatch.setattr(physics_module, "_PASSES", passes)
    batch, rng = (
        BatchSimulator(ROBOTS, robot=PIONEER_3DX, sensors=Sensors()),
        np.random.default_rng(2),
    )
    for row in range(ROBOTS):
        batch.place(row, WORLD, WORLD.starts[row % len(WORLD.starts)], row)
    touched = np.zeros(ROBOTS, np.int64)
    for step in range(STEPS):
        if step % HOLD == 0:
            targets = rng.uniform(-0.6, 1.0, (ROBOTS, 2))
        batch.clear_contacts()
        batch.drive(targets, 2)
        touched += batch.collided
    return batch.poses[:, :2].copy(), touched


def test_robots_at_walls_end_up_where_many_passes_take_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, touched = ends(physics_module._PASSES, monkeypatch)
    reference, _ = ends(100, monkeypatch)
    apart = np.hypot(*(found - reference).T)
    rubbing = touched > STEPS // 10
    assert rubbing.sum() > ROBOTS // 3
    assert np.median(apart[rubbing]) < 0.005
    assert (apart[touched == 0] < 1e-9).all()
    assert (touched == 0).any()
