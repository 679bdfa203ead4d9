"""The registry of all faults that environments know."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from albot_core.sensing.faults.fault import Fault
from albot_core.sensing.faults.registry import (
    READING_FAULTS,
    check_needs,
    parse_faults,
    spec_of,
)
from albot_env.sim.sensors import Sensors

FAULTS: Mapping[str, type[Fault]] = {**READING_FAULTS}
"""All faults by name."""


def faults_text(specs: Any) -> str:
    """Return the specs of an environment's setting as one text, by which they can be made again.

    Raises:
        InputError: A fault is unknown or its parameters are not valid.
    """
    return spec_of(parse_faults(specs, FAULTS))


def choose_faults(specs: Any, sensors: Sensors, environment: str) -> tuple[Fault, ...]:
    """Return the faults of an environment's setting, checked against the robot's sensors.

    Raises:
        InputError: A fault is unknown or its parameters are not valid; or it needs a sensor that
            the robot lacks.
    """
    faults = parse_faults(specs, FAULTS, f"{environment}, faults")
    there = {*sensors.available, "contact", "world"}
    check_needs(faults, there, "the robot", f"{environment}, faults")
    return faults
