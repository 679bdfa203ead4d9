"""A batch whose robots come and go: what one senses depends on its own world alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.sim import COMPASSES, PIONEER_3DX, SCENES, SONARS, Sensors
from albot_env.sim import physics as physics_module
from albot_env.sim import world_cache as register_module
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.thread_pool import ThreadPool
from albot_maps import World, load_world

SENSORS = Sensors(sonar=SONARS["pioneer"], scenes=SCENES["paper"], compass=COMPASSES["clouded"])
WORLDS = [load_world(f"random:ring:{seed}") for seed in range(6)]


def senses(batch: BatchSimulator, row: int, world: World, key: int) -> list[bytes]:
    """What a robot senses in a short drive from a world's start."""
    batch.place(row, world, world.starts[0], key)
    seen = []
    for _ in range(5):
        batch.drive(np.tile((0.3, 0.4), (len(batch.poses), 1)), 2)
        batch.locate()
        batch.sense()
        measured = batch.ranges, batch.echoes, batch.scenes, batch.compasses
        parts = batch.poses, batch.motions, *measured
        seen.append(b"".join(part[row].tobytes() for part in parts))
    return seen


@pytest.fixture
def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is kept of worlds without robots."""
    monkeypatch.setattr(register_module, "KEPT", -3)
    monkeypatch.setattr(physics_module, "_EMPTY_SPACES_KEPT", 0)


@pytest.mark.parametrize("kept", ["much", "little"])
def test_worlds_that_come_and_go_change_nothing(kept: str, request) -> None:
    if kept == "little":
        request.getfixturevalue("forgetful")
    batch = BatchSimulator(2, robot=PIONEER_3DX, sensors=SENSORS)
    batch.place(1, WORLDS[0], WORLDS[0].starts[0], 9)
    for turn in range(3):
        for number, world in enumerate(WORLDS):
            alone = BatchSimulator(1, robot=PIONEER_3DX, sensors=SENSORS)
            assert senses(batch, 0, world, turn) == senses(alone, 0, world, turn), number


@pytest.mark.parametrize("without", ["sonar", "scenes", "compass"])
def test_a_sensor_changes_no_bit_of_another_one(without: str) -> None:
    """Each draws its noise at counters of its own."""
    fewer = dataclasses.replace(SENSORS, **{without: None})
    readings = []
    for sensors in (SENSORS, fewer):
        batch = BatchSimulator(1, robot=PIONEER_3DX, sensors=sensors)
        senses(batch, 0, WORLDS[0], 3)
        parts = {"sonar": batch.echoes, "scenes": batch.scenes, "compass": batch.compasses}
        others = batch.motions, batch.ranges, *(parts[name] for name in parts if name != without)
        readings.append([part.tobytes() for part in others])
    assert readings[0] == readings[1]


def test_robots_meet_the_walls_of_their_own_world(two_rooms: World, box: World) -> None:
    batch = BatchSimulator(2, robot=PIONEER_3DX, sensors=Sensors())
    for _ in range(3):  # Each time in the other's world.
        worlds = (two_rooms, box) if batch.ranges.max() == np.inf else (box, two_rooms)
        for row, world in enumerate(worlds):
            batch.place(row, world, world.starts[0], 1)
        batch.locate()
        batch.sense()
        for row, world in enumerate(worlds):
            alone = BatchSimulator(1, robot=PIONEER_3DX, sensors=Sensors())
            alone.place(0, world, world.starts[0], 1)
            alone.locate()
            alone.sense()
            np.testing.assert_array_equal(batch.ranges[row], alone.ranges[0])


def test_a_thread_pool_does_all_rows_once_and_raises_what_its_threads_raise() -> None:
    pool = ThreadPool(3)
    done = np.zeros(100, np.int64)

    def count(rows: np.ndarray, thread: int) -> None:
        done[rows] += 1

    pool.share(np.arange(100), count)
    assert (done == 1).all()
    threads: set[int] = set()
    pool.share(np.arange(10), lambda _, thread: threads.add(thread), min_rows=20)
    assert threads == {0}

    def fail(rows: np.ndarray, thread: int) -> None:
        if thread == 2:
            raise ValueError("three")

    with pytest.raises(ValueError, match="three"):
        pool.share(np.arange(100), fail)
    pool.close()
    with pytest.raises(InputError, match="a whole number from 1, or None, found -1"):
        ThreadPool(-1)
