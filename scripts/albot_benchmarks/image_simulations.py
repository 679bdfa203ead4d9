"""Simulations in simulators that know the world as an image (see `peer_simulations`)."""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import UInt8

from albot_benchmarks.peer_simulations import STEP, Commands, Peer, Scans, Scene
from albot_core.geometry.types import Poses, Segments
from albot_maps.world import ROBOT_RADIUS

CELL = 0.05
"""Side of a cell (m)."""


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
        self._sim.step(commands.astype(np.float32), STEP)
        self._sim.get_range(self._scans, geometry.beams, math.pi, geometry.max_range)

    def poses(self) -> Poses:
        self._sim.get_state(self._states)
        return self._states.astype(float)

    def ranges(self) -> Scans:
        return self._scans.astype(float)


JALANSIM = Peer("JALAN-Sim", "jalansim", "jalansim", _Jalansim, robots=1024)


class _F1tenth:
    """Cars of f1tenth_gym, as its fork gymkhana has them, in one Euler step of 0.1 s."""

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
                time_step=STEP,
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


GYMKHANA = Peer("f1tenth_gym (gymkhana)", "gymkhana", "gymkhana", _F1tenth, robots=16)


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


JAXNAV = Peer("JaxNav", "jaxmarl", "jaxmarl", _JaxNav, robots=16)
