"""The physics solves contacts in few passes, and robots end up where many would take them."""

from __future__ import annotations

import numpy as np
import pytest

from albot_env.sim import PIONEER_3DX, Sensors
from albot_env.sim import space as space_module
from albot_env.sim.fleet import Fleet
from albot_maps import load_world

WORLD = load_world("random:office:3?rooms=4")
ROBOTS, STEPS, HOLD = 128, 100, 10


def ends(passes: int, monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, np.ndarray]:
    """Where robots are after ten seconds of random driving, and how often each touched a wall."""
    monkeypatch.setattr(space_module, "_PASSES", passes)
    fleet, rng = Fleet(ROBOTS, robot=PIONEER_3DX, sensors=Sensors()), np.random.default_rng(2)
    for row in range(ROBOTS):
        fleet.place(row, WORLD, WORLD.starts[row % len(WORLD.starts)], row)
    touched = np.zeros(ROBOTS, np.int64)
    for step in range(STEPS):
        if step % HOLD == 0:
            targets = rng.uniform(-0.6, 1.0, (ROBOTS, 2))
        fleet.clear_contacts()
        fleet.drive(targets, 2)
        touched += fleet.collided
    return fleet.poses[:, :2].copy(), touched


def test_robots_at_walls_end_up_where_many_passes_take_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, touched = ends(space_module._PASSES, monkeypatch)
    reference, _ = ends(100, monkeypatch)
    apart = np.hypot(*(found - reference).T)
    rubbing = touched > STEPS // 10
    assert rubbing.sum() > ROBOTS // 3
    assert np.median(apart[rubbing]) < 0.005
    assert (apart[touched == 0] < 1e-9).all()
    assert (touched == 0).any()
