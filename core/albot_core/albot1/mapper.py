"""Albot1 as a mapper."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.albot1.config import Albot1Config
from albot_core.albot1.mapping import LOST, UPDATES, map_step
from albot_core.albot1.memory import STORED, empty_memory, rebuilt_memory, with_room
from albot_core.albot1.sight import Sight, empty_sight, rebuilt_sight
from albot_core.geometry.poses import inverse
from albot_core.geometry.types import Pose, Segments
from albot_core.perception.reading import LaserGeometry, Reading


class Albot1:
    """Albot1's perceptual map (Hossain 2014, algorithms 1 to 4).

    The robot remembers a view as the local environment that it is about to explore, follows
    the landmarks in it, and just before the last of them go out of sight locates itself by
    them and lays the view that it then has over its map. What the view covers is forgotten.

    Args:
        config: All thresholds; the defaults are the thesis's.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: Albot1Config | None = None, name: str = "albot1-thesis") -> None:
        self.config = config or Albot1Config()
        self._name = name
        self._limits = self.config.limits
        self._view_thresholds = self.config.view.thresholds
        self.reset()

    @classmethod
    def default(cls) -> Albot1:
        """`albot1`: the thesis's process with our recognition and localisation."""
        return cls(Albot1Config.improved(), "albot1")

    @classmethod
    def thesis(cls) -> Albot1:
        """`albot1-thesis`: the thesis to the letter."""
        return cls()

    def reset(self) -> None:
        """Forget everything; the next reading is the first."""
        self._memory = empty_memory()
        self._previous = empty_sight(0)
        self._current = empty_sight(0)
        self._progress = np.zeros(4, np.int64)

    def update(self, reading: Reading) -> bool:
        """Take in a reading (algorithm 4); true where a view was laid over the map."""
        geometry = reading.laser.geometry
        if len(self._current.surfaces) < geometry.beams:
            self._widen(geometry)
        # A step lays two views at most.
        self._memory = with_room(self._memory, 2 * geometry.beams)
        self._previous, self._current = self._current, self._previous
        before = self._progress[UPDATES]
        map_step(
            self._memory,
            self._previous,
            self._current,
            reading.laser.ranges,
            geometry.directions,
            geometry.mount[:2],
            min(geometry.max_range, self.config.view.max_range),
            self._view_thresholds,
            self.config.view.fit_lines,
            reading.motion,
            self._limits,
            self._progress,
        )
        return bool(self._progress[UPDATES] > before)

    def _widen(self, geometry: LaserGeometry) -> None:
        """Make room for the views of a laser with more beams than any before."""
        sights = []
        for old in (self._previous, self._current):
            new = empty_sight(geometry.beams)
            for larger, smaller in zip(new[:4], old[:4], strict=True):
                larger[: len(smaller)] = smaller
            new.size[:] = old.size
            new.pose[:] = old.pose
            sights.append(new)
        self._previous, self._current = sights

    @property
    def name(self) -> str:
        """The name under which `make_mapper` finds it."""
        return self._name

    @property
    def pose(self) -> Pose:
        """Where the robot believes to be, in the map's frame."""
        return self._current.pose.copy()

    @property
    def surfaces(self) -> Segments:
        """The surfaces of the perceptual map, in the map's frame (m)."""
        return self._memory.surfaces[self._memory.ids >= 0]

    @property
    def home(self) -> Pose:
        """Where home is believed to be, in the robot's present frame."""
        return inverse(self._current.pose)

    @property
    def updates(self) -> int:
        """How often a view was laid over the map."""
        return int(self._progress[UPDATES])

    @property
    def lost(self) -> int:
        """At how many readings no landmark was recognised and path integration stood in."""
        return int(self._progress[LOST])

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""
        state = {"progress": self._progress.copy()}
        state |= {f"memory.{field}": getattr(self._memory, field).copy() for field in STORED}
        for part, sight in (("previous", self._previous), ("current", self._current)):
            state |= {f"{part}.{field}": a.copy() for field, a in sight._asdict().items()}
        return state

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`.

        Raises:
            InputError: The arrays contradict each other.
        """
        memory = rebuilt_memory({field: state[f"memory.{field}"] for field in STORED})
        previous, current = (
            rebuilt_sight(
                {field: state[f"{part}.{field}"] for field in Sight._fields}, len(memory.ids)
            )
            for part in ("previous", "current")
        )
        self._memory, self._previous, self._current = memory, previous, current
        self._progress = state["progress"].copy()
