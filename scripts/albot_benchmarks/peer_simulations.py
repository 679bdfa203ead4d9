"""Simulations in ours and other simulators, with the same robots, worlds and lasers.

Each simulator is used in the fastest way that it offers on one core, without noise. It is imported
where its simulation begins, as all but ours and pymunk are optional. Those that know the world as
an image are in `image_simulations`.
"""

from __future__ import annotations

import importlib.util
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import yaml
from jaxtyping import Float64

from albot_benchmarks.baselines import PymunkLoopEnv
from albot_core.geometry.types import Poses
from albot_core.robot import PIONEER_3DX
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import ODOMETERS, LaserConfig, Sensors, choose_sensors
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.physics import PHYSICS_STEP, SUBSTEPS
from albot_maps import World
from albot_maps.world import ROBOT_RADIUS

STEP = SUBSTEPS * PHYSICS_STEP

Commands = Float64[np.ndarray, "robots 2"]
Scans = Float64[np.ndarray, "robots beams"]


@runtime_checkable
class Simulation(Protocol):
    """Robots in one world, each with a laser."""

    def step(self, commands: Commands) -> None:
        """Move each robot for 0.1 s at a speed (m/s) and turn rate (rad/s), and take its scan."""

    def poses(self) -> Poses:
        """Return the pose of each robot (world frame)."""

    def ranges(self) -> Scans:
        """Return the last scans (m)."""


class Scene(NamedTuple):
    """The data from which a simulation begins."""

    world: World
    geometry: LaserGeometry
    """The laser; its beams share 180° ahead."""
    starts: Poses
    """Start of each robot (world frame)."""


@dataclass(frozen=True)
class Peer:
    """A simulator that can be measured."""

    name: str
    package: str
    """Name of its distribution."""
    module: str
    """Name of its module; ir-sim and its fork have the same."""
    start: Callable[[Scene], Simulation]
    """Begins a simulation."""
    robots: int = 1
    """Number of robots that it steps at once."""

    @property
    def version(self) -> str | None:
        """Its version; None if it is not installed."""
        try:
            found, spec = distribution(self.package), importlib.util.find_spec(self.module)
        except PackageNotFoundError:
            return None
        places = (spec and spec.submodule_search_locations) or ()
        here = Path(str(found.locate_file("")))
        return found.version if any(Path(place).parent == here for place in places) else None


class _Ours:
    """Our simulator; by default with a laser and an odometer alone, and without noise."""

    def __init__(self, scene: Scene, sensors: Sensors | None = None) -> None:
        laser = LaserConfig(geometry=scene.geometry, range_noise=0.0, dropout=0.0)
        sensors = sensors or Sensors(laser=laser, odometer=ODOMETERS["ideal"])
        self._simulator = BatchSimulator(len(scene.starts), robot=PIONEER_3DX, sensors=sensors)
        for row, start in enumerate(scene.starts):
            self._simulator.place(row, scene.world, start, row)

    def step(self, commands: Commands) -> None:
        self._simulator.drive(PIONEER_3DX.targets_for(commands), SUBSTEPS)
        self._simulator.locate()
        self._simulator.sense()

    def poses(self) -> Poses:
        return self._simulator.poses

    def ranges(self) -> Scans:
        return self._simulator.ranges


def _with_sonars(scene: Scene) -> _Ours:
    """Return our simulation with our usual sensors, including eight sonars, and their noise."""
    return _Ours(scene, replace(choose_sensors(), laser=LaserConfig(geometry=scene.geometry)))


OURS = (
    Peer("albot-env", "albot-env", "albot_env", _Ours, robots=64),
    Peer("albot-env, with sonars and noise", "albot-env", "albot_env", _with_sonars, robots=64),
)


class _PymunkLoop:
    """The naive loop over pymunk's queries (`PymunkLoopEnv`)."""

    def __init__(self, scene: Scene) -> None:
        self._env = PymunkLoopEnv(scene.world, scene.geometry)

    def step(self, commands: Commands) -> None:
        self._scan = self._env.step((commands[0] / (1.0, 2.0)).astype(np.float32))

    def poses(self) -> Poses:
        return self._env.pose[None]

    def ranges(self) -> Scans:
        return self._scan[None].astype(float)


PYMUNK_LOOP = Peer("a loop over pymunk", "pymunk", "pymunk", _PymunkLoop)


class _IrSim:
    """ir-sim, or its fork irsim-x. Robots pass through walls and each other."""

    def __init__(self, scene: Scene) -> None:
        import irsim

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "world.yaml"
            path.write_text(yaml.safe_dump(_irsim_world(scene)), encoding="utf-8")
            self._env = irsim.make(str(path), display=False, log_level="ERROR")

    def step(self, commands: Commands) -> None:
        self._env.step([command[:, None] for command in commands])

    def poses(self) -> Poses:
        return np.array([robot.state[:3, 0] for robot in self._env.robot_list])

    def ranges(self) -> Scans:
        return np.array([robot.sensors[0].range_data for robot in self._env.robot_list])


