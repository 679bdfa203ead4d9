"""The simulator: closed forms of free motion, what walls do, and the same bits twice."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_env.sim import LMS_200, ODOMETERS, PIONEER_3DX, LaserConfig, Sensors, Simulator
from albot_maps.world import World

EXACT = LaserConfig(range_noise=0.0, dropout=0.0)
RADIUS = PIONEER_3DX.radius


def simulator(world: World) -> Simulator:
    """A simulator without any noise, reset."""
    sim = Simulator(world, sensors=Sensors(laser=EXACT, odometer=ODOMETERS["ideal"]))
    sim.reset(np.random.default_rng(0))
    return sim


def test_first_reading_sees_the_room_and_no_motion(box: World) -> None:
    sim = Simulator(box, sensors=Sensors(laser=EXACT))
    reading = sim.reset(np.random.default_rng(0))
    np.testing.assert_allclose(reading.laser.ranges[[0, 90, 180]], 5.0)
    np.testing.assert_array_equal(reading.motion, np.zeros(3))
    np.testing.assert_array_equal(sim.pose, box.starts[0])
    assert (reading.stamp, sim.time, sim.collided) == (0.0, 0.0, False)


def test_constant_wheel_speeds_drive_a_circle(box: World) -> None:
    sim = simulator(box)
    speed, turn_rate = 0.6, 0.5
    for _ in range(10):
        sim.step(speed, turn_rate)
    assert sim.velocity == pytest.approx((speed, turn_rate), abs=1e-12)
    before = sim.pose
    for _ in range(40):
        sim.step(speed, turn_rate)
    radius, angle = speed / turn_rate, turn_rate * 4.0
    arc = np.array([radius * math.sin(angle), radius * (1 - math.cos(angle)), angle])
    np.testing.assert_allclose(sim.pose, compose(before, arc), atol=1e-9)
    assert not sim.collided


def test_speed_grows_no_faster_than_the_acceleration_and_ends_at_the_top(box: World) -> None:
    sim = simulator(box)
    speeds = [0.0]
    for _ in range(20):
        sim.step(1e9, 0.0)
        speeds.append(sim.velocity[0])
    gains = np.diff(speeds)
    np.testing.assert_allclose(gains[:15], PIONEER_3DX.acceleration * 0.1, atol=1e-9)
    assert speeds[-1] == pytest.approx(PIONEER_3DX.max_speed)


@pytest.mark.parametrize("speed", [0.2, 1.6, 1e9, 1e308, -1e308])
def test_it_stops_at_a_wall_with_its_hull_on_the_surface(box: World, speed: float) -> None:
    sim = simulator(box)
    for _ in range(400):
        sim.step(speed, 0.0)
    x, y, heading = sim.pose
    assert abs(x - 5.0) == pytest.approx(5.0 - RADIUS, abs=0.002)
    assert (y, heading) == pytest.approx((5.0, 0.0), abs=1e-9)
    assert sim.velocity[0] == pytest.approx(0.0, abs=1e-9)
    assert sim.collided


def test_it_slides_along_a_wall_that_it_meets_at_an_angle(box: World) -> None:
    sim = Simulator(box, sensors=Sensors(laser=EXACT))
    sim.reset(np.random.default_rng(0), np.array([8.0, 2.0, math.pi / 3]))
    for _ in range(60):
        sim.step(1.0, 0.0)
    x, y, heading = sim.pose
    assert x == pytest.approx(10.0 - RADIUS, abs=0.002)
    assert y > 5.0
    assert heading == pytest.approx(math.pi / 3, abs=0.1)
    assert sim.collided


def test_wheels_that_slip_at_a_wall_count_metres_that_the_robot_does_not_go(box: World) -> None:
    sim = simulator(box)
    for _ in range(200):
        sim.step(0.5, 0.0)
    before = sim.pose
    measured = sum(sim.step(0.5, 0.0).motion[0] for _ in range(20))
    assert measured == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(sim.pose, before, atol=1e-6)


@pytest.mark.parametrize("distance", [1.0, -0.7, 0.003, 3.3, 0.0])
def test_a_move_goes_exactly_its_distance_and_ends_at_rest(box: World, distance: float) -> None:
    sim = simulator(box)
    reading = sim.move(distance)
    np.testing.assert_allclose(sim.pose, [5.0 + distance, 5.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(reading.motion, [distance, 0.0, 0.0], atol=1e-9)
    assert sim.velocity == pytest.approx((0.0, 0.0), abs=1e-12)
    assert reading.stamp == sim.time
    assert not sim.collided


@pytest.mark.parametrize("angle", [math.pi / 4, -math.pi / 2, 3.0, 1e-3])
def test_a_turn_turns_on_the_spot(box: World, angle: float) -> None:
    sim = simulator(box)
    reading = sim.turn(angle)
    np.testing.assert_allclose(sim.pose, [5.0, 5.0, angle], atol=1e-9)
    np.testing.assert_allclose(reading.motion, [0.0, 0.0, angle], atol=1e-9)


def test_a_move_after_driving_brakes_first_and_its_reading_holds_all_motion(box: World) -> None:
    sim = simulator(box)
    for _ in range(10):
        sim.step(1.0, 0.4)
    before = sim.pose
    reading = sim.move(1.0)
    np.testing.assert_allclose(compose(before, reading.motion), sim.pose, atol=1e-9)
    assert sim.velocity == pytest.approx((0.0, 0.0), abs=1e-12)


def test_a_blocked_move_ends_soon_after_it_stops_progressing(box: World) -> None:
    sim = simulator(box)
    free = (5.0 - RADIUS) / PIONEER_3DX.cruise_speed
    sim.move(100.0)
    assert sim.pose[0] == pytest.approx(10.0 - RADIUS, abs=0.002)
    assert free < sim.time < free + 2.0
    assert sim.collided
    sim.move(-1.0)
    assert sim.pose[0] == pytest.approx(9.0 - RADIUS, abs=0.002)


def test_ideal_odometry_is_the_true_motion_where_nothing_is_touched(box: World) -> None:
    sim = simulator(box)
    rng = np.random.default_rng(3)
    estimate = sim.start
    for _ in range(100):
        reading = sim.step(*rng.uniform((-0.3, -1.0), (0.3, 1.0)).tolist())
        estimate = compose(estimate, reading.motion)
        assert not sim.collided
        np.testing.assert_allclose(estimate, sim.pose, atol=1e-9)


def drive(sim: Simulator, seed: int) -> list[bytes]:
    """The bytes of every reading and true pose of a random drive that meets walls."""
    rng = np.random.default_rng(seed)
    readings = [sim.reset(rng)]
    poses = [sim.pose]
    bumps = 0
    for k in range(300):
        command = rng.uniform((-1.0, -1.5), (2.0, 1.5)).tolist()
        readings.append(sim.move(command[0]) if k % 50 == 49 else sim.step(*command))
        poses.append(sim.pose)
        bumps += sim.collided
    for _ in range(100):
        readings.append(sim.step(1.6, 0.05))
        poses.append(sim.pose)
    assert sim.collided
    return [r.laser.ranges.tobytes() + r.motion.tobytes() for r in readings] + [
        p.tobytes() for p in poses
    ]


def test_twin_seeds_give_the_same_bits_in_new_and_in_used_simulators(box: World) -> None:
    used = Simulator(box)
    first = drive(used, 7)
    assert drive(Simulator(box), 7) == first
    # The last drive ended pushing a wall; nothing of that may be left after a reset.
    assert drive(used, 7) == first
    assert drive(used, 8) != first


@pytest.mark.parametrize(
    ("start", "found"),
    [
        (np.array([0.1, 5.0, 0.0]), "0.100 m from one"),
        (np.array([5.0, 0.0, 0.0]), "0.000 m from one"),
        (np.array([np.nan, 5.0, 0.0]), "nan"),
        (np.array([5.0, 5.0, np.inf]), "inf"),
    ],
)
def test_a_start_that_does_not_fit_is_refused(box: World, start: np.ndarray, found: str) -> None:
    with pytest.raises(InputError, match=found):
        Simulator(box).reset(np.random.default_rng(0), start)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_commands_that_are_not_finite_are_refused(box: World, value: float) -> None:
    sim = simulator(box)
    for call in (
        lambda: sim.step(value, 0.0),
        lambda: sim.step(0.0, value),
        lambda: sim.step_wheels(value, 0.0),
        lambda: sim.step_wheels(0.0, value),
        lambda: sim.move(value),
        lambda: sim.turn(value),
    ):
        with pytest.raises(InputError, match="expected a"):
            call()
    np.testing.assert_array_equal(sim.pose, box.starts[0])


def test_it_wants_a_reset_first(box: World) -> None:
    with pytest.raises(InputError, match="a reset before anything else"):
        Simulator(box).step(0.1, 0.0)


def test_the_laser_sits_where_its_mount_says(box: World) -> None:
    geometry = type(LMS_200.geometry)(mount=(0.1, 0.0, math.pi))
    exact = LaserConfig(geometry=geometry, range_noise=0.0, dropout=0.0)
    sim = Simulator(box, sensors=Sensors(laser=exact))
    assert sim.reset(np.random.default_rng(0)).laser.ranges[90] == pytest.approx(5.1)
