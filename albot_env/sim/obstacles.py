"""Dynamic obstacles around the robots of a batch: doors, boxes and people, as pymunk bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pymunk
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.types import Pose, Segments
from albot_env.sim.chipmunk import ChipmunkInterface, address
from albot_env.sim.drive import GRAVITY
from albot_env.sim.obstacle_kernels import (
    command_obstacles,
    observe_obstacles,
    place_obstacles,
    update_outlines,
)
from albot_env.sim.obstacle_tables import SIDES, ObstacleStore, ObstacleTables
from albot_env.sim.physics import PhysicsSpace, PymunkObject
from albot_maps.movables import Box, Door, Walker
from albot_maps.world import World

FLOOR_FRICTION = 0.4
"""Friction coefficient of a box on the floor."""
_FRICTION = 0.3
"""Friction coefficient of all obstacles on each other, walls and robots."""
_WALKER_MASS = 75.0
"""Mass of a walker (kg)."""
_WALKER_THRUST = 5.0
"""Maximum acceleration that a walker's legs can produce (m/s²)."""


class ObstacleSnapshot(NamedTuple):
    """State of the obstacles around a robot."""

    tables: dict[str, np.ndarray]
    """Their records by kind; empty without obstacles."""
    bodies: Float64[np.ndarray, "bodies 6"]
    """x, y, heading, velocity x, y, turn rate of their bodies (m, rad, s; world frame)."""

    def with_known(self, known: ObstacleSnapshot, boxes: int) -> ObstacleSnapshot:
        """Return these obstacles in the state of a snapshot of the same ones.

        Args:
            known: The snapshot. After the first boxes it may have others, or none.
            boxes: Number of boxes that are the same; the others stay as they are.
        """
        tables, bodies, mine, its = {}, [], 0, 0
        for kind, table in self.tables.items():
            other = known.tables[kind]
            count, both = len(table), len(table) if kind != "boxes" else boxes
            tables[kind] = np.concatenate((other[:both], table[both:]))
            bodies += [known.bodies[its : its + both], self.bodies[mine + both : mine + count]]
            mine, its = mine + count, its + len(other)
        return ObstacleSnapshot(tables, np.concatenate(bodies))


_ADDRESS_FIELDS = ("body_index", "body_address", "first")
"""Fields of records that hold indices or addresses, which differ between spaces."""


