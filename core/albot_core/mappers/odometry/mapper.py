"""The map by odometry alone: the baseline of the other mappers.

Each view is transformed from the robot's frame to the frame of its start, by the sum of the
odometer's motions (Hossain, *How Albot1 computes its perceptual map*, 2014, chapter 3). So the map
shows the effect of the odometer's error: a place seen twice is drawn twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_segments
from albot_core.geometry.types import Segments
from albot_core.mappers.mapper import Estimate, MapperSpec
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.stored_arrays import Shape, check_finite, check_lengths, check_shapes
from albot_core.maps.layers import MapSnapshot, SegmentsLayer
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, check_fields
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """When the odometry mapper adds views, and how many surfaces it keeps."""

    view: ViewConfig = field(default_factory=ViewConfig)
    """How surfaces are found in a scan."""
    step: float = 0.20
    """Distance from the last added view at which a new one is added (m)."""
    turn: float = np.deg2rad(20.0)
    """Turn since the last added view at which a new one is added (rad)."""
    capacity: int = 50_000
    """Largest number of surfaces in the map; the oldest are dropped first."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "step", "turn")
        check_fields(self, FROM_ONE, "capacity")


_SHAPES: dict[str, Shape] = {
    "pose": (3,),
    "laid_at": (3,),
    "updates": (),
    "surfaces": ("surfaces", 4),
}
"""The arrays of a state."""


class OdometryMapper:
    """Path integration; views are added to the map at the integrated pose.

    Args:
        config: When views are added, and how many surfaces are kept.
        name: The name under which the mapper is registered.
    """

    def __init__(self, config: OdometryConfig | None = None, name: str = "odometry") -> None:
        self._name = name
        self.config = config or OdometryConfig()
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """The mapper's spec, found by its name."""
        return mapper_spec(self._name)

    @property
    def estimate(self) -> Estimate:
        """The robot's pose by odometry; home is where the odometer began."""
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3),
            updates=self._updates,
            map_version=self._updates,
            segments=min(self._end, self.config.capacity),
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._pose = np.zeros(3)
        self._laid_at = np.zeros(3)
        self._updates = 0
        self._store = np.empty((0, 4))
        self._end = 0

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether its view was added to the map.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        laser = reading.required_laser(self._name)
        if self._updates:
            self._pose = compose(self._pose, reading.motion)
            if not self._has_moved_on():
                return False
        view = construct_view(laser, self.config.view)
        self._remember(transform_segments(self._pose, view.surfaces))
        self._laid_at = self._pose
        self._updates += 1
        return True

    def snapshot(self) -> MapSnapshot:
        """Return the remembered surfaces, oldest first."""
        # Stored surfaces are never overwritten, so no copy is made.
        kept = self._store[max(self._end - self.config.capacity, 0) : self._end]
        kept.flags.writeable = False
        return MapSnapshot(layers=(SegmentsLayer(segments=kept),))

    def state(self) -> dict[str, np.ndarray]:
        """Return everything the mapper remembers, as arrays by name."""
        return {
            "pose": self._pose.copy(),
            "laid_at": self._laid_at.copy(),
            "updates": np.array(self._updates, np.int64),
            "surfaces": self.snapshot().segments.copy(),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the mapper that returned `state`.

        Raises:
            InputError: The arrays are not a state of this mapper.
        """
        check_shapes(state, _SHAPES)
        check_finite(state, "pose", "laid_at", "surfaces")
        check_lengths("surfaces", state["surfaces"])
        if state["updates"] < 0:
            raise InputError("updates", "a count", str(state["updates"]))
        self._pose = state["pose"].copy()
        self._laid_at = state["laid_at"].copy()
        self._updates = int(state["updates"])
        self._store = state["surfaces"].copy()
        self._end = len(self._store)

    def _has_moved_on(self) -> bool:
        """Return whether the robot has moved or turned far enough for a new view."""
        x, y, heading = relative(self._laid_at, self._pose)
        return bool(np.hypot(x, y) >= self.config.step or abs(heading) >= self.config.turn)

    def _remember(self, surfaces: Segments) -> None:
        """Append surfaces; if there is no room, move the kept ones to a larger store.

        The new store has twice the room that is needed, so that on average each surface is moved
        once.
        """
        if self._end + len(surfaces) > len(self._store):
            kept = self.snapshot().segments
            self._store = np.empty((2 * (len(kept) + len(surfaces)), 4))
            self._store[: len(kept)] = kept
            self._end = len(kept)
        self._store[self._end : self._end + len(surfaces)] = surfaces
        self._end += len(surfaces)
