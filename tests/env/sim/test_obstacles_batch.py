"""Robots among obstacles: alone or in a batch the same bits; lasers and contacts meet them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_env.sim import LMS_200, ODOMETERS, PIONEER_3DX, LaserConfig, Sensors, choose_sensors
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.physics import SUBSTEPS
from albot_env.sim.simulator import Simulator
from albot_env.sim.thread_pool import ThreadPool
from albot_maps import Box, Door, Movables, Walker, World, load_world

QUIET = LaserConfig(geometry=LMS_200.geometry, range_noise=0.0, dropout=0.0)
OFFICE = "random:office:3?rooms=6&people=3&boxes=4&doors=2"
APARTMENT = "random:apartment:5?people=2&boxes=2&doors=2"


def room(**movables) -> World:
    """A room of 8 by 6 m, the robot at 1, 3 and looking along x."""
    walls = [[0.0, 0, 8, 0], [8.0, 0, 8, 6], [8.0, 6, 0, 6], [0.0, 6, 0, 0]]
    parts = {name: tuple(obstacles) for name, obstacles in movables.items()}
    return World(
        name="room",
        walls=np.array(walls),
        starts=np.array([[1.0, 3.0, 0.0]]),
        movables=Movables(**parts),
    )


def simulator(world: World, **options) -> Simulator:
    sensors = Sensors(laser=QUIET, odometer=ODOMETERS["ideal"])
    return Simulator(world, sensors=sensors, **options)


def ahead(sim: Simulator, reading) -> float:
    """Range straight ahead as seen from the robot's middle (m)."""
    return float(reading.laser.ranges[90]) + QUIET.geometry.mount[0]


def test_the_laser_sees_a_box_and_not_where_things_are_left_out():
    world = room(boxes=[Box(at=(4.0, 3.0))])
    sim = simulator(world)
    assert ahead(sim, sim.reset(np.random.default_rng(1))) == pytest.approx(2.75, abs=1e-3)
    bare = simulator(world, movables=False)
    assert ahead(bare, bare.reset(np.random.default_rng(1))) == pytest.approx(7.0, abs=1e-3)
    assert len(bare.obstacles) == 0
    assert len(sim.obstacles) == 4


def test_the_sonars_hear_a_box():
    """The sonar 10° to the left of the front hears its flat face."""
    ranges = []
    for movables in (True, False):
        sensors = choose_sensors(laser="lms-200", odometer="ideal", sonar="ideal")
        sim = Simulator(
            room(boxes=[Box(at=(3.5, 3.0), width=2.0)]), sensors=sensors, movables=movables
        )
        reading = sim.reset(np.random.default_rng(1))
        assert reading.sonar is not None
        ranges.append(float(reading.sonar.ranges.min()))
    near, far = ranges
    assert near == pytest.approx(2.0, abs=0.15)
    assert far > 2.5


def test_contact_with_a_box_is_a_collision_and_pushes_it():
    sim = simulator(room(boxes=[Box(at=(4.0, 3.0))]))
    sim.reset(np.random.default_rng(1))
    touched = [bool(sim.step(0.6, 0.0)) and sim.collided for _ in range(60)]
    assert not any(touched[:30])
    assert all(touched[-5:])
    assert sim.obstacles[:, 0].min() == pytest.approx(sim.pose[0] + 0.25, abs=0.01)


def test_a_move_gives_up_before_a_box_too_heavy_to_push():
    sim = simulator(room(boxes=[Box(at=(3.0, 3.0), mass=200.0)]))
    sim.reset(np.random.default_rng(1))
    sim.move(5.0)
    assert sim.collided
    assert sim.pose[0] == pytest.approx(2.5, abs=0.02)
    assert sim.time < 12


def test_a_start_on_a_box_or_in_a_doors_swing_is_refused():
    door = Door(hinge=(5.0, 3.0), heading=0.0, width=1.0)
    sim = simulator(room(boxes=[Box(at=(4.0, 1.0))], doors=[door]))
    for x, y in ((4.3, 1.3), (5.4, 3.4), (5.5, 2.9)):
        with pytest.raises(InputError, match="clear of the boxes and doors of room"):
            sim.reset(np.random.default_rng(1), np.array([x, y, 0.0]))
    sim.reset(np.random.default_rng(1), np.array([5.5, 2.7, 0.0]))