class DynamicObstacles:
    """Doors, boxes and people around each robot of a batch, in the robot's own space.

    Their motion is a function of the key with which they were placed, of the world, and of the
    robot's motion since then, to the bit. When a robot is placed, call `remove` before and
    `place` after; around physics steps, call `command` before and `observe` after.

    Args:
        robots: Number of robots.
        radius: Radius of the robots (m).
    """

    def __init__(self, robots: int, radius: float) -> None:
        self._radius = radius
        self._store = ObstacleStore(robots)
        self._spaces: list[PhysicsSpace | None] = [None] * robots
        self._parts: list[list[PymunkObject]] = [[] for _ in range(robots)]
        self._legs: list[list[pymunk.Body]] = [[] for _ in range(robots)]
        self._leg_spaces: list[pymunk.Space | None] = [None] * robots
        self.present: Bool[np.ndarray, "robots"] = np.zeros(robots, np.bool_)
        """Which robots have dynamic obstacles around them."""
        self.most_bodies = 0
        """Maximum number of obstacle bodies that any space has had."""

    @property
    def tables(self) -> ObstacleTables:
        """All tables; each `place` may replace them."""
        return self._store.tables

    def outlines(self, row: int) -> Segments:
        """Return the current outlines of a robot's obstacles, as ray casting uses them."""
        own = self.tables.robots[row]
        return self.tables.outlines[own["outlines"] : own["outlines_end"]].copy()

    def _rows_of(self, row: int, kind: str) -> np.ndarray:
        """Return a robot's rows of a table."""
        own = self.tables.robots[row]
        table: np.ndarray = getattr(self.tables, kind)
        return table[own[kind] : own[f"{kind}_end"]]

    def remove(self, row: int) -> None:
        """Take a robot's obstacles out of its space."""
        space = self._spaces[row]
        if space is None:
            return
        space.space.remove(*self._parts[row])
        self._parts[row] = []
        self._spaces[row] = None
        self._store.fill(row, None)
        self.present[row] = False

    def place(self, row: int, world: World, space: PhysicsSpace, pose: Pose, key: int) -> None:
        """Put the obstacles of a world at their starts, after `remove` of the robot's last ones.

        Their bodies are made again, so that the motion does not depend on earlier episodes.

        Args:
            row: The robot.
            world: The world that the robot is in; it has dynamic obstacles.
            space: The robot's space, with this robot alone in it.
            pose: Start pose of the robot, in the world frame.
            key: 64 bits; all random numbers of the obstacles are a function of them.
        """
        self._spaces[row] = space
        self._store.fill(row, world)
        self._reserve_legs(row, len(world.movables.walkers))
        own = self.tables.robots[row : row + 1]
        own["space"], own["leg_space"] = space.addresses[0], address(self._leg_space(row)._space)
        state = np.array([*pose, 0.0, 0.0, 0.0])
        place_obstacles(self.tables, row, np.uint64(key), state, self._radius)
        bodies = self._make_bodies(row, world, space)
        space.space.add(*self._parts[row])
        self._note_order(row, space, [body.id for body in bodies])
        self.present[row] = True
        self.most_bodies = max(self.most_bodies, len(bodies))

    def snapshot(self, row: int) -> ObstacleSnapshot:
        """Return the state of a robot's obstacles (copies)."""
        tables = {kind: self._rows_of(row, kind).copy() for kind in ("doors", "boxes", "walkers")}
        states = [
            (*body.position, body.angle, *body.velocity, body.angular_velocity)
            for body in self._bodies(row)
        ]
        return ObstacleSnapshot(tables, np.array(states, np.float64).reshape(-1, 6))

    def restore(self, row: int, snapshot: ObstacleSnapshot) -> None:
        """Put a robot's obstacles, which have been placed, into the state of a snapshot."""
        for kind, table in snapshot.tables.items():
            own = self._rows_of(row, kind)
            for name in set(own.dtype.names or ()) - set(_ADDRESS_FIELDS):
                own[name] = table[name]
        for body, state in zip(self._bodies(row), snapshot.bodies.tolist(), strict=True):
            body.position, body.angle = state[:2], state[2]
            body.velocity, body.angular_velocity = state[3:5], state[5]
        space = self._spaces[row]
        if space is not None:
            update_outlines(self.tables, row)
            for body in self._bodies(row):
                space.space.reindex_shapes_for_body(body)

    def _bodies(self, row: int) -> list[pymunk.Body]:
        """Return the bodies of a robot's obstacles, doors first, walkers last."""
        return [part for part in self._parts[row] if isinstance(part, pymunk.Body)]

    def command(
        self,
        rows: Int64[np.ndarray, "some"],
        chipmunk: ChipmunkInterface,
        states: Float64[np.ndarray, "robots 6"],
        duration: float,
    ) -> None:
        """Set the motion of doors and walkers for the next `duration` (s).

        Args:
            rows: Robots with dynamic obstacles.
            chipmunk: Buffers with room for the bodies of a space.
            states: States of all robots: x, y, heading, velocity x, y, turn rate (world frame).
            duration: Time until the next command (s).
        """
        command_obstacles(rows, chipmunk, self.tables, states, self._radius, duration)

    def observe(self, rows: Int64[np.ndarray, "some"], chipmunk: ChipmunkInterface) -> None:
        """Read the positions and velocities of some robots' obstacles from pymunk."""
        observe_obstacles(rows, chipmunk, self.tables)

    def _leg_space(self, row: int) -> pymunk.Space:
        """Return the space of a robot's walkers' legs, which is never stepped."""
        space = self._leg_spaces[row]
        if space is None:
            space = self._leg_spaces[row] = pymunk.Space()
        return space

    def _reserve_legs(self, row: int, number: int) -> None:
        """Make legs for `number` walkers; unused legs move nobody."""
        legs = self._legs[row]
        while len(legs) < number:
            legs.append(pymunk.Body(body_type=pymunk.Body.KINEMATIC))
            self._leg_space(row).add(legs[-1])
        for body in legs:
            body.velocity = 0.0, 0.0

    def _make_bodies(self, row: int, world: World, space: PhysicsSpace) -> list[pymunk.Body]:
        """Make the bodies of doors, boxes and walkers."""
        doors, walkers = self._rows_of(row, "doors"), self._rows_of(row, "walkers")
        made = [
            door_parts(door, float(record["angle"]))
            for door, record in zip(world.movables.doors, doors, strict=True)
        ]
        doors["body_address"] = [address(body._body) for body, _ in made]
        ground = space.space.static_body
        made += [box_parts(box, ground) for box in world.movables.boxes]
        made += [
            walker_parts(walker, (float(record["x"]), float(record["y"])), legs)
            for walker, record, legs in zip(
                world.movables.walkers, walkers, self._legs[row], strict=False
            )
        ]
        self._parts[row] = [part for _, parts in made for part in parts]
        return [body for body, _ in made]

    def _note_order(self, row: int, space: PhysicsSpace, ids: Sequence[int]) -> None:
        """Store the indices at which pymunk reads out the bodies of doors, boxes and walkers."""
        order = {id_: index for index, id_ in enumerate(space.body_ids)}
        indices = [order[id_] for id_ in ids]
        for kind in ("doors", "boxes", "walkers"):
            table = self._rows_of(row, kind)
            table["body_index"] = indices[: len(table)]
            indices = indices[len(table) :]


