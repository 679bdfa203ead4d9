"""One robot among movable obstacles in a space of its own, stepped as a batch steps it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from albot_core.kernels.arguments import ArgumentsCache
from albot_core.robot import CONTROL_STEP
from albot_env.sim import ODOMETERS, PIONEER_3DX
from albot_env.sim.chipmunk import ChipmunkBuffers, RobotArrays, SpaceTables, advance
from albot_env.sim.obstacles import DynamicObstacles
from albot_env.sim.odometer import ODOMETER_COUNT
from albot_env.sim.physics import PHYSICS_STEP, SUBSTEPS, PhysicsSpace, solver_steps
from albot_maps import Box, Door, Movables, Walker, World


def room(width: float = 8.0, depth: float = 6.0) -> list[list[float]]:
    """The walls of a room with a corner at the origin."""
    return [
        [0.0, 0.0, width, 0.0],
        [width, 0.0, width, depth],
        [width, depth, 0.0, depth],
        [0.0, depth, 0.0, 0.0],
    ]


def world_of(
    *,
    start: Sequence[float] = (1.0, 1.0, 0.0),
    walls: Sequence[Sequence[float]] = (),
    size: tuple[float, float] = (8.0, 6.0),
    **movables,
) -> World:
    """A room of so many metres, 8 by 6 if not told otherwise, with walls and obstacles in it."""
    return World(
        name="room",
        walls=np.array([*room(*size), *walls]),
        starts=np.array([start]),
        movables=Movables(**{name: tuple(obstacles) for name, obstacles in movables.items()}),
    )


class Scene:
    """A robot among obstacles. `steps` lets control steps of 0.1 s pass."""

    def __init__(self, world: World, key: int = 1, pose: Sequence[float] | None = None) -> None:
        self.world = world
        self.space = PhysicsSpace(world.walls, PIONEER_3DX)
        self.obstacles = DynamicObstacles(1, PIONEER_3DX.radius)
        self.buffers = ChipmunkBuffers(20)
        self.robots = RobotArrays(
            targets=np.zeros((1, 2)),
            wheels=np.zeros((1, 2)),
            counts=np.zeros(1, ODOMETER_COUNT),
            states=np.zeros((1, 6)),
            poses=np.zeros((1, 3)),
            touched=np.zeros((1, 2), np.bool_),
            body_ids=np.zeros(1, np.int64),
        )
        errors = ODOMETERS["ideal"].constants(PIONEER_3DX.wheel_base)
        self._cache = ArgumentsCache(
            lambda chipmunk, tables: (chipmunk, tables, self.robots, errors, PIONEER_3DX.wheel_base)
        )
        self.begin(key, pose)

    def begin(self, key: int, pose: Sequence[float] | None = None) -> None:
        where = self.world.starts[0] if pose is None else np.array(pose)
        self.obstacles.remove(0)
        self.space.place(0, tuple(where.tolist()))
        for array in (self.robots.targets, self.robots.wheels, self.robots.counts):
            array[:] = 0
        self.robots.touched[:] = False
        self.robots.states[0] = *where, 0, 0, 0
        self.obstacles.place(0, self.world, self.space, where, key)
        ((place, id_),) = self.space.order
        assert place == 0
        self.robots.body_ids[:] = id_
        self.tables = SpaceTables(
            spaces=np.array([self.space.addresses], np.int64),
            robot_counts=np.array([1]),
            rows=np.array([[0]]),
            slots=np.array([0]),
            solver_steps=np.array([solver_steps(self.world.movables)]),
        )

    @property
    def doors(self) -> np.ndarray:
        """Directions of the leaves."""
        return self._columns("doors", "angle")[:, 0]

    @property
    def boxes(self) -> np.ndarray:
        """x, y, heading of each."""
        return self._columns("boxes", "x", "y", "heading")

    @property
    def walkers(self) -> np.ndarray:
        """x, y, velocity x, y of each."""
        return self._columns("walkers", "x", "y", "vx", "vy")

    @property
    def segments(self) -> np.ndarray:
        """The outlines of all obstacles."""
        return self.obstacles.outlines(0)

    def _columns(self, kind: str, *names: str) -> np.ndarray:
        """Fields of the robot's obstacles of one kind."""
        tables = self.obstacles.tables
        own = tables.robots[0]
        table = getattr(tables, kind)[own[kind] : own[f"{kind}_end"]]
        return np.stack([table[name] for name in names], axis=1)

    @property
    def robot(self) -> np.ndarray:
        """x, y, heading, velocity x, y, turn rate."""
        return self.robots.states[0]

    def steps(self, number: int, speed: float = 0.0, turn_rate: float = 0.0) -> None:
        chipmunk = self.buffers.interface
        here = np.array([0])
        self.robots.targets[0] = PIONEER_3DX.wheels_for(speed, turn_rate)
        arguments = self._cache.arguments(chipmunk, self.tables)
        for _ in range(number):
            self.obstacles.command(here, chipmunk, self.robots.states, CONTROL_STEP)
            advance(here, arguments, PIONEER_3DX.acceleration, PHYSICS_STEP, SUBSTEPS)
            self.obstacles.observe(here, chipmunk)

    def body(self, index: int) -> pymunk.Body:
        """The body that stands in a place of pymunk's order: robot, doors, boxes, walkers."""
        id_ = self.space.body_ids[index]
        return next(body for body in self.space.space.bodies if body.id == id_)

    def lift(self, index: int, x: float, y: float) -> None:
        """Put a body somewhere else."""
        self.body(index).position = x, y
        self.obstacles.observe(np.array([0]), self.buffers.interface)
        if index == 0:
            self.robots.states[0, :2] = x, y


def gap_of(scene: Scene, x: float, y: float) -> float:
    """Distance of the robot's middle from a point."""
    return math.hypot(scene.robot[0] - x, scene.robot[1] - y)


def inside(scene: Scene, clearance: float) -> bool:
    """Whether the robot's middle is so far inside the outer walls (m)."""
    x, y = scene.robot[:2]
    left, low, right, high = scene.world.bounds
    return min(x - left, y - low, right - x, high - y) >= clearance


def crowd(key: int) -> Scene:
    """A robot among two doors, three boxes and three people."""
    doors = [
        Door(
            hinge=(4.0, 2.5),
            heading=math.pi / 2,
            width=1.0,
            shut_for=(0.5, 3.0),
            open_for=(0.5, 3.0),
        )
    ]
    boxes = [
        Box(at=(1.5, 2.2)),
        Box(at=(6.0, 2.0), heading=0.4, length=1.0, width=0.3, mass=8.0),
        Box(at=(6.0, 5.4), mass=2.0),
    ]
    walkers = [
        Walker(route=((0.6, 3.0), (7.4, 3.0))),
        Walker(route=((1.0, 5.0), (3.0, 5.0), (3.0, 1.0)), closed=True, speed=(0.5, 2.0)),
        Walker(route=((7.0, 0.5), (7.0, 5.0)), radius=0.2),
    ]
    walls = [[4.0, 0.0, 4.0, 2.5], [4.0, 3.5, 4.0, 6.0]]
    return Scene(
        world_of(walls=walls, doors=doors, boxes=boxes, walkers=walkers), key, (1.0, 1.0, 0.0)
    )
