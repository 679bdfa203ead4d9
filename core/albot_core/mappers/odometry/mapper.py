"""The map by odometry alone, against which the other mappers are held.

Each view is laid over the map by the plain transformation from the robot's frame to the
frame where it set out, with the pose that the odometer's steps add up to (Hossain, *How
Albot1 computes its perceptual map*, 2014, chapter 3). So the map shows what the odometer's
error does: a place seen twice is drawn twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, relative, transform_segments
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.mapper import WayHome
from albot_core.maps.place_graph import NOWHERE, Network
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view


@dataclass(frozen=True, kw_only=True)
class OdometryConfig:
    """How the odometry mapper keeps its map small."""

    view: ViewConfig = field(default_factory=ViewConfig)
    """How surfaces are found in a scan."""
    step: float = 0.20
    """A view is laid down once the robot has gone this far since the last (m)…"""
    turn: float = np.deg2rad(20.0)
    """…or has turned this far (rad)."""
    capacity: int = 50_000
    """Surfaces remembered; the oldest are forgotten first."""

    def __post_init__(self) -> None:
        for name, unit in (("step", "m"), ("turn", "rad")):
            value = getattr(self, name)
            if not 0 <= value < np.inf:
                raise InputError(f"OdometryConfig.{name}", f"0 or more ({unit})", str(value))
        if self.capacity < 1:
            raise InputError("OdometryConfig.capacity", "at least 1", str(self.capacity))


class OdometryMapper:
    """Path integration, with the views laid down where it leads."""

    def __init__(self, config: OdometryConfig | None = None) -> None:
        self.config = config or OdometryConfig()
        self.reset()

    @property
    def name(self) -> str:
        """The name under which `make_mapper` finds it."""
        return "odometry"

    @property
    def pose(self) -> Pose:
        """Where the odometer says that the robot is, in the map's frame."""
        return self._pose.copy()

    @property
    def surfaces(self) -> Segments:
        """The surfaces remembered, in the map's frame, oldest first."""
        return self._store[max(self._end - self.config.capacity, 0) : self._end].copy()

    @property
    def home(self) -> Pose:
        """Where home is by the odometer, in the robot's present frame."""
        return inverse(self._pose)

    @property
    def exits(self) -> Segments:
        """None: it knows no exits."""
        return np.empty((0, 4))

    @property
    def network(self) -> Network:
        """Empty: it knows no places."""
        return NOWHERE

    @property
    def events(self) -> tuple[object, ...]:
        """None: it knows no places."""
        return ()

    @property
    def way_home(self) -> WayHome:
        """No exit and no point ahead; its belief rests on all that it has driven."""
        return np.array((*6 * (np.nan,), self._driven))

    @property
    def is_lost(self) -> bool:
        """Never: it believes its odometer."""
        return False

    @property
    def updates(self) -> int:
        """How many views were laid down since the reset."""
        return self._updates

    def reset(self) -> None:
        """Forget everything; the next reading is the first."""
        self._pose = np.zeros(3)
        self._laid_at = np.zeros(3)
        self._driven = 0.0
        self._updates = 0
        self._store = np.empty((0, 4))
        self._end = 0

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where its view was laid down."""
        if self._updates:
            self._pose = compose(self._pose, reading.motion)
            self._driven += float(np.hypot(reading.motion[0], reading.motion[1]))
            if not self._has_moved_on():
                return False
        view = construct_view(reading.laser, self.config.view)
        self._remember(transform_segments(self._pose, view.surfaces))
        self._laid_at = self._pose
        self._updates += 1
        return True

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""
        return {
            "pose": self.pose,
            "laid_at": self._laid_at.copy(),
            "driven": np.array(self._driven),
            "updates": np.array(self._updates, np.int64),
            "surfaces": self.surfaces,
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`."""
        self._pose = state["pose"].copy()
        self._laid_at = state["laid_at"].copy()
        self._driven = float(state["driven"])
        self._updates = int(state["updates"])
        self._store = state["surfaces"].copy()
        self._end = len(self._store)

    def _has_moved_on(self) -> bool:
        """Whether the robot has gone or turned far enough to look again."""
        x, y, heading = relative(self._laid_at, self._pose)
        return bool(np.hypot(x, y) >= self.config.step or abs(heading) >= self.config.turn)

    def _remember(self, surfaces: Segments) -> None:
        """Append surfaces; where there is no room, move what is kept to a larger store.

        The store holds twice what is kept, so that each surface is moved once on average.
        """
        if self._end + len(surfaces) > len(self._store):
            kept = self.surfaces
            self._store = np.empty((2 * (len(kept) + len(surfaces)), 4))
            self._store[: len(kept)] = kept
            self._end = len(kept)
        self._store[self._end : self._end + len(surfaces)] = surfaces
        self._end += len(surfaces)
