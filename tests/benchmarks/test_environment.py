"""The environments' benchmark: its rows, and that baselines do what ours does. No test of speed."""

from __future__ import annotations

import time

import numpy as np
import pytest

from albot_benchmarks import environment
from albot_benchmarks.baselines import PymunkLoopEnv
from albot_benchmarks.environment import SENSORS, Case, make_workload, measure_environments
from albot_benchmarks.timing import best_rates
from albot_core.sensing.reading import LaserGeometry
from albot_env.stress.geometry import ray_ranges
from albot_maps import load_world

CASES = (
    Case(mapper="albot1", num_envs=2, steps=4),
    Case(mapper="none", steps=3),
    Case(mapper="none", num_envs=3, steps=6),
    Case(mapper="none", num_envs=3, steps=6, threads=2),
    Case(mapper="none", num_envs=3, steps=6, parts=SENSORS),
)


def test_a_row_for_every_case_and_every_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "WORLD", "random:maze:1")
    monkeypatch.setattr(environment, "HEAVIEST", CASES[0])
    rows = measure_environments(1, CASES)
    keys = "mode", "num_envs", "mapper", "threads", "parts"
    ours = [tuple(row[key] for key in keys) for row in rows[:5]]
    one, many = ("single", 1, "none", 1, None), ("vector", 3, "none")
    sensors = (*many, 1, "laser, sonar, motion")
    assert ours == [
        ("vector", 2, "albot1", 1, None), one, (*many, 1, None), (*many, 2, None), sensors,
    ]  # fmt: skip
    names = [row["id"] for row in rows]
    assert names[5] == "pymunk in a Python loop"
    assert len(names) == 6
    naive = float(rows[5]["steps_per_cpu_second"] or 0)
    for row in rows:
        assert row["segments"] == len(load_world("random:maze:1").walls)
        assert row["ratio"] == pytest.approx(float(row["steps_per_cpu_second"] or 0) / naive)
        assert float(row["steps_per_second"] or 0) > 0
    assert ["memory_mib" in row for row in rows[:5]] == [True, *[False] * 4]


def test_the_world_has_about_200_walls() -> None:
    assert len(load_world(environment.WORLD).walls) == 200


@pytest.mark.parametrize(("case", "steps"), [(CASES[1], 3), (CASES[2], 6)])
def test_a_lap_tells_how_many_steps_it_was(case: Case, steps: int) -> None:
    assert make_workload(case, load_world("square-loop"))() == steps


def test_rates_are_the_best_of_turns_taken_in_turn() -> None:
    turns = []

    def workload(name: str, steps: int) -> int:
        turns.append(name)
        return steps

    workloads = {"a": lambda: workload("a", 1), "b": lambda: workload("b", 10**6)}
    rates = best_rates(workloads, rounds=2)
    assert turns == ["a", "b"] * 3
    assert rates["b"].wall_clock > rates["a"].wall_clock > 0
    assert rates["b"].cpu > rates["a"].cpu > 0


def test_waiting_counts_by_the_clock_alone() -> None:
    def workload() -> int:
        time.sleep(0.05)
        return 1

    rate = best_rates({"workload": workload}, rounds=1)["workload"]
    assert 0 < rate.wall_clock <= 20
    assert rate.cpu > 2 * rate.wall_clock


def test_the_naive_laser_sees_the_walls() -> None:
    world = load_world("random:maze:1")
    env, geometry = PymunkLoopEnv(world, LaserGeometry()), LaserGeometry()
    expected = ray_ranges(world.walls, world.starts[0], geometry.bearings)
    assert np.abs(env.scan() - np.minimum(expected, 30)).max() < 0.06


def test_the_naive_robot_drives_and_walls_stop_it() -> None:
    world = load_world("square-loop")
    env, geometry = PymunkLoopEnv(world, LaserGeometry()), LaserGeometry()
    ahead = ray_ranges(world.walls, world.starts[0], geometry.bearings)[90]
    first = env.step(np.array((1, 0), np.float32))
    assert abs(first[90] - (ahead - 0.1)) < 0.06
    for _ in range(int(10 * ahead) + 20):
        last = env.step(np.array((1, 0), np.float32))
    assert 0.15 < last[90] < 0.35
