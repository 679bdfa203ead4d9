"""No robot ever gets through a wall, whatever it is told to do.

ALBOT_LONG_DRIVE=1 makes it a million control steps.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from albot_core.geometry.types import Points, Segments
from albot_env.benchmarks.laser import floor_plan
from albot_env.sim import PIONEER_3DX
from albot_env.sim.drive import Wheels
from albot_env.sim.simulator import SUBSTEPS
from albot_env.sim.space import PHYSICS_STEP, Floor, Robot

STEPS = 1_000_000 if os.environ.get("ALBOT_LONG_DRIVE") else 20_000
ROBOTS = 50


def free_places(floor: Floor, side: float, rng: np.random.Generator) -> list[np.ndarray]:
    """Poses with room for a robot inside the plan's outer walls."""
    places: list[np.ndarray] = []
    while len(places) < ROBOTS:
        x, y = rng.uniform(0.3, side - 0.3, 2)
        pose = np.array([x, y, rng.uniform(-3, 3)])
        if floor.clearance(pose, 1.0) > PIONEER_3DX.radius:
            places.append(pose)
    return places


def any_command(rng: np.random.Generator) -> Wheels:
    """What the wheels are told: mostly sensible, sometimes absurd."""
    scale = rng.choice([0.3, 1.0, 3.0, 1e9])
    speed, turn_rate = rng.normal(0.5, 1.0) * scale, rng.normal(0.0, 1.0) * scale
    return PIONEER_3DX.wheels_for(float(speed), float(turn_rate))


def crosses(walls: Segments, before: Points, after: Points) -> np.ndarray:
    """Whether the way from a point before to the point after crosses a wall."""

    def side(
        ax: np.ndarray,
        ay: np.ndarray,
        bx: np.ndarray,
        by: np.ndarray,
        px: np.ndarray,
        py: np.ndarray,
    ) -> np.ndarray:
        return (bx - ax) * (py - ay) - (by - ay) * (px - ax)

    x1, y1, x2, y2 = walls.T[:, np.newaxis]
    bx, by = before.T[:, :, np.newaxis]
    ax, ay = after.T[:, :, np.newaxis]
    apart = side(x1, y1, x2, y2, bx, by) * side(x1, y1, x2, y2, ax, ay) < 0
    between = side(bx, by, ax, ay, x1, y1) * side(bx, by, ax, ay, x2, y2) < 0
    return (apart & between).any(axis=1)


@pytest.mark.parametrize("segments", [60, 200])
def test_no_robot_gets_through_a_wall(segments: int) -> None:
    rng = np.random.default_rng(segments)
    walls = floor_plan(segments, rng)
    side = walls.max()
    floor = Floor(walls)
    robots = [Robot(floor, PIONEER_3DX) for _ in range(ROBOTS)]
    for robot, place in zip(robots, free_places(floor, side, rng), strict=True):
        robot.place(place)
    commands = [any_command(rng) for _ in robots]
    before = np.array([robot.pose[:2] for robot in robots])
    bumps = 0
    for _ in range(STEPS // ROBOTS // 2):
        for k in np.flatnonzero(rng.random(ROBOTS) < 0.05):
            commands[k] = any_command(rng)
        for _ in range(SUBSTEPS):
            for robot, command in zip(robots, commands, strict=True):
                robot.drive(PIONEER_3DX.ramped(robot.wheels, command, PHYSICS_STEP))
            floor.step()
        bumps += sum(robot.pushed for robot in robots)
        after = np.array([robot.pose[:2] for robot in robots])
        assert not crosses(walls, before, after).any()
        assert (after > 0).all()
        assert (after < side).all()
        before = after
    assert bumps > STEPS / 100
