"""The environments' baseline: a Python loop over pymunk."""

from __future__ import annotations

import math

import numpy as np
import pymunk
from jaxtyping import Float32

from albot_core.geometry.types import Pose
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.physics import PHYSICS_STEP, SUBSTEPS
from albot_maps import World
from albot_maps.world import ROBOT_RADIUS

_NOISE = 0.01
_OVERLAP_LEFT = 0.2
_ROBOT = pymunk.ShapeFilter(group=1)


class PymunkLoopEnv:
    """A naive environment, written as pymunk's manual suggests.

    A disc among walls, stepped like our robots (`SUBSTEPS` of `PHYSICS_STEP`), and a laser with one
    query per beam. It has no odometer, no map, no reward and no checks.

    Args:
        world: The world, for its walls and its first start.
        geometry: The beam geometry of the laser.
    """

    def __init__(self, world: World, geometry: LaserGeometry) -> None:
        self._geometry = geometry
        self._bearings = geometry.bearings.tolist()
        self._rng = np.random.default_rng(0)
        self._space = pymunk.Space()
        # By default pymunk separates overlapping shapes so slowly that robots drive through walls.
        self._space.collision_slop = 0.001
        self._space.collision_bias = _OVERLAP_LEFT ** (1 / PHYSICS_STEP)
        for x1, y1, x2, y2 in world.walls.tolist():
            wall = pymunk.Segment(self._space.static_body, (x1, y1), (x2, y2), 0.0)
            self._space.add(wall)
        mass = 13.5
        self._body = pymunk.Body(mass, pymunk.moment_for_circle(mass, 0, ROBOT_RADIUS))
        disc = pymunk.Circle(self._body, ROBOT_RADIUS)
        disc.filter = _ROBOT
        self._space.add(self._body, disc)
        x, y, heading = world.starts[0].tolist()
        self._body.position, self._body.angle = (x, y), heading

    @property
    def pose(self) -> Pose:
        """Pose of the robot (world frame)."""
        return np.array((*self._body.position, self._body.angle))

    def step(self, action: Float32[np.ndarray, "2"]) -> Float32[np.ndarray, "beams"]:
        """Drive for 0.1 s at shares of 1 m/s and 2 rad/s, and return the scan (m)."""
        speed, turn_rate = action.tolist()
        body = self._body
        for _ in range(SUBSTEPS):
            along = math.cos(body.angle), math.sin(body.angle)
            body.velocity = speed * along[0], speed * along[1]
            body.angular_velocity = 2 * turn_rate
            self._space.step(PHYSICS_STEP)
        return self.scan()

    def scan(self) -> Float32[np.ndarray, "beams"]:
        """Return the ranges (m), with one query per beam."""
        reach = self._geometry.max_range
        (x, y), heading = self._body.position, self._body.angle
        ranges = []
        for bearing in self._bearings:
            angle = heading + bearing
            end = x + reach * math.cos(angle), y + reach * math.sin(angle)
            hit = self._space.segment_query_first((x, y), end, 0.0, _ROBOT)
            ranges.append(reach * hit.alpha if hit else reach)
        noise = self._rng.normal(0.0, _NOISE, len(ranges))
        return (np.array(ranges) + noise).astype(np.float32)
