"""The observation builder: fills in observations and tracks coverage and rooms entered."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt64

from albot_core.geometry.types import Points
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
from albot_env.tasks.core.map_arrays import MapArrays, MapReader, MapSource
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_kernels import observe_robots
from albot_env.tasks.core.obstacle_kernels import (
    ObstacleMemory,
    empty_obstacles,
    forget_obstacles,
    recall_obstacles,
)
from albot_env.tasks.core.parts.matches import MATCHES
from albot_env.tasks.core.parts.part import Need
from albot_env.tasks.core.parts.truth import TrueMaps
from albot_env.tasks.core.rooms import NO_ROOMS, Rooms, joined, outlines_of
from albot_env.tasks.core.row_arrays import Arrays, copied_rows, put_rows
from albot_env.tasks.core.state import BatchState, ExplorationProgress
from albot_env.tasks.core.wayfinding import empty_occupancy, with_occupancy
from albot_env.tasks.core.wayfinding_kernels import OccupancyGrids
from albot_maps import World

_KEPT_OF_OCCUPANCY = (
    "ages", "moved", "beliefs", "shortcuts", "onwards", "paths", "drawn", "barred",
)  # fmt: skip
"""The arrays of `OccupancyGrids` in a state, besides the grid itself."""
_KEPT_OF_OBSTACLES = ("poses", "travelled", "moved")
"""The arrays of `ObstacleMemory` in a state, besides the points themselves."""


class _WorldFacts(NamedTuple):
    """Facts about a world that the builder needs."""

    rooms: tuple[int, int]
    """Where its rooms begin and end among the rooms of all worlds."""
    reachable: float
    """Area of the reachable ground (m²)."""


class ProgressSnapshot(NamedTuple):
    """Ground covered and rooms entered by a robot.

    See `CoverageGrid`, `Rooms` and `ExplorationProgress`.
    """

    covered: UInt64[np.ndarray, "words"]
    believed: UInt64[np.ndarray, "words"]
    """Empty if no observed part needs it (`Need.GROUND`)."""
    entered: Bool[np.ndarray, "most"]
    ground: int
    rooms_entered: int
    moved: Float64[np.ndarray, "2"]
    trail: Points
    """Positions that it remembers, as believed; empty if no observed part needs them."""
    readings: int
    """Number of readings that its mapper has had; 0 if no observed part needs it."""
    true_trail: Points
    """Positions where it truly was (world frame); empty if the truth is not revealed."""


class ObservationBuilder:
    """Builds the observations of robots and tracks their coverage of their worlds.

    Args:
        robots: Number of robots.
        config: Configuration of observations and coverage.
        laser: Geometry of the robots' laser.
        robot_radius: Radius of the robots (m).
        mappers: The robots' mappers; None without.
    """

    def __init__(
        self,
        robots: int,
        config: ObservationConfig,
        laser: LaserGeometry,
        robot_radius: float,
        mappers: MapSource | None,
    ) -> None:
        self._config = config.coverage
        self._scales, self._layout = config.scales, config.layout
        self._sensor = config.coverage.sensor(laser)
        self._covered = empty_coverage(robots, self._config.cell)
        self._believed = empty_coverage(robots, self._config.cell)
        self._has_ground, self._has_occupancy = map(config.needs, (Need.GROUND, Need.OCCUPANCY))
        self._wayfinding = ways = config.wayfinding
        self._searching = ways.occupancy(config.coverage), ways.search(robot_radius)
        self._occupancy = empty_occupancy(robots)
        self._has_map = config.needs(Need.MAP)
        spec = None if mappers is None else mappers.spec
        reads_maps = self._has_map and config.reads_maps(spec)
        self._maps = MapReader(
            robots,
            mappers,
            config.map_patch.trail,
            reads_maps=reads_maps,
            matches=config.matches if config.observes(MATCHES) else 0,
        )
        patch = config.map_patch
        shows_patch = self._has_map or config.needs(Need.TRUTH)
        remembers = shows_patch and "obstacles" in patch.shown
        length = patch.obstacle_memory if remembers else 0.0
        self._obstacles = empty_obstacles(robots, length, patch.obstacle_range)
        self._true_maps = TrueMaps(robots) if config.needs(Need.TRUTH) else None
        self._truth = MapReader(
            robots, self._true_maps, config.map_patch.trail, reads_maps=self._true_maps is not None
        )
        self._worlds = WorldCache(robots, self._add_world, self._forget_rooms)
        self._rooms = Rooms(
            outlines=NO_ROOMS,
            worlds=np.zeros((robots, 2), np.int64),
            entered=np.zeros((robots, 0), np.bool_),
        )
        self._names = np.array([""], object)
        self.progress = ExplorationProgress(
            ground=np.zeros(robots, np.int64),
            new_ground=np.zeros(robots, np.int64),
            room=np.full(robots, -1),
            new_room=np.zeros(robots, np.bool_),
            rooms_entered=np.zeros(robots, np.int64),
            moved=np.zeros((robots, 2)),
        )
        """Ground covered and rooms entered by the robots."""
        self._arguments = ArgumentsCache(self._arrange)

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are in (robots,); empty between rooms."""
        room = self.progress.room
        names: np.ndarray = self._names[(room + self._rooms.worlds[:, 0] + 1) * (room >= 0)]
        return names

    def begin(self, row: int, world: World) -> float:
        """Start a new episode for a robot in a world: nothing is covered or entered.

        Returns:
            The area of the ground that the robot can reach (m²).
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
        # A grid without cells is never accessed.
        side = self._config.side(map_extent(world)) if self._has_ground else 0
        self._believed = with_coverage(self._believed, row, side, (0.0, 0.0))
        if self._has_occupancy:
            side = self._wayfinding.side(map_extent(world))
            self._occupancy = with_occupancy(self._occupancy, row, side)
        self._maps.begin(row, map_extent(world))
        self._truth.begin(row, map_extent(world))
        forget_obstacles(self._obstacles, row)
        if self._true_maps is not None:
            self._true_maps.begin(row, world)
        progress = self.progress
        progress.ground[row], progress.rooms_entered[row] = 0, 0
        progress.moved[row] = np.inf
        return reachable

    def change_world(self, row: int, world: World) -> None:
        """Show a robot that observes the truth its world after a change, in mid-episode."""
        if self._true_maps is not None:
            self._true_maps.begin(row, world)

    def snapshot(self, row: int) -> ProgressSnapshot:
        """Return the ground covered and rooms entered by a robot so far (copies)."""
        progress = self.progress
        return ProgressSnapshot(
            covered=words_of(self._covered, row).copy(),
            believed=words_of(self._believed, row).copy(),
            entered=self._rooms.entered[row].copy(),
            ground=int(progress.ground[row]),
            rooms_entered=int(progress.rooms_entered[row]),
            moved=progress.moved[row].copy(),
            trail=self._maps.trail(row),
            readings=int(self._maps.arrays.readings[row]) + 1,
            true_trail=self._truth.trail(row),
        )

    def restore(self, row: int, snapshot: ProgressSnapshot) -> None:
        """Give a robot, after `begin`, the ground covered and rooms entered of a snapshot.

        The snapshot must be from the same world, and must hold the ground believed covered if this
        robot needs it. The occupancy grid and the obstacles seen lately are not restored: they
        begin empty.
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
        if self._has_map:
            self._maps.set_trail(row, snapshot.trail, snapshot.readings)
        if self._true_maps is not None:
            self._truth.set_trail(row, snapshot.true_trail, 0)

    def state(self, row: int) -> Arrays:
        """Return all that the observations of a robot depend on besides its readings (copies)."""
        occupancy = self._occupancy
        cells = int(occupancy.sides[row]) ** 2
        return {
            "coverage.covered": words_of(self._covered, row).copy(),
            "coverage.believed": words_of(self._believed, row).copy(),
            "rooms.entered": self._rooms.entered[row, : self._room_count(row)].copy(),
            **copied_rows("progress", self.progress, row),
            **copied_rows("occupancy", occupancy, row, _KEPT_OF_OCCUPANCY),
            "occupancy.grids": occupancy.grids[row, :cells].copy(),
            **self._maps.state(row),
            "truth.trail": self._truth.trail(row),
            **self._obstacle_state(row),
        }

    def _obstacle_state(self, row: int) -> Arrays:
        """Return what a robot remembers of obstacles; nothing if that is not observed."""
        memory = self._obstacles
        if not memory.side:
            return {}
        points = memory.points[row, : memory.counts[row]].copy()
        return {
            **copied_rows("obstacles", memory, row, _KEPT_OF_OBSTACLES),
            "obstacles.points": points,
        }

    def set_state(self, row: int, state: Arrays) -> None:
        """Give a robot what `state` returned, after `begin` in the same world.

        Its mapper must have got its own state before.
        """
        words_of(self._covered, row)[:] = state["coverage.covered"]
        words_of(self._believed, row)[:] = state["coverage.believed"]
        self._rooms.entered[row, : self._room_count(row)] = state["rooms.entered"]
        put_rows("progress", self.progress, row, state)
        put_rows("occupancy", self._occupancy, row, state)
        self._maps.set_state(row, state)
        self._truth.set_trail(row, state["truth.trail"], 0)
        if self._obstacles.side:
            put_rows("obstacles", self._obstacles, row, state)
            recall_obstacles(self._obstacles, row, state["obstacles.points"])

    def _room_count(self, row: int) -> int:
        first, last = self._rooms.worlds[row].tolist()
        return int(last - first)

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
        arrived: int | Int64[np.ndarray, "some"] = 1,
    ) -> None:
        """Track the coverage and rooms of some robots, and fill their rows of `observations`.

        Args:
            rows: The robots.
            state: Poses, beliefs and readings of all robots.
            observations: The observations of all robots.
            arrived: Number of readings that have arrived at each of `rows`.
        """
        if self._has_map:
            self._maps.update(rows, state.beliefs, arrived)
        if self._true_maps is not None:
            self._truth.update(rows, state.poses)
        maps = self._maps.arrays, self._truth.arrays
        seen = self._occupancy, *maps, self._obstacles
        changing = self._covered, self._believed, self._rooms, state, *seen
        arguments = self._arguments.arguments(*changing)
        observe_robots(rows, arguments, observations)

    def _arrange(
        self,
        covered: CoverageGrid,
        believed: CoverageGrid,
        rooms: Rooms,
        state: BatchState,
        occupancy: OccupancyGrids,
        maps: MapArrays,
        truth: MapArrays,
        obstacles: ObstacleMemory,
    ) -> tuple[Any, ...]:
        """Return the arguments of `observe_robots`."""
        scales = self._scales, self._layout
        ways = *self._searching, occupancy, maps, truth, obstacles
        return self._sensor, covered, believed, rooms, *scales, state, self.progress, *ways