def door_parts(door: Door, angle: float) -> tuple[pymunk.Body, list[PymunkObject]]:
    """Return a leaf at an angle (rad): a segment about its hinge that nothing can push."""
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    body.position, body.angle = door.hinge, angle
    leaf = pymunk.Segment(body, (0.0, 0.0), (door.width, 0.0), 0.0)
    leaf.friction = _FRICTION
    return body, [body, leaf]


def box_parts(box: Box, ground: pymunk.Body) -> tuple[pymunk.Body, list[PymunkObject]]:
    """Return a box at its start, with two joints that stand for its friction on the floor."""
    size = box.length, box.width
    body = pymunk.Body(box.mass, pymunk.moment_for_box(box.mass, size))
    body.position, body.angle = box.at, box.heading
    shape = pymunk.Poly.create_box(body, size)
    shape.friction = _FRICTION
    drag = pymunk.PivotJoint(ground, body, (0.0, 0.0), (0.0, 0.0))
    drag.max_force = FLOOR_FRICTION * box.mass * GRAVITY
    twist = pymunk.GearJoint(ground, body, 0.0, 1.0)
    twist.max_force = drag.max_force * lever(box.length, box.width)
    # Friction stops what moves; it does not pull it back.
    drag.error_bias = twist.error_bias = 1.0
    return body, [body, shape, drag, twist]


def lever(length: float, width: float) -> float:
    """Return the mean distance (m) of a rectangle's points from its centre.

    The friction torque on a body that turns on the spot is friction times weight times this.
    """
    a, b = length / 2, width / 2
    diagonal = math.hypot(a, b)
    sum_ = a * a / b * math.log((diagonal + b) / a) + b * b / a * math.log((diagonal + a) / b)
    return diagonal / 3 + sum_ / 6


def walker_parts(
    walker: Walker, at: tuple[float, float], legs: pymunk.Body
) -> tuple[pymunk.Body, list[PymunkObject]]:
    """Return a walker at x, y: a polygon that does not turn and that its legs pull along."""
    body = pymunk.Body(_WALKER_MASS, math.inf)
    body.position = at
    angles = [2 * math.pi * k / SIDES for k in range(SIDES)]
    corners = [(walker.radius * math.cos(a), walker.radius * math.sin(a)) for a in angles]
    shape = pymunk.Poly(body, corners)
    shape.friction = _FRICTION
    pull = pymunk.PivotJoint(legs, body, (0.0, 0.0), (0.0, 0.0))
    pull.max_force = _WALKER_MASS * _WALKER_THRUST
    pull.error_bias = 1.0
    return body, [body, shape, pull]
