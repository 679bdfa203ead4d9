"""The simulator: the Pioneer 3-DX, its laser and its odometer in a world of walls."""

from albot_env.sim.drive import PIONEER_3DX, RobotConfig
from albot_env.sim.laser import LMS_200, LaserConfig
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.rays import RayCaster
from albot_env.sim.simulator import Simulator

__all__ = [
    "LMS_200",
    "ODOMETERS",
    "PIONEER_3DX",
    "LaserConfig",
    "OdometerConfig",
    "RayCaster",
    "RobotConfig",
    "Simulator",
]
