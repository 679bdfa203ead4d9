"""How the wheels speed up, and robots that share a space."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.robot import STANDSTILL, Wheels
from albot_env.sim import PIONEER_3DX, Sensors
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.drive import ramped
from albot_env.sim.physics import MAX_ROBOTS, PHYSICS_STEP
from albot_maps.world import World

wheel_speed = st.floats(-PIONEER_3DX.max_speed, PIONEER_3DX.max_speed)


@settings(deadline=None)
@given(l0=wheel_speed, r0=wheel_speed, l1=wheel_speed, r1=wheel_speed)
def test_a_ramp_changes_no_wheel_faster_than_the_acceleration_and_arrives(
    l0: float, r0: float, l1: float, r1: float
) -> None:
    wheels, target = Wheels(l0, r0), Wheels(l1, r1)
    for _ in range(200):
        possible = PIONEER_3DX.acceleration * PHYSICS_STEP
        after = ramped(*wheels, *target, possible)
        for before, now in zip(wheels, after, strict=True):
            assert abs(now - before) <= possible + 1e-12
        wheels = Wheels(*after)
    assert wheels == target


def batch_in(world: World, starts: np.ndarray) -> BatchSimulator:
    """Robots in a world, each placed at its start."""
    batch = BatchSimulator(len(starts), robot=PIONEER_3DX, sensors=Sensors())
    for row, start in enumerate(starts):
        batch.place(row, world, start, row)
    return batch


def drives(world: World, starts: np.ndarray, commands: np.ndarray) -> np.ndarray:
    """The poses of robots in one space, step by step, each with commands of its own."""
    batch = batch_in(world, starts)
    ways = []
    for row in commands:
        targets = np.array([PIONEER_3DX.wheels_for(*command) for command in row.tolist()])
        for _ in range(10):
            batch.drive(targets, 1)
            ways.append(np.column_stack((batch.poses, batch.pushed)))
    return np.stack(ways, axis=1)


def test_robots_that_share_a_space_get_the_same_bits_as_alone(box: World) -> None:
    rng = np.random.default_rng(2)
    count = MAX_ROBOTS + 4  # in two spaces
    starts = np.column_stack((rng.uniform(0.3, 2.0, (count, 2)), rng.uniform(-3, 3, count)))
    commands = rng.uniform((-0.5, -2.0), (1.5, 2.0), (60, count, 2))
    together = drives(box, starts, commands)
    assert sum(way[:, 3].sum() for way in together) > 100
    for k in range(count):
        alone = drives(box, starts[k : k + 1], commands[:, k : k + 1])
        np.testing.assert_array_equal(together[k], alone[0])


def test_a_robot_placed_anew_leaves_the_others_and_its_own_future_as_they_were(box: World) -> None:
    rng = np.random.default_rng(4)
    starts = np.column_stack((rng.uniform(0.3, 2.0, (5, 2)), rng.uniform(-3, 3, 5)))
    commands = rng.uniform((-0.5, -2.0), (1.5, 2.0), (40, 5, 2))
    undisturbed = drives(box, starts, commands)
    batch = batch_in(box, starts)
    for step, row in enumerate(commands):
        targets = np.array([PIONEER_3DX.wheels_for(*command) for command in row.tolist()])
        if step in (7, 23):
            batch.place(1, box, starts[1], 9)
        if step >= 23:
            targets[1] = PIONEER_3DX.wheels_for(*commands[step - 23, 1].tolist())
        batch.drive(targets, 10)
        others = [0, 2, 3, 4]
        last = 10 * step + 9
        np.testing.assert_array_equal(batch.poses[others], undisturbed[others, last, :3])
        if step >= 23:
            np.testing.assert_array_equal(batch.poses[1], undisturbed[1, last - 230, :3])


def test_a_robot_that_stands_stays(box: World) -> None:
    way = drives(box, box.starts, np.zeros((20, 1, 2)))[0]
    np.testing.assert_array_equal(way[:, :3], np.repeat(box.starts, 200, axis=0))
    assert STANDSTILL == (0.0, 0.0)
