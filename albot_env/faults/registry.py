"""The registry of all faults that environments know."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from albot_core.sensing.faults.fault import Fault
from albot_core.sensing.faults.registry import (
    READING_FAULTS,
    check_needs,
    parse_faults,
    spec_of,
)
from albot_core.sensing.reading import Sensor
from albot_env.faults.world_faults import (
    DoorShut,
    FurnitureMoved,
    Kidnap,
    PersonInExit,
    Turned,
    WorldFault,
)

WORLD_FAULTS: Mapping[str, type[WorldFault]] = {
    each.name: each for each in (Kidnap, Turned, DoorShut, FurnitureMoved, PersonInExit)
}
"""The faults of the world by name."""
FAULTS: Mapping[str, type[Fault]] = {**READING_FAULTS, **WORLD_FAULTS}
"""All faults by name."""


def faults_text(specs: Any) -> str:
    """Return the specs of an environment's setting as one text, by which they can be made again.

    Raises:
        InputError: A fault is unknown or its parameters are not valid.
    """
    return spec_of(parse_faults(specs, FAULTS))


def choose_faults(
    specs: Any, sensors: Collection[Sensor], environment: str, *, movables: bool
) -> tuple[Fault, ...]:
    """Return the faults of an environment's setting, checked against the robot's sensors.

    Args:
        specs: The setting.
        sensors: The sensors that the robot carries besides the odometer.
        environment: Id of the environment, for errors.
        movables: Whether doors, boxes and people are simulated.

    Raises:
        InputError: A fault is unknown or its parameters are not valid; or it needs a sensor that
            the robot lacks, or something that can be moved.
    """
    faults = parse_faults(specs, FAULTS, f"{environment}, faults")
    there = {*sensors, "contact", "world"} | ({"movables"} if movables else set())
    check_needs(faults, there, "the robot", f"{environment}, faults")
    return faults
