"""What the wheels of robots can do, and robots by name."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_core.robot import DEFAULT_ROBOT, PIONEER_3DX, ROBOTS, RobotConfig, Wheels, choose_robot

any_number = st.floats(allow_nan=False, allow_infinity=False)


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


@pytest.mark.parametrize(
    ("field", "value"), [("radius", 0.0), ("mass", -1.0), ("grip", math.nan), ("cruise_speed", 2.0)]
)
def test_impossible_robots_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"RobotConfig.{field}: expected"):
        RobotConfig(**{field: value})


def test_the_robots_are_of_three_sizes() -> None:
    assert ROBOTS[DEFAULT_ROBOT] is PIONEER_3DX
    assert ROBOTS["kobuki"].radius < PIONEER_3DX.radius < ROBOTS["peoplebot"].radius


@pytest.mark.parametrize("name", ROBOTS)
def test_the_wheels_of_a_robot_are_within_its_body(name: str) -> None:
    assert ROBOTS[name].wheel_base < 2 * ROBOTS[name].radius


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_is_chosen_by_its_name_itself_or_its_plain_data(name: str) -> None:
    for robot in (name, ROBOTS[name], to_plain(ROBOTS[name])):
        assert choose_robot(robot, "here") == ROBOTS[name]


def test_fields_that_a_mapping_lacks_are_the_pioneer_s() -> None:
    assert choose_robot({"radius": 0.3}, "here") == RobotConfig(radius=0.3)


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ("peopelbot", r"here, robot: expected one of .*peoplebot.*did you mean peoplebot"),
        (3, r"here, robot: expected one of pioneer-3dx, .* found 3"),
        ({"radus": 0.3}, r"here, robot.radus: .*did you mean radius"),
        ({"radius": -0.3}, r"here, robot\.radius: expected"),
    ],
)
def test_what_is_no_robot_is_refused(robot: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        choose_robot(robot, "here")
