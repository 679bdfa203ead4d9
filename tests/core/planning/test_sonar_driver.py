"""The sonar driver: straight on, round obstacles, and through doors, without a laser."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import inverse, transform_points
from albot_core.planning.sonar_driver import SonarDriver, SonarDriverConfig
from albot_env.sim.odometer import ODOMETERS
from albot_env.sim.sensors import Sensors
from albot_env.sim.simulator import Simulator
from albot_env.sim.sonar import SONARS
from albot_maps import World, load_world

HALL = load_world("office-hall")


def drive(
    sonar: str,
    steps: int,
    goal: np.ndarray | None,
    seed: int = 0,
    world: World = HALL,
    start: tuple[float, float, float] = (3.2, 9.5, 0.0),
) -> tuple[np.ndarray, int]:
    """Where the robot came, in the hall's office, and how often it touched something."""
    sensors = Sensors(laser=None, odometer=ODOMETERS["ideal"], sonar=SONARS[sonar])
    simulator, driver = Simulator(world, sensors=sensors), SonarDriver()
    rng = np.random.default_rng(seed)
    reading = simulator.reset(rng, np.array(start))
    driver.reset(rng)
    way, touched = [simulator.pose[:2].copy()], 0
    for _ in range(steps):
        scan = reading.required_sonar("test")
        target = None if goal is None else transform_points(inverse(simulator.pose), goal)
        command = driver.command(scan.ranges, scan.geometry, reading.motion, target)
        reading = simulator.step(*command.tolist())
        way.append(simulator.pose[:2].copy())
        touched += simulator.collided
    return np.array(way), touched


@pytest.mark.parametrize("sonar", ["ideal", "pioneer"])
def test_it_wanders_without_touching_anything(sonar: str) -> None:
    way, touched = drive(sonar, 500, None)
    assert np.hypot(*np.diff(way, axis=0).T).sum() > 10.0
    assert touched <= 2


def test_it_comes_through_a_door_to_its_target() -> None:
    way, _ = drive("ideal", 400, np.array((7.7, 5.0)))
    assert np.hypot(*(way - (7.7, 5.0)).T).min() < 0.5


@pytest.mark.parametrize("width", [0.9, 1.2])
def test_it_passes_doors_from_anywhere_without_touching_them(width: float) -> None:
    """Two rooms of 6 m, and a door in a wall of 15 cm; 0.9 m is that of the random offices."""
    below, above = 3.0 - width / 2, 3.0 + width / 2
    outline = [(0, 0, 12, 0), (12, 0, 12, 6), (12, 6, 0, 6), (0, 6, 0, 0)]
    sides = [(x, *part) for x in (5.925, 6.075) for part in ((0, x, below), (above, x, 6))]
    jambs = [(5.925, y, 6.075, y) for y in (below, above)]
    walls = np.array([*outline, *sides, *jambs])
    rooms = World(name="two-rooms", walls=walls, starts=np.array([[2.0, 2.0, 0.0]]))
    rng, passed = np.random.default_rng(1), 0
    for seed in range(10):
        start = (rng.uniform(1, 5), rng.uniform(1, 5), rng.uniform(-3, 3))
        way, touched = drive("pioneer", 600, np.array((7.5, 3.0)), seed, rooms, start)
        assert touched == 0
        passed += bool(way[:, 0].max() > 6.5)
    assert passed >= 9


def test_it_drives_straight_until_an_obstacle() -> None:
    driver, sonar = SonarDriver(), SONARS["ideal"].geometry
    driver.reset(np.random.default_rng(0))
    nothing = np.full(len(sonar.bearings), np.inf)
    speed, turn_rate = driver.command(nothing, sonar, np.zeros(3))
    assert speed > 0
    assert turn_rate == 0
    near = np.where(np.abs(sonar.bearings) < 0.6, 0.3, np.inf)
    speed, turn_rate = driver.command(near, sonar, np.zeros(3))
    assert abs(turn_rate) > 0


def test_thresholds_are_checked() -> None:
    with pytest.raises(InputError, match=r"SonarDriverConfig\.speed"):
        SonarDriverConfig(speed=0.0)
