"""One robot among movable things on a floor of its own, stepped as a fleet steps it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pymunk

from albot_core.kernels.arguments import KernelArguments
from albot_env.sim import ODOMETERS, PIONEER_3DX
from albot_env.sim.chipmunk_kernels import Floors, Robots, advance
from albot_env.sim.engine import Bridge
from albot_env.sim.space import PHYSICS_STEP, Floor
from albot_env.sim.things import Things
from albot_maps import Box, Door, Movables, Walker, World

CONTROL_STEP = 0.1
SUBSTEPS = round(CONTROL_STEP / PHYSICS_STEP)


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
    """A room of so many metres, 8 by 6 if not told otherwise, with walls and things in it."""
    return World(
        name="room",
        walls=np.array([*room(*size), *walls]),
        starts=np.array([start]),
        movables=Movables(**{name: tuple(things) for name, things in movables.items()}),
    )


class Scene:
    """A robot among things. `steps` lets control steps of 0.1 s pass."""

    def __init__(self, world: World, key: int = 1, pose: Sequence[float] | None = None) -> None:
        self.world = world
        self.floor = Floor(world.walls, PIONEER_3DX)
        self.things = Things(1, PIONEER_3DX.radius)
        self.bridge = Bridge(20)
        self.robots = Robots(
            targets=np.zeros((1, 2)),
            wheels=np.zeros((1, 2)),
            counts=np.zeros((1, 5)),
            states=np.zeros((1, 6)),
            poses=np.zeros((1, 3)),
            touched=np.zeros((1, 2), np.bool_),
            ids=np.zeros(1, np.int64),
        )
        self.begin(key, pose)

    def begin(self, key: int, pose: Sequence[float] | None = None) -> None:
        where = self.world.starts[0] if pose is None else np.array(pose)
        self.things.leave(0)
        self.floor.place(0, tuple(where.tolist()))
        for array in (self.robots.targets, self.robots.wheels, self.robots.counts):
            array[:] = 0
        self.robots.touched[:] = False
        self.robots.states[0] = *where, 0, 0, 0
        self.things.begin(0, self.world, self.floor, where, key)
        ((place, id_),) = self.floor.order
        assert place == 0
        self.robots.ids[:] = id_
        self.tables = Floors(
            spaces=np.array([self.floor.addresses], np.int64),
            crews=np.array([1]),
            members=np.array([[0]]),
            places=np.array([0]),
        )

    @property
    def doors(self) -> np.ndarray:
        """Directions of the leaves."""
        return self.things.doors(0)

    @property
    def boxes(self) -> np.ndarray:
        """x, y, heading of each."""
        return self.things.boxes(0)

    @property
    def walkers(self) -> np.ndarray:
        """x, y, velocity x, y of each."""
        return self.things.walkers(0)

    @property
    def segments(self) -> np.ndarray:
        """The outlines of all things."""
        return self.things.segments(0)

    @property
    def robot(self) -> np.ndarray:
        """x, y, heading, velocity x, y, turn rate."""
        return self.robots.states[0]

    def steps(self, number: int, speed: float = 0.0, turn_rate: float = 0.0) -> None:
        engine = self.bridge.engine
        here = np.array([0])
        self.robots.targets[0] = PIONEER_3DX.wheels_for(speed, turn_rate)
        errors = ODOMETERS["ideal"].constants(PIONEER_3DX.wheel_base)
        base, acceleration = PIONEER_3DX.wheel_base, PIONEER_3DX.acceleration
        arguments = KernelArguments((engine, self.tables, self.robots, errors, base))
        for _ in range(number):
            self.things.command(here, engine, self.robots.states, CONTROL_STEP)
            advance(here, arguments, acceleration, PHYSICS_STEP, SUBSTEPS)
            self.things.observe(here, engine)

    def body(self, index: int) -> pymunk.Body:
        """The body that stands in a place of pymunk's order: robot, doors, boxes, walkers."""
        id_ = self.floor.body_ids[index]
        return next(body for body in self.floor.space.bodies if body.id == id_)

    def lift(self, index: int, x: float, y: float) -> None:
        """Put a body somewhere else."""
        self.body(index).position = x, y
        self.things.observe(np.array([0]), self.bridge.engine)
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
