"""The simulators: ours and others, with the same robots, worlds and lasers.

Each is used in the fastest way that it offers on one core, without noise. A simulator is imported
where its simulation begins, as all but ours and pymunk are optional.
"""

from __future__ import annotations

import importlib.util
import math
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import yaml
from jaxtyping import Float64, UInt8

from albot_benchmarks.baselines import PymunkLoopEnv
from albot_core.geometry.types import Poses, Segments
from albot_core.robot import PIONEER_3DX
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import ODOMETERS, LaserConfig, Sensors, choose_sensors
from albot_env.sim.batch_simulator import BatchSimulator
from albot_env.sim.physics import PHYSICS_STEP
from albot_env.sim.simulator import SUBSTEPS
from albot_maps import World
from albot_maps.world import ROBOT_RADIUS

CELL = 0.05
"""Side of a cell (m), for simulators that know the world as an image only."""

_STEP = SUBSTEPS * PHYSICS_STEP

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
    return {"world": size | {"step_time": _STEP}, "robot": robots, "obstacle": walls}


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
                world = VmasWorld(batch_dim, device, dt=_STEP, drag=0.0)
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
            agent.actuate(self._core.Twist2((command[0], 0.0), command[1], frame), _STEP)
            laser.update(agent, world, state)
            self._scans.append(laser.read_ranges(state))

    def poses(self) -> Poses:
        return np.array([(*agent.position, agent.orientation) for _, agent, *_ in self._robots])

    def ranges(self) -> Scans:
        return np.array(self._scans)


class _Image(NamedTuple):
    """A world as an image: 1 for a wall, with the first row at the bottom."""

    cells: UInt8[np.ndarray, "rows columns"]
    corner: tuple[float, float]
    """x, y of the first cell's corner (m)."""


def _image(walls: Segments) -> _Image:
    """Draw walls, with a margin of 1 m."""
    ends = walls.reshape(-1, 2)
    corner = ends.min(axis=0) - 1.0
    columns, rows = np.ceil((ends.max(axis=0) + 1.0 - corner) / CELL).astype(int)
    cells = np.zeros((rows, columns), np.uint8)
    shares = np.linspace(0.0, 1.0, 1 + math.ceil(8 * max(rows, columns)))[:, None]
    for wall in walls:
        points = wall[:2] + shares * (wall[2:] - wall[:2])
        column, row = ((points - corner) / CELL).astype(int).T
        cells[row, column] = 1
    return _Image(cells, (float(corner[0]), float(corner[1])))


class _Jalansim:
    """JALAN-Sim on its CPU backend."""

    def __init__(self, scene: Scene) -> None:
        os.environ.setdefault("USE_CUDA", "0")
        import jalansim
        from PIL import Image

        image, count = _image(scene.world.walls), len(scene.starts)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "world.png"
            Image.fromarray(255 * (1 - image.cells[::-1])).save(path)
            # Its coordinates are those of the cells' middles.
            x, y = (coordinate + CELL / 2 for coordinate in image.corner)
            self._map = jalansim.Map.load_image(str(path), CELL, x, y, 0.0)
        self._map.update_dist(scene.geometry.max_range)
        limits = {"vmin": -2.0, "vmax": 2.0, "wmin": -4.0, "wmax": 4.0}
        self._sim = jalansim.make("diff_drive", count, limits, radius=ROBOT_RADIUS)
        self._sim.set_map(self._map)
        self._sim.reset()
        self._sim.set_state(scene.starts.astype(np.float32))
        self._geometry, self._states = scene.geometry, np.zeros((count, 3), np.float32)
        self._scans = np.zeros((count, scene.geometry.beams), np.float32)

    def step(self, commands: Commands) -> None:
        geometry = self._geometry
        self._sim.step(commands.astype(np.float32), _STEP)
        self._sim.get_range(self._scans, geometry.beams, math.pi, geometry.max_range)

    def poses(self) -> Poses:
        self._sim.get_state(self._states)
        return self._states.astype(float)

    def ranges(self) -> Scans:
        return self._scans.astype(float)


