"""Baselines for the environments: a Python loop over pymunk, and ir-sim's laser.

ir-sim needs the extra `bench`.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pymunk
import yaml
from jaxtyping import Float32, Float64

from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.physics import PHYSICS_STEP
from albot_env.sim.simulator import SUBSTEPS
from albot_maps import World
from albot_maps.world import ROBOT_RADIUS

_NOISE = 0.01
_OVERLAP_LEFT = 0.2
_ROBOT = pymunk.ShapeFilter(group=1)


class PymunkLoopEnv:
    """A naive environment, written by pymunk's manual.

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


Scan = Callable[[], Float64[np.ndarray, "beams"]]
"""Takes a scan (m)."""


def irsim_found() -> bool:
    """Return whether ir-sim is installed."""
    return importlib.util.find_spec("irsim") is not None


def irsim_laser(world: World, geometry: LaserGeometry) -> Scan:
    """Return ir-sim's 2D laser at the world's first start, with the same noise as ours.

    Only the laser is timed, because a step of ir-sim also checks every wall for collisions.
    """
    # ir-sim prints on stdout which windows it cannot open.
    with contextlib.redirect_stdout(io.StringIO()), tempfile.TemporaryDirectory() as folder:
        irsim = importlib.import_module("irsim")
        path = Path(folder) / "world.yaml"
        path.write_text(yaml.safe_dump(_scene(world, geometry)), encoding="utf-8")
        env = irsim.make(str(path), headless=True, log_level="ERROR")
        env.step([0.0, 0.0])
    robot = env.robot
    laser = robot.sensors[0]

    def scan() -> Float64[np.ndarray, "beams"]:
        laser.step(robot.state)
        return np.array(laser.range_data)

    return scan


def _scene(world: World, geometry: LaserGeometry) -> dict[str, Any]:
    """Return the world as data for ir-sim's YAML; every wall is an obstacle."""
    x_min, y_min, x_max, y_max = world.bounds
    laser = {
        "name": "lidar2d",
        "range_max": geometry.max_range,
        "angle_range": geometry.spacing * (geometry.beams - 1),
        "number": geometry.beams,
        "noise": True,
        "std": 0.01,
    }
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": ROBOT_RADIUS},
        "state": world.starts[0].tolist(),
        "sensors": [laser],
    }
    walls = [
        {"shape": {"name": "linestring", "vertices": [[x1, y1], [x2, y2]]}, "state": [0, 0, 0]}
        for x1, y1, x2, y2 in world.walls.tolist()
    ]
    size = {"width": x_max - x_min, "height": y_max - y_min, "offset": [x_min, y_min]}
    return {"world": size, "robot": [robot], "obstacle": walls}
