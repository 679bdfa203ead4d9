"""The mapper: what all mapping systems offer, and how they are found, saved and restored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np

from albot_core.geometry.types import Pose, Segments
from albot_core.perception.reading import Reading


@runtime_checkable
class Mapper(Protocol):
    """A system that builds a map from readings.

    The map's frame is the robot's frame at the first reading after a reset, so home,
    where the robot set out, is the map's origin. State lives in plain arrays: what
    `state` returns and `restore` takes is all there is.
    """

    @property
    def name(self) -> str:
        """The name under which `make_mapper` finds it."""

    @property
    def pose(self) -> Pose:
        """Where the robot believes to be, in the map's frame."""

    @property
    def surfaces(self) -> Segments:
        """The surfaces remembered, in the map's frame."""

    @property
    def home(self) -> Pose:
        """Where home is believed to be, in the robot's present frame."""

    @property
    def updates(self) -> int:
        """How often a view was added to the map since the reset."""

    def reset(self) -> None:
        """Forget everything; the next reading is the first."""

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where a view was added to the map.

        The motion of the first reading after a reset is ignored: it says how the robot
        came to the place where the map begins.
        """

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`; the run continues as if never stopped."""
