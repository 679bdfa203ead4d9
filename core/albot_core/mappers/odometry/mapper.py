"""The map by odometry alone, of a single robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.mappers.mapper import Estimate, MapperSpec
from albot_core.mappers.odometry.batch import OdometryBatch, OdometryConfig
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Reading, Readings

_ITSELF = np.zeros(1, np.int64)
"""The rows of a batch of one."""


class OdometryMapper:
    """Path integration; views are added to the map at the integrated pose.

    Args:
        config: When views are added, and how many surfaces are kept.
        name: The name under which the mapper is registered.
    """

    def __init__(self, config: OdometryConfig | None = None, name: str = "odometry") -> None:
        self._name = name
        self._robot = OdometryBatch(1, config, name)

    @property
    def spec(self) -> MapperSpec:
        """The mapper's spec, found by its name."""
        return self._robot.spec

    @property
    def config(self) -> OdometryConfig:
        """When views are added, and how many surfaces are kept."""
        return self._robot.config

    @property
    def estimate(self) -> Estimate:
        """The robot's pose by odometry; home is where the odometer began."""
        updates = int(self._robot.updates[0])
        return Estimate(
            pose=self._robot.poses[0].copy(),
            home=np.zeros(3),
            updates=updates,
            map_version=updates,
            segments=int(self._robot.segment_counts[0]),
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._robot.reset(0, rng)

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its view was added to the map.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        laser, before = reading.required_laser(self._name), int(self._robot.updates[0])
        readings = Readings(
            stamps=np.array([reading.stamp]),
            motions=reading.motion[np.newaxis],
            laser=laser.geometry,
            ranges=laser.ranges[np.newaxis],
        )
        self._robot.update(_ITSELF, readings)
        return int(self._robot.updates[0]) > before

    def snapshot(self) -> MapSnapshot:
        """Return the remembered surfaces, oldest first."""
        return self._robot.snapshot(0)

    def state(self) -> dict[str, np.ndarray]:
        """Return everything the mapper remembers, as arrays by name."""
        return self._robot.state(0)

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the mapper that returned `state`.

        Raises:
            InputError: The arrays are not a state of this mapper.
        """
        self._robot.restore(0, state)
