"""The observation builder: fills in what robots observe, and keeps what they cover and enter."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt64

from albot_core.kernels.arguments import ArgumentsCache
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.world_cache import WorldCache
from albot_env.tasks.core.coverage import (
    empty_coverage,
    map_extent,
    with_coverage,
    words_of,
    world_centre,
    world_extent,
)
from albot_env.tasks.core.coverage_kernels import CoverageGrid
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_kernels import observe_robots
from albot_env.tasks.core.rooms import NO_ROOMS, Rooms, joined, outlines_of
from albot_env.tasks.core.state import BatchState, Progress
from albot_env.tasks.core.wayfinding import empty_occupancy, with_occupancy
from albot_env.tasks.core.wayfinding_kernels import OccupancyGrids
from albot_maps import World


class _WorldFacts(NamedTuple):
    """What the builder needs to know of a world."""

    rooms: tuple[int, int]
    """Where its rooms begin and end among all worlds'."""
    reachable: float
    """The ground that can be reached (m²)."""


class ProgressSnapshot(NamedTuple):
    """What a robot has covered and entered: see `CoverageGrid`, `Rooms` and `Progress`."""

    covered: UInt64[np.ndarray, "words"]
    believed: UInt64[np.ndarray, "words"]
    """No words where nothing is shown of it (see `ObservationConfig.shows_ground`)."""
    entered: Bool[np.ndarray, "most"]
    ground: int
    rooms_entered: int
    moved: Float64[np.ndarray, "2"]


class ObservationBuilder:
    """Makes the observations of robots, and tracks their coverage of their worlds.

    Args:
        robots: How many robots.
        config: How they observe, and which ground counts as covered.
        laser: Their laser.
    """

    def __init__(self, robots: int, config: ObservationConfig, laser: LaserGeometry) -> None:
        self._config = config.coverage
        self._scales, self._layout = config.scales, config.layout
        self._sensor = config.coverage.sensor(laser)
        self._covered = empty_coverage(robots, self._config.cell)
        self._believed = empty_coverage(robots, self._config.cell)
        self._has_ground = config.shows_ground
        self._wayfinding, self._has_occupancy = config.wayfinding, config.shows_ways_over_ground
        self._searching = config.wayfinding.occupancy(config.coverage), config.wayfinding.search
        self._occupancy = empty_occupancy(robots)
        self._worlds = WorldCache(robots, self._add_world, self._forget_rooms)
        self._rooms = Rooms(
            outlines=NO_ROOMS,
            worlds=np.zeros((robots, 2), np.int64),
            entered=np.zeros((robots, 0), np.bool_),
        )
        self._names = np.array([""], object)
        self.progress = Progress(
            ground=np.zeros(robots, np.int64),
            new_ground=np.zeros(robots, np.int64),
            room=np.full(robots, -1),
            new_room=np.zeros(robots, np.bool_),
            rooms_entered=np.zeros(robots, np.int64),
            moved=np.zeros((robots, 2)),
        )
        """What the robots have covered and entered."""
        self._arguments = ArgumentsCache(self._arrange)

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are in (robots,); empty between rooms."""
        room = self.progress.room
        names: np.ndarray = self._names[(room + self._rooms.worlds[:, 0] + 1) * (room >= 0)]
        return names

    def begin(self, row: int, world: World) -> float:
        """Let a robot begin anew in a world: nothing is covered or entered.

        Returns:
            The ground that it can reach there (m²).
        """
        reachable = 0.0
        for other, facts in self._worlds.enter(row, world):
            self._rooms.worlds[other] = facts.rooms
            reachable = facts.reachable if other == row else reachable
        most, entered = len(world.rooms), self._rooms.entered
        if entered.shape[1] < most:
            added = np.zeros((len(entered), most - entered.shape[1]), np.bool_)
            self._rooms = self._rooms._replace(entered=np.concatenate((entered, added), axis=1))
        self._rooms.entered[row] = False
        side = self._config.side(world_extent(world) + self._config.cell)
        self._covered = with_coverage(self._covered, row, side, world_centre(world))
        # Of a square without cells none is ever looked at.
        side = self._config.side(map_extent(world)) if self._has_ground else 0
        self._believed = with_coverage(self._believed, row, side, (0.0, 0.0))
        if self._has_occupancy:
            side = self._wayfinding.side(map_extent(world))
            self._occupancy = with_occupancy(self._occupancy, row, side)
        progress = self.progress
        progress.ground[row], progress.rooms_entered[row] = 0, 0
        progress.moved[row] = np.inf
        return reachable

    def snapshot(self, row: int) -> ProgressSnapshot:
        """What a robot has covered and entered so far (copies)."""
        progress = self.progress
        return ProgressSnapshot(
            covered=words_of(self._covered, row).copy(),
            believed=words_of(self._believed, row).copy(),
            entered=self._rooms.entered[row].copy(),
            ground=int(progress.ground[row]),
            rooms_entered=int(progress.rooms_entered[row]),
            moved=progress.moved[row].copy(),
        )

    def restore(self, row: int, snapshot: ProgressSnapshot) -> None:
        """Let a robot, which has begun, have covered and entered what another one in its world has.

        That one must have kept the ground that it believes covered where this one is to do so.
        Its occupancy grid is not taken over: this one begins an empty one.
        """
        words_of(self._covered, row)[:] = snapshot.covered
        if self._has_ground:
            words_of(self._believed, row)[:] = snapshot.believed
        rooms = min(len(snapshot.entered), self._rooms.entered.shape[1])
        self._rooms.entered[row, :rooms] = snapshot.entered[:rooms]
        progress = self.progress
        progress.ground[row] = snapshot.ground
        progress.rooms_entered[row] = snapshot.rooms_entered
        progress.moved[row] = snapshot.moved

    def _add_world(self, world: World) -> _WorldFacts:
        rooms = self._rooms
        first, added = len(rooms.outlines.spans), outlines_of(world.rooms)
        self._rooms = rooms._replace(outlines=joined(rooms.outlines, added))
        names = np.array([room.name for room in world.rooms], object)
        self._names = np.concatenate((self._names, names))
        return _WorldFacts((first, first + len(added.spans)), world.reachable_area)

    def _forget_rooms(self) -> None:
        self._rooms = self._rooms._replace(outlines=NO_ROOMS)
        self._names = self._names[:1]

    def observe(
        self,
        rows: Int64[np.ndarray, "some"],
        state: BatchState,
        observations: Float32[np.ndarray, "robots length"],
    ) -> None:
        """Track what some robots cover and enter, and fill in their rows of `observations`."""
        changing = self._covered, self._believed, self._rooms, state, self._occupancy
        arguments = self._arguments.arguments(*changing)
        observe_robots(rows, arguments, observations)

    def _arrange(
        self,
        covered: CoverageGrid,
        believed: CoverageGrid,
        rooms: Rooms,
        state: BatchState,
        occupancy: OccupancyGrids,
    ) -> tuple[Any, ...]:
        """The arguments of `observe_robots`."""
        scales = self._scales, self._layout
        ways = *self._searching, occupancy
        return self._sensor, covered, believed, rooms, *scales, state, self.progress, *ways
