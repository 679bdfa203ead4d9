"""The bodies of movable things in pymunk."""

from __future__ import annotations

import math

import pymunk

from albot_env.sim.drive import GRAVITY
from albot_env.sim.thing_kernels import SIDES
from albot_maps.movables import Box, Door, Walker

FLOOR_FRICTION = 0.4
"""Friction coefficient of a box on the floor."""
_FRICTION = 0.3
"""Friction coefficient of all things against each other, walls and robots."""
_WALKER_MASS = 75.0
"""Mass of somebody who walks (kg)."""
_WALKER_THRUST = 5.0
"""The acceleration that a walker's legs can bring about (m/s²)."""

Parts = list[pymunk.Body | pymunk.Shape | pymunk.Constraint]


def door_parts(door: Door, angle: float) -> tuple[pymunk.Body, Parts]:
    """A leaf at an angle (rad): a segment about its hinge that nothing can push."""
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    body.position, body.angle = door.hinge, angle
    leaf = pymunk.Segment(body, (0.0, 0.0), (door.width, 0.0), 0.0)
    leaf.friction = _FRICTION
    return body, [body, leaf]


def box_parts(box: Box, ground: pymunk.Body) -> tuple[pymunk.Body, Parts]:
    """A box where it begins, with two joints that are its friction on the ground."""
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
    """Mean distance (m) of a rectangle's points from its middle.

    A body that turns on the spot is slowed by friction times its weight times this.
    """
    a, b = length / 2, width / 2
    diagonal = math.hypot(a, b)
    sum_ = a * a / b * math.log((diagonal + b) / a) + b * b / a * math.log((diagonal + a) / b)
    return diagonal / 3 + sum_ / 6


def walker_parts(
    walker: Walker, at: tuple[float, float], legs: pymunk.Body
) -> tuple[pymunk.Body, Parts]:
    """A walker at x, y: a polygon that does not turn, pulled along by its legs' velocity."""
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
