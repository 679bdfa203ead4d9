"""A robot that rests and is restored goes on as if never stopped, among other robots too."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from albot_env.sim import choose_sensors
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.settings import Equipment
from albot_maps import World, load_world


@pytest.mark.parametrize("mapper", ["none", "odometry", "albot1"])
def test_a_robot_goes_on_as_if_never_stopped(two_rooms: World, mapper: str) -> None:
    sensors = choose_sensors(
        laser="lms-200", odometer="carpet", sonar="poor", scenes="paper", source="test"
    )
    equipment = Equipment(mapper=mapper, sensors=sensors)
    one, other = (
        DrivingTask(n, equipment, actions=ActionConfig(), observations=ObservationConfig())
        for n in (1, 2)
    )
    rng = np.random.default_rng(1)
    one.begin(0, two_rooms, two_rooms.starts[0], rng)
    one.observe()
    for command in (*rng.uniform((0, -1), (1, 1), (30, 2)), *np.zeros((20, 2))):
        one.drive(command[np.newaxis])
        one.observe()
    assert one.at_rest
    other.begin(0, two_rooms, two_rooms.starts[1], rng)
    other.restore(1, two_rooms, one.episode_snapshot(0))
    for command in rng.uniform((-0.3, -1), (1, 1), (60, 2)):
        one.drive(command[np.newaxis])
        other.drive(np.array((command, command)))
        one.observe()
        other.observe()
        for attribute in ("observations", "poses", "beliefs", "coverages", "path_lengths"):
            ours, its = getattr(one, attribute)[0], getattr(other, attribute)[1]
            assert ours.tobytes() == its.tobytes(), attribute
        assert one.rooms_entered[0] == other.rooms_entered[1]
        assert np.array_equal(one.snapshot(0).segments, other.snapshot(1).segments)


def test_a_robot_that_is_restored_under_another_key_has_other_noise() -> None:
    env = gymnasium.make("Albot/Explore-v0", world="square-loop", mapper="none")
    env.reset(seed=1)
    robots, world = env.unwrapped._robot, load_world("square-loop")  # type: ignore[attr-defined]
    snapshot = robots.episode_snapshot(0)
    ranges = []
    for key in (None, None, 5, 6):
        robots.restore(0, world, snapshot, key)
        robots.observe()
        ranges.append(robots.readings.ranges[0].copy())
    env.close()
    assert np.array_equal(ranges[0], ranges[1])
    assert not np.array_equal(ranges[0], ranges[2])
    assert not np.array_equal(ranges[2], ranges[3])
