"""The long journey: a short one, and what is told of it. No test of speed."""

from __future__ import annotations

from itertools import islice

import numpy as np

from albot_benchmarks.long_run import STEPS, measure_long_run, patrol
from albot_cli.bench import _journey
from albot_env.sim.simulator import Simulator
from albot_maps import load_world


def test_a_patrol_goes_from_room_to_room_a_step_at_a_time() -> None:
    simulator = Simulator(load_world("office-ring"), movables=False)
    readings = list(islice(patrol(simulator, np.random.default_rng(3)), 150))
    way = np.array([reading.motion for reading in readings])
    # The odometer's errors are some per cent.
    assert np.hypot(*way[:, :2].T).max() < 1.1 * STEPS.move
    assert np.abs(way[:, 2]).max() < 1.2 * STEPS.turn
    assert np.hypot(*way[:, :2].T).sum() > 20.0
    again = islice(patrol(simulator, np.random.default_rng(3)), 150)
    assert all((a.motion == b.motion).all() for a, b in zip(readings, again, strict=True))


def test_a_journey_is_told_stage_by_stage() -> None:
    rows = measure_long_run(40.0, 20.0, world="office-ring", seed=3)
    assert [round(float(row["path_km"]), 2) for row in rows] == [0.02, 0.04]
    row, last = rows
    for each in rows:
        assert float(each["us_per_reading"]) > 0
        assert float(each["ratio"]) > 0
        assert int(each["readings"]) > 20
    # The robot sees more, and forgets nothing of its way or its places as yet.
    for name in ("places", "exits", "described", "visits", "events", "trail_points"):
        assert 1 <= int(row[name]) <= int(last[name]), name
    assert 10 < int(last["surfaces"]) < 200
    assert 1_000 < int(last["memory_bytes"]) < 100_000
    assert _journey(last).startswith("journey         0.0 km")
