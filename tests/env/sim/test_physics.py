"""Few passes take robots where many would, and none ever gets through a wall.

ALBOT_LONG_DRIVE=1 makes it a million control steps.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from albot_benchmarks.laser import floor_plan
from albot_core.geometry.types import Points, Segments
from albot_core.robot import Wheels
from albot_env.sim import PIONEER_3DX, Sensors
from albot_env.sim import physics as physics_module
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.physics import SUBSTEPS, PhysicsSpace
from albot_maps import load_world
from albot_maps.world import World

WORLD = load_world("random:office:3?rooms=4")
ROBOTS, STEPS, HOLD = 128, 100, 10


def ends(passes: int, monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, np.ndarray]:
    """Where robots are after ten seconds of random driving, and how often each touched a wall."""
    monkeypatch.setattr(physics_module, "_PASSES", passes)
    batch, rng = (
        BatchSimulator(ROBOTS, robot=PIONEER_3DX, sensors=Sensors()),
        np.random.default_rng(2),
    )
    for row in range(ROBOTS):
        batch.place(row, WORLD, WORLD.starts[row % len(WORLD.starts)], row)
    touched = np.zeros(ROBOTS, np.int64)
    for step in range(STEPS):
        if step % HOLD == 0:
            targets = rng.uniform(-0.6, 1.0, (ROBOTS, 2))
        batch.clear_contacts()
        batch.drive(targets, 2)
        touched += batch.collided
    return batch.poses[:, :2].copy(), touched


def test_robots_at_walls_end_up_where_many_passes_take_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, touched = ends(physics_module._PASSES, monkeypatch)
    reference, _ = ends(100, monkeypatch)
    apart = np.hypot(*(found - reference).T)
    rubbing = touched > STEPS // 10
    assert rubbing.sum() > ROBOTS // 3
    assert np.median(apart[rubbing]) < 0.005
    assert (apart[touched == 0] < 1e-9).all()
    assert (touched == 0).any()


LONG_DRIVE = 1_000_000 if os.environ.get("ALBOT_LONG_DRIVE") else 20_000
DRIVERS = 50


def free_places(space: PhysicsSpace, side: float, rng: np.random.Generator) -> np.ndarray:
    """Poses with room for a robot inside the plan's outer walls."""
    places: list[np.ndarray] = []
    while len(places) < DRIVERS:
        x, y = rng.uniform(0.3, side - 0.3, 2)
        pose = np.array([x, y, rng.uniform(-3, 3)])
        if space.clearance(pose, 1.0) > PIONEER_3DX.radius:
            places.append(pose)
    return np.array(places)


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
    places = free_places(PhysicsSpace(walls, PIONEER_3DX), side, rng)
    world = World(name="plan", walls=walls, starts=places[:1])
    batch = BatchSimulator(DRIVERS, robot=PIONEER_3DX, sensors=Sensors())
    for row, place in enumerate(places):
        batch.place(row, world, place, row)
    commands = [any_command(rng) for _ in range(DRIVERS)]
    before = batch.poses[:, :2].copy()
    bumps = 0
    for _ in range(LONG_DRIVE // DRIVERS // 2):
        for k in np.flatnonzero(rng.random(DRIVERS) < 0.05):
            commands[k] = any_command(rng)
        batch.drive(np.array(commands), SUBSTEPS)
        bumps += int(batch.pushed.sum())
        after = batch.poses[:, :2].copy()
        assert not crosses(walls, before, after).any()
        assert (after > 0).all()
        assert (after < side).all()
        before = after
    assert bumps > LONG_DRIVE / 100


@pytest.mark.parametrize("step", [0.005, 0.01])
def test_wheels_that_slip_pull_and_turn_as_hard_as_they_grip(step: float) -> None:
    """Friction is μ m g in all; each wheel has half, on a lever of half the wheel base."""
    space = PhysicsSpace(np.empty((0, 4)), PIONEER_3DX)
    space.place(0, (1.0, 2.0, 0.0))
    body, wheels = space._robot_parts[0][0], space._wheels[0]
    wheels.velocity, wheels.angular_velocity = (50.0, 0.0), 50.0
    space.space.step(step)
    friction = PIONEER_3DX.grip * PIONEER_3DX.mass * 9.81
    assert body.velocity.x == pytest.approx(friction / PIONEER_3DX.mass * step, rel=1e-3)
    torque = friction * PIONEER_3DX.wheel_base / 2
    assert body.angular_velocity == pytest.approx(torque / PIONEER_3DX.moment * step, rel=1e-3)
