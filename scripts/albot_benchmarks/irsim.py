"""ir-sim's laser on our scene. Needs the extra `bench`."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float64

from albot_core.sensing.reading import LaserGeometry
from albot_maps import World
from albot_maps.world import ROBOT_RADIUS

Scan = Callable[[], Float64[np.ndarray, "beams"]]
"""Takes a scan (m)."""


def irsim_found() -> bool:
    """Whether ir-sim is installed."""
    return importlib.util.find_spec("irsim") is not None


def irsim_laser(world: World, geometry: LaserGeometry) -> Scan:
    """ir-sim's 2D laser at the world's first start, with noise as ours.

    The laser alone: a step of ir-sim also looks for collisions of every wall.
    """
    # It says on stdout which windows it cannot open.
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
    """The world as ir-sim's YAML says it: every wall is an obstacle."""
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
