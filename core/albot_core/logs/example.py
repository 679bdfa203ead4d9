"""A small log that comes with the project, so that mappers can be tried at once."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

EXAMPLE = Path(str(resources.files("albot_core.logs"))) / "example.log.gz"
"""A CARMEN log of the simulator: a robot with the laser `lms-200` and the odometer `poor` explores
`office-ring`. It holds its own reference, where the robot truly was. Made by `albot experiment
study example-log`."""
