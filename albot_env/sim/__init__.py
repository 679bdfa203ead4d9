"""The simulator: a robot and its sensors in a world of walls, doors, boxes and people.

| what | where |
|---|---|
| one robot, many robots | `simulator`, `batch_simulator` |
| body | `albot_core.robot` |
| wheels and walls | `drive`, `physics`; compiled: `chipmunk` |
| what moves | `obstacles`, `obstacle_tables`; compiled: `obstacle_kernels`, `doors`, `walkers` |
| sensors | `sensors`; all sensors of a batch: `sensing` |
| laser | `laser`; compiled: `ray_casting` |
| sonars | `sonar`; compiled: `sonar_kernels`, `sonar_echoes` |
| odometer, scenes, compass | `odometer`, `scenes`, `compass` |
| which walls can be seen from where | `wall_index`; compiled: `visibility` |
| random numbers, geometry | `noise`, `plane_geometry` |
| threads, cache of worlds | `thread_pool`, `world_cache` |
"""

from albot_core.robot import PIONEER_3DX, ROBOTS, RobotConfig
from albot_env.sim.compass import COMPASSES, CompassConfig
from albot_env.sim.laser import LASERS, LMS_200, LaserConfig, RayCaster
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.scenes import SCENES, SceneConfig
from albot_env.sim.sensors import Sensors, choose_sensors
from albot_env.sim.simulator import Simulator
from albot_env.sim.sonar import SONARS, SonarConfig

__all__ = [
    "COMPASSES",
    "LASERS",
    "LMS_200",
    "ODOMETERS",
    "PIONEER_3DX",
    "ROBOTS",
    "SCENES",
    "SONARS",
    "CompassConfig",
    "LaserConfig",
    "OdometerConfig",
    "RayCaster",
    "RobotConfig",
    "SceneConfig",
    "Sensors",
    "Simulator",
    "SonarConfig",
    "choose_sensors",
]
