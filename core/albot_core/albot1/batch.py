"""Albot1 in many robots at once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.albot1.config import Albot1Config
from albot_core.albot1.following import Lens, Robots, follow
from albot_core.albot1.mapping import LOST, UPDATES
from albot_core.albot1.memory import (
    ALIVE,
    Memory,
    empty_memory,
    enlarged,
    forget,
    living,
    rebuilt_memory,
    stored_memory,
)
from albot_core.albot1.recognition import moved
from albot_core.albot1.sight import (
    Sight,
    copy_sight,
    empty_sight,
    rebuilt_sight,
    stored_sight,
)
from albot_core.albot1.storage import PLACES, places_of
from albot_core.errors import InputError
from albot_core.geometry.types import Segments
from albot_core.perception.reading import LaserGeometry, Readings


class Albot1Batch:
    """Many robots with a perceptual map each, led by one compiled loop (a `MapperBatch`).

    A single `Albot1` is a batch of one. Threads may update disjoint rows at the same time:
    a robot's arrays are its own, also while they are exchanged for larger ones.

    Args:
        count: How many robots.
        config: All thresholds; the defaults are the thesis's.
    """

    def __init__(self, count: int, config: Albot1Config | None = None) -> None:
        self.config = config or Albot1Config()
        self._limits = self.config.limits
        self._arrays: list[tuple[Memory, Sight]] = []
        self._robots = Robots(
            places=np.zeros((count, PLACES), np.int64),
            progress=np.zeros((count, 4), np.int64),
            since=np.zeros((count, 3)),
            poses=np.zeros((count, 3)),
            surfaces=np.zeros(count, np.int64),
        )
        for row in range(count):
            self._arrays.append((empty_memory(), empty_sight()))
            self._settle(row)
        self._lens: tuple[LaserGeometry, Lens] | None = None

    @classmethod
    def default(cls, count: int) -> Albot1Batch:
        """As `Albot1.default`."""
        return cls(count, Albot1Config.improved())

    @classmethod
    def thesis(cls, count: int) -> Albot1Batch:
        """As `Albot1.thesis`."""
        return cls(count)

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where each robot believes to be, in its map's frame. Written over by updates."""
        return self._robots.poses

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """How often each has laid a view over its map. Written over by updates."""
        return self._robots.progress[:, UPDATES]

    @property
    def surface_counts(self) -> Int64[np.ndarray, "robots"]:
        """How many surfaces each remembers. Written over by updates."""
        return self._robots.surfaces

    @property
    def lost(self) -> Int64[np.ndarray, "robots"]:
        """At how many views no landmark was recognised and path integration stood in."""
        return self._robots.progress[:, LOST]

    def reset(self, row: int) -> None:
        """Let one forget everything."""
        memory, sight = self._arrays[row]
        forget(memory)
        sight.size[0] = 0
        sight.pose[:] = 0.0
        for array in (self._robots.progress, self._robots.since, self._robots.poses):
            array[row] = 0
        self._robots.surfaces[row] = 0

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Let some take in their readings, which stand in the same rows."""
        self.follow(rows, readings.ranges, readings.motions, readings.laser)

    def follow(
        self,
        rows: Int64[np.ndarray, "some"],
        ranges: Float64[np.ndarray, "robots beams"],
        motions: Float64[np.ndarray, "robots 3"],
        laser: LaserGeometry,
    ) -> None:
        """`update` with the arrays of readings that matter to the map."""
        lens, limits = self._lens_for(laser), self._limits
        ranges, motions = np.ascontiguousarray(ranges), np.ascontiguousarray(motions)
        done = follow(self._robots, rows, 0, ranges, motions, lens, limits)
        while done < len(rows):
            self._enlarge(int(rows[done]))
            done = follow(self._robots, rows, done, ranges, motions, lens, limits)

    def surfaces(self, row: int) -> Segments:
        """The surfaces that one remembers, in its map's frame (a copy)."""
        memory, _ = self._arrays[row]
        alive = living(memory)
        return np.asarray(memory.surfaces[: len(alive)][alive])

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Everything that one remembers, as arrays by name."""
        memory, sight = self._arrays[row]
        state = {"progress": self._robots.progress[row].copy()}
        state["since"] = self._robots.since[row].copy()
        state |= {f"memory.{name}": array for name, array in stored_memory(memory).items()}
        return state | {f"view.{name}": array for name, array in stored_sight(sight).items()}

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Let one become the one that returned `state`.

        Raises:
            InputError: The arrays contradict each other.
        """
        memory = rebuilt_memory(_part(state, "memory."))
        sight = rebuilt_sight(_part(state, "view."), len(state["memory.ids"]))
        progress, since = state["progress"], state["since"]
        if progress.shape != (4,) or (progress < 0).any():
            raise InputError("progress", "4 counts", str(progress.tolist()))
        if since.shape != (3,) or not np.isfinite(since).all():
            raise InputError("since", "three finite numbers", str(since.tolist()))
        self._arrays[row] = memory, sight
        self._settle(row)
        self._robots.progress[row], self._robots.since[row] = progress, since
        self._robots.surfaces[row] = memory.counts[ALIVE]
        moved(sight.pose, self._robots.since[row], self._robots.poses[row])

    def _settle(self, row: int) -> None:
        """Tell the kernel where a robot's arrays are."""
        self._robots.places[row] = places_of(*self._arrays[row])

    def _enlarge(self, row: int) -> None:
        """Give one twice the room."""
        memory, old = self._arrays[row]
        sight = empty_sight(2 * len(old.slots))
        copy_sight(old, sight)
        self._arrays[row] = enlarged(memory), sight
        self._settle(row)

    def _lens_for(self, laser: LaserGeometry) -> Lens:
        """What views are constructed with from this laser's scans."""
        kept = self._lens
        if kept is not None and kept[0] is laser:
            return kept[1]
        view = self.config.view
        lens = Lens(
            directions=laser.directions,
            mount=(float(laser.mount[0]), float(laser.mount[1])),
            max_range=float(min(laser.max_range, view.max_range)),
            thresholds=view.thresholds,
            fit_lines=view.fit_lines,
        )
        self._lens = (laser, lens)
        return lens


def _part(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """The arrays whose names begin with a prefix, without it."""
    return {
        name.removeprefix(prefix): array for name, array in state.items() if name.startswith(prefix)
    }