def test_time_passes_for_people_in_manoeuvres_too():
    sim = simulator(room(walkers=[Walker(route=((2.0, 5.0), (7.0, 5.0)), speed=(1.0, 1.0))]))
    sim.reset(np.random.default_rng(3))
    before = sim.obstacles
    reading = sim.turn(math.pi)
    assert reading.stamp > 2
    assert np.abs(sim.obstacles - before).max() > 1


def batch_of(number: int, threads: int = 1) -> BatchSimulator:
    return BatchSimulator(
        number, robot=PIONEER_3DX, sensors=choose_sensors(), threads=ThreadPool(threads)
    )


def record(batch: BatchSimulator, row: int) -> np.ndarray:
    """All that a robot does and senses, and its obstacles."""
    echoes = batch.readings(np.zeros(len(batch.poses))).echoes
    assert echoes is not None
    sensed = batch.motions[row], batch.ranges[row], echoes[row]
    parts = (batch.states[row], *sensed, batch.obstacles(row).ravel())
    return np.concatenate((*parts, batch.collided[row : row + 1]))


def episodes(worlds: list[World], rows: list[int], total: int, threads: int = 1) -> list[list]:
    """Two episodes of each world; the second in the next world, begun at times of its own."""
    batch = batch_of(total, threads)
    rngs = [np.random.default_rng(row) for row in rows]

    def begin(k: int, world: World, key: int) -> None:
        batch.place(k, world, world.starts[0], key)

    for k, row in enumerate(rows):
        begin(k, worlds[row % len(worlds)], 100 + row)
    history: list[list] = [[] for _ in rows]
    for step in range(160):
        for k, row in enumerate(rows):
            if step == 40 + 7 * row:
                begin(k, worlds[(row + 1) % len(worlds)], 200 + row)
        commands = np.array([rng.uniform((-0.5, -2), (1.5, 2)) for rng in rngs])
        batch.clear_contacts()
        batch.drive(batch.robot.targets_for(commands), SUBSTEPS)
        batch.locate()
        batch.sense()
        for k in range(len(rows)):
            history[k].append(record(batch, k))
    return history


@pytest.mark.parametrize("threads", [1, 2])
def test_each_of_a_batch_does_what_it_does_alone(threads):
    """Worlds with obstacles, and one without among them, entered in turn."""
    worlds = [load_world(OFFICE), load_world(APARTMENT), load_world("random:maze:1")]
    together = episodes(worlds, list(range(7)), 7, threads)
    for row in range(7):
        (alone,) = episodes(worlds, [row], 1)
        assert all(np.array_equal(a, b) for a, b in zip(alone, together[row], strict=True))


def test_robots_in_one_world_have_things_of_their_own():
    world = load_world(OFFICE)
    batch = batch_of(3)
    for row, key in enumerate((1, 1, 2)):
        batch.place(row, world, world.starts[0], key)
    assert np.array_equal(batch.obstacles(0), batch.obstacles(1))
    assert not np.array_equal(batch.obstacles(0), batch.obstacles(2))
    for _ in range(50):
        batch.drive(np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]), SUBSTEPS)
    assert not np.array_equal(batch.obstacles(0), batch.obstacles(1))
    assert batch.poses[0] == pytest.approx(world.starts[0], abs=0.5)


def test_where_nothing_moves_nothing_is_different():
    """A world with obstacles that are left out, and the same world without them."""
    world = load_world("random:office:3?rooms=6")
    moving = load_world(OFFICE)
    runs = []
    for each, movables in ((world, True), (moving, False)):
        sim = Simulator(each, movables=movables)
        sim.reset(np.random.default_rng(4))
        for _ in range(80):
            reading = sim.step(0.5, 0.2)
        runs.append((sim.pose, reading.laser.ranges))
    assert np.array_equal(runs[0][0], runs[1][0])
    assert np.array_equal(runs[0][1], runs[1][1])
