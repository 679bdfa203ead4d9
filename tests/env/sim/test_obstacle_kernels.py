"""People walk, and are where they walked to."""

from __future__ import annotations

import numpy as np

from albot_maps import Walker
from tests.env.sim.test_obstacles_batch import room, simulator


def test_a_walker_walks() -> None:
    sim = simulator(room(walkers=[Walker(route=((6.0, 1.0), (6.0, 5.0)))]))
    sim.reset(np.random.default_rng(1))
    before = sim.obstacles.copy()
    for _ in range(20):
        sim.step(0.0, 0.0)
    assert np.abs(sim.obstacles - before).max() > 0.5
