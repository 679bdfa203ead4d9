"""What the wheels can do, and robots that share a space."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_env.sim import PIONEER_3DX, RobotConfig, Sensors
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.drive import STANDSTILL, Wheels, ramped
from albot_env.sim.physics import MAX_ROBOTS, PHYSICS_STEP
from albot_maps.world import World

any_number = st.floats(allow_nan=False, allow_infinity=False)
wheel_speed = st.floats(-PIONEER_3DX.max_speed, PIONEER_3DX.max_speed)


@settings(deadline=None)
@given(speed=any_number, turn_rate=any_number)
def test_no_command_asks_more_of_a_wheel_than_it_can(speed: float, turn_rate: float) -> None:
    wheels = PIONEER_3DX.wheels_for(speed, turn_rate)
    assert max(map(abs, wheels)) <= PIONEER_3DX.max_speed * (1 + 1e-12)
    assert abs(PIONEER_3DX.motion_of(wheels)[1]) <= PIONEER_3DX.max_turn_rate * (1 + 1e-12)


@settings(deadline=None)
@given(left=any_number, right=any_number)
def test_wheel_speeds_are_limited_too(left: float, right: float) -> None:
    wheels = PIONEER_3DX.limited(Wheels(left, right))
    assert max(map(abs, wheels)) <= PIONEER_3DX.max_speed
    assert abs(PIONEER_3DX.motion_of(wheels)[1]) <= PIONEER_3DX.max_turn_rate * (1 + 1e-12)


@settings(deadline=None)
@given(speed=st.floats(-0.7, 0.7), turn_rate=st.floats(-5.0, 5.0))
def test_a_possible_command_is_obeyed_as_it_is(speed: float, turn_rate: float) -> None:
    motion = PIONEER_3DX.motion_of(PIONEER_3DX.wheels_for(speed, turn_rate))
    assert motion == pytest.approx((speed, turn_rate), abs=1e-12)


def test_a_command_too_fast_for_the_outer_wheel_keeps_its_curve() -> None:
    speed, turn_rate = PIONEER_3DX.motion_of(PIONEER_3DX.wheels_for(1.6, 3.0))
    assert speed < 1.6
    assert turn_rate / speed == pytest.approx(3.0 / 1.6)


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


@pytest.mark.parametrize(
    ("field", "value"), [("radius", 0.0), ("mass", -1.0), ("grip", math.nan), ("cruise_speed", 2.0)]
)
def test_impossible_robots_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"RobotConfig.{field}: expected"):
        RobotConfig(**{field: value})


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