class _F1tenth:
    """Cars of f1tenth_gym, in its fork gymkhana, with one Euler step of 0.1 s."""

    def __init__(self, scene: Scene) -> None:
        from gymkhana.envs.action import CarAction
        from gymkhana.envs.base_classes import DynamicModel, EulerIntegrator, RaceCar
        from gymkhana.envs.gymkhana_env import GKEnv
        from gymkhana.envs.track import Track
        from gymkhana.envs.track.track import TrackSpec

        image, params = _image(scene.world.walls), GKEnv.f1tenth_vehicle_params()
        spec = TrackSpec("world", None, CELL, (*image.corner, 0.0), 0, 0.45, 0.2)
        track = Track(spec, 255.0 * (1 - image.cells))
        RaceCar.scan_simulator = None  # All cars share one.
        self._cars = [
            RaceCar(
                params,
                seed=0,
                wall_deflection=False,
                action_type=CarAction(["speed", "steering_angle"], params, normalize=False),
                integrator=EulerIntegrator(),
                model=DynamicModel.KS,
                time_step=_STEP,
                num_beams=scene.geometry.beams,
                fov=math.pi,
            )
            for _ in scene.starts
        ]
        self._cars[0].set_map(track)
        for car, start in zip(self._cars, scene.starts, strict=True):
            car.reset(start)

    def step(self, commands: Commands) -> None:
        self._scans = []
        for car, (speed, turn_rate) in zip(self._cars, commands.tolist(), strict=True):
            scan = car.update_pose(turn_rate / 2, speed)
            car.check_ttc(scan)
            self._scans.append(scan)

    def poses(self) -> Poses:
        return np.array([car.state[[0, 1, 4]] for car in self._cars])

    def ranges(self) -> Scans:
        return np.array(self._scans)


class _JaxNav:
    """JaxNav of JaxMARL, one robot in each of its worlds."""

    def __init__(self, scene: Scene) -> None:
        import jax
        import jax.numpy as jnp
        from jaxmarl.environments.jaxnav.jaxnav_env import JaxNav, State

        image, count = _image(scene.world.walls), len(scene.starts)
        rows, columns = image.cells.shape
        self._corner, self._jnp = image.corner, jnp
        env = JaxNav(
            num_agents=1,
            rad=ROBOT_RADIUS,
            map_id="Grid-Rand-Poly",
            map_params={"map_size": (columns, rows), "cell_size": CELL},
            lidar_num_beams=scene.geometry.beams,
            lidar_range_resolution=CELL,
            lidar_max_range=scene.geometry.max_range,
            lidar_angle_factor=0.5,
            max_v=2.0,
            max_v_acc=100.0,
            max_w=4.0,
            max_w_acc=100.0,
            max_steps=10**9,
        )
        cells, key = jnp.asarray(image.cells, jnp.int32), jax.random.PRNGKey(0)
        where = scene.starts - (*image.corner, 0.0)

        def begin(pose: Any) -> Any:
            one, no = jnp.zeros(1, jnp.float32), jnp.zeros(1, bool)
            return State(
                pos=pose[None, :2], theta=pose[None, 2], vel=jnp.zeros((1, 2)), done=no, term=no,
                goal_reached=no, move_term=no, step=0, ep_done=False, goal=one[None] - 9.0,
                map_data=cells, rew_lambda=0.5,
            )  # fmt: skip

        def step(state: Any, command: Any) -> Any:
            observed, state, *_ = env.step_env(key, state, {"agent_0": command})
            return env.unnormalise_lidar(observed["agent_0"][: scene.geometry.beams]), state

        self._states = jax.vmap(begin)(jnp.asarray(where, jnp.float32))
        self._step = jax.jit(jax.vmap(step))
        self._scans = np.zeros((count, scene.geometry.beams))

    def step(self, commands: Commands) -> None:
        scans, self._states = self._step(self._states, self._jnp.asarray(commands, "float32"))
        self._scans = np.asarray(scans)

    def poses(self) -> Poses:
        states = self._states
        where = np.asarray(states.pos[:, 0], float) + self._corner
        return np.column_stack((where, np.asarray(states.theta[:, 0], float)))

    def ranges(self) -> Scans:
        return self._scans.astype(float)


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


OURS = (
    Peer("albot-env", "albot-env", "albot_env", _Ours, robots=64),
    Peer("albot-env, with sonars and noise", "albot-env", "albot_env", _with_sonars, robots=64),
)
PEERS = (
    Peer("JALAN-Sim", "jalansim", "jalansim", _Jalansim, robots=1024),
    Peer("navground", "navground", "navground", _Navground, robots=16),
    Peer("f1tenth_gym (gymkhana)", "gymkhana", "gymkhana", _F1tenth, robots=16),
    Peer("JaxNav", "jaxmarl", "jaxmarl", _JaxNav, robots=16),
    Peer("VMAS", "vmas", "vmas", _Vmas, robots=64),
    Peer("ir-sim", "ir-sim", "irsim", _IrSim, robots=100),
    Peer("irsim-x", "irsim-x", "irsim", _IrSim, robots=16),
    Peer("a loop over pymunk", "pymunk", "pymunk", _PymunkLoop),
)
"""The simulators that PyPI has, and the loop over pymunk."""
