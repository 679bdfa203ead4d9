"""The simulator: the Pioneer 3-DX and its sensors in a world of walls."""

from albot_env.sim.drive import PIONEER_3DX, RobotConfig
from albot_env.sim.laser import LASERS, LMS_200, LaserConfig, RayCaster
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.scenes import SCENES, SceneConfig
from albot_env.sim.sensors import Sensors, choose_sensors
from albot_env.sim.simulator import Simulator
from albot_env.sim.sonar import SONARS, SonarConfig

__all__ = [
    "LASERS",
    "LMS_200",
    "ODOMETERS",
    "PIONEER_3DX",
    "SCENES",
    "SONARS",
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
