"""The sensors of a robot: one configuration for each, chosen by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from albot_core.errors import InputError, did_you_mean
from albot_core.sensing.reading import LaserGeometry, Sensor, SonarGeometry
from albot_env.sim.compass import COMPASSES, CompassConfig
from albot_env.sim.laser import LASERS, LMS_200, LaserConfig
from albot_env.sim.odometer import ODOMETERS, OdometerConfig
from albot_env.sim.scenes import SCENES, SceneConfig
from albot_env.sim.sonar import SONARS, SonarConfig

NONE = "none"
"""Name that stands for a sensor that the robot does not carry."""

Config = TypeVar("Config")


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """The sensors of a robot."""

    laser: LaserConfig | None = LMS_200
    """Beams and errors of the laser; None without a laser."""
    odometer: OdometerConfig = ODOMETERS["pioneer"]
    """Errors of the odometer."""
    sonar: SonarConfig | None = None
    """Positions and errors of the sonars; None without sonars."""
    scenes: SceneConfig | None = None
    """Scene numbering and errors of the camera; None without a camera."""
    compass: CompassConfig | None = None
    """Errors of the compass; None without a compass."""

    @property
    def ground_laser(self) -> LaserConfig:
        """The laser that decides which ground is covered; an LMS-200 if the robot has no laser.

        Environments use it to measure coverage. A robot without a laser does not get its ranges.
        """
        return self.laser or LMS_200

    @property
    def geometries(self) -> tuple[LaserGeometry | None, SonarGeometry | None]:
        """Geometry of the laser and of the sonars; None for one that the robot does not carry."""
        return (
            None if self.laser is None else self.laser.geometry,
            None if self.sonar is None else self.sonar.geometry,
        )

    @property
    def available(self) -> frozenset[Sensor]:
        """Sensors that the robot carries besides the odometer."""
        sensors: set[Sensor] = set()
        if self.laser is not None:
            sensors.add("laser")
        if self.sonar is not None:
            sensors.add("sonar")
        if self.scenes is not None:
            sensors.add("scene")
        if self.compass is not None:
            sensors.add("compass")
        return frozenset(sensors)


def choose_sensors(
    *,
    laser: str = "lms-200",
    odometer: str = "pioneer",
    sonar: str = "pioneer",
    scenes: str = NONE,
    compass: str = NONE,
    source: str = "sensors",
) -> Sensors:
    """Return the sensors with these names.

    Args:
        laser: One of `LASERS`, or `none`.
        odometer: One of `ODOMETERS`.
        sonar: One of `SONARS`, or `none`.
        scenes: One of `SCENES`, or `none`.
        compass: One of `COMPASSES`, or `none`.
        source: Name of the caller, for the error message.

    Raises:
        InputError: A name is unknown; the message lists the known names and suggests one.
    """
    return Sensors(
        laser=None if laser == NONE else _chosen(LASERS, laser, source, "laser", NONE),
        odometer=_chosen(ODOMETERS, odometer, source, "odometer"),
        sonar=None if sonar == NONE else _chosen(SONARS, sonar, source, "sonar", NONE),
        scenes=None if scenes == NONE else _chosen(SCENES, scenes, source, "scenes", NONE),
        compass=None if compass == NONE else _chosen(COMPASSES, compass, source, "compass", NONE),
    )


def _chosen(
    presets: Mapping[str, Config], name: str, source: str, place: str, *others: str
) -> Config:
    """Return the preset of this name; raise InputError if it is unknown."""
    if isinstance(name, str) and name in presets:
        return presets[name]
    names = [*others, *presets]
    found = f"{name!r}{did_you_mean(name, names)}"
    raise InputError(source, f"one of {', '.join(names)}", found, place=place)