def _irsim_world(scene: Scene) -> dict[str, Any]:
    """Return the world as data for ir-sim's YAML; every wall is an obstacle."""
    x_min, y_min, x_max, y_max = map(float, scene.world.bounds)
    laser = {
        "name": "lidar2d",
        "range_max": scene.geometry.max_range,
        "angle_range": math.pi,
        "number": scene.geometry.beams,
    }
    robots = [
        {
            "kinematics": {"name": "diff"},
            "shape": {"name": "circle", "radius": ROBOT_RADIUS},
            "state": start.tolist(),
            "vel_min": [-2, -4],
            "vel_max": [2, 4],
            "unobstructed": True,
            "sensors": [laser],
        }
        for start in scene.starts
    ]
    walls = [
        {"shape": {"name": "linestring", "vertices": [[x1, y1], [x2, y2]]}, "state": [0, 0, 0]}
        for x1, y1, x2, y2 in scene.world.walls.tolist()
    ]
    size = {"width": x_max - x_min, "height": y_max - y_min, "offset": [x_min, y_min]}
    return {"world": size | {"step_time": STEP}, "robot": robots, "obstacle": walls}


IRSIM = Peer("ir-sim", "ir-sim", "irsim", _IrSim, robots=100)
IRSIM_X = Peer("irsim-x", "irsim-x", "irsim", _IrSim, robots=16)


class _Vmas:
    """VMAS, one robot in each of its worlds; walls are lines."""

    def __init__(self, scene: Scene) -> None:
        import torch
        from vmas import make_env
        from vmas.simulator.core import Agent, Landmark, Line, Sphere
        from vmas.simulator.core import World as VmasWorld
        from vmas.simulator.dynamics.diff_drive import DiffDrive
        from vmas.simulator.scenario import BaseScenario
        from vmas.simulator.sensors import Lidar

        torch.set_num_threads(1)
        geometry, walls = scene.geometry, torch.tensor(scene.world.walls, dtype=torch.float32)
        starts = torch.tensor(scene.starts, dtype=torch.float32)
        along = walls[:, 2:] - walls[:, :2]

        class Scenario(BaseScenario):  # type: ignore[misc, unused-ignore]
            def make_world(self, batch_dim: int, device: Any, **_: Any) -> Any:
                world = VmasWorld(batch_dim, device, dt=STEP, drag=0.0)
                for row, length in enumerate(torch.linalg.vector_norm(along, dim=1).tolist()):
                    world.add_landmark(
                        Landmark(f"wall {row}", shape=Line(length), collide=True, movable=False)
                    )
                half = math.pi / 2
                laser = Lidar(world, -half, half, geometry.beams, geometry.max_range)
                agent = Agent(
                    "robot",
                    shape=Sphere(ROBOT_RADIUS),
                    sensors=[laser],
                    dynamics=DiffDrive(world),
                    u_range=[2.0, 4.0],
                )
                world.add_agent(agent)
                return world

            def reset_world_at(self, env_index: int | None = None) -> None:
                for row, wall in enumerate(self.world.landmarks):
                    middle = (walls[row, :2] + walls[row, 2:]) / 2
                    wall.set_pos(middle, env_index)
                    wall.set_rot(torch.atan2(along[row, 1], along[row, 0])[None], env_index)
                self.world.agents[0].set_pos(starts[:, :2], env_index)
                self.world.agents[0].set_rot(starts[:, 2:], env_index)

            def observation(self, agent: Any) -> Any:
                return agent.sensors[0].measure()

            def reward(self, agent: Any) -> Any:
                return agent.state.pos[:, 0]

        self._tensor = partial(torch.as_tensor, dtype=torch.float32)
        self._env = make_env(Scenario(), len(starts), device="cpu", continuous_actions=True)

    def step(self, commands: Commands) -> None:
        (self._scans,), *_ = self._env.step([self._tensor(commands)])

    def poses(self) -> Poses:
        state = self._env.agents[0].state
        return np.hstack((state.pos.numpy(), state.rot.numpy())).astype(float)

    def ranges(self) -> Scans:
        return np.asarray(self._scans.numpy(), float)


VMAS = Peer("VMAS", "vmas", "vmas", _Vmas, robots=64)


class _Navground:
    """navground: its kinematics and its laser, each robot in a world of its own."""

    def __init__(self, scene: Scene) -> None:
        from navground import core, sim
        from navground.sim import state_estimations

        self._core, self._robots = core, []
        for start in scene.starts.tolist():
            world = sim.World()
            for x1, y1, x2, y2 in scene.world.walls.tolist():
                world.add_wall(sim.Wall((x1, y1), (x2, y2)))
            laser = state_estimations.LidarStateEstimation(
                range=scene.geometry.max_range,
                start_angle=-math.pi / 2,
                field_of_view=math.pi,
                resolution=scene.geometry.beams,
            )
            kinematics = core.kinematics.TwoWheelsDifferentialDriveKinematics(2.0, 0.33)
            agent = sim.Agent(ROBOT_RADIUS, kinematics=kinematics, state_estimations=[laser])
            agent.pose = core.Pose2(start[:2], start[2])
            world.add_agent(agent)
            world._prepare()
            self._robots.append((world, agent, laser, core.SensingState()))

    def step(self, commands: Commands) -> None:
        self._scans = []
        frame = self._core.Frame.relative
        for command, (world, agent, laser, state) in zip(
            commands.tolist(), self._robots, strict=True
        ):
            agent.actuate(self._core.Twist2((command[0], 0.0), command[1], frame), STEP)
            laser.update(agent, world, state)
            self._scans.append(laser.read_ranges(state))

    def poses(self) -> Poses:
        return np.array([(*agent.position, agent.orientation) for _, agent, *_ in self._robots])

    def ranges(self) -> Scans:
        return np.array(self._scans)


NAVGROUND = Peer("navground", "navground", "navground", _Navground, robots=16)
