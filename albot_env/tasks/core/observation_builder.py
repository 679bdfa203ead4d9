"""The survey: what robots cover and enter, and what they observe."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt64

from albot_core.kernels.arguments import ArgumentsCache
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.world_cache import WorldCache
from albot_env.tasks.core.coverage import (
    laid,
    map_extent,
    no_ground,
    words_of,
    world_centre,
    world_extent,
)
from albot_env.tasks.core.coverage_kernels import Ground
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.observation_kernels import survey
from albot_env.tasks.core.rooms import NO_ROOMS, Rooms, joined, outlines_of
from albot_env.tasks.core.state import Findings, Senses
from albot_env.tasks.core.wayfinding import laid_sketch, no_sketches
from albot_env.tasks.core.wayfinding_kernels import Sketches
from albot_maps import World


class _Plot(NamedTuple):
    """What the survey needs to know of a world."""

    rooms: tuple[int, int]
    """Where its rooms begin and end among all worlds'."""
    reachable: float
    """The ground that can be reached (m²)."""


class Surveyed(NamedTuple):
    """What a robot has found out: see `Ground`, `Rooms` and `Findings`."""

    covered: UInt64[np.ndarray, "words"]
    believed: UInt64[np.ndarray, "words"]
    """No words where nothing is shown of it (see `ObservationConfig.shows_ground`)."""
    entered: Bool[np.ndarray, "most"]
    ground: int
    rooms_entered: int
    moved: Float64[np.ndarray, "2"]


class Survey:
    """Follows robots in their worlds.

    Args:
        robots: How many robots.
        config: How they observe, and which ground counts as covered.
        laser: Their laser.
    """

    def __init__(self, robots: int, config: ObservationConfig, laser: LaserGeometry) -> None:
        self._config = config.coverage
        self._scales, self._layout = config.scales, config.layout
        self._sight = config.coverage.sight(laser)
        self._covered = no_ground(robots, self._config.cell)
        self._believed = no_ground(robots, self._config.cell)
        self._has_ground = config.shows_ground
        self._wayfinding, self._has_sketches = config.wayfinding, config.shows_ways_over_ground
        self._finding = config.wayfinding.pencil(config.coverage), config.wayfinding.search
        self._sketches = no_sketches(robots)
        self._plots = WorldCache(robots, self._plot, self._forget_rooms)
        self._rooms = Rooms(
            outlines=NO_ROOMS,
            worlds=np.zeros((robots, 2), np.int64),
            entered=np.zeros((robots, 0), np.bool_),
        )
        self._names = np.array([""], object)
        self.findings = Findings(
            ground=np.zeros(robots, np.int64),
            new_ground=np.zeros(robots, np.int64),
            room=np.full(robots, -1),
            new_room=np.zeros(robots, np.bool_),
            rooms_entered=np.zeros(robots, np.int64),
            moved=np.zeros((robots, 2)),
        )
        """What was found out at the last look."""
        self._surveying = ArgumentsCache(self._plans)

    @property
    def rooms(self) -> np.ndarray:
        """Names of the rooms that the robots are in (robots,); empty between rooms."""
        room = self.findings.room
        names: np.ndarray = self._names[(room + self._rooms.worlds[:, 0] + 1) * (room >= 0)]
        return names

    def begin(self, row: int, world: World) -> float:
        """Let a robot begin anew in a world: nothing is covered or entered.

        Returns:
            The ground that it can reach there (m²).
        """
        reachable = 0.0
        for other, plot in self._plots.enter(row, world):
            self._rooms.worlds[other] = plot.rooms
            reachable = plot.reachable if other == row else reachable
        most, entered = len(world.rooms), self._rooms.entered
        if entered.shape[1] < most:
            added = np.zeros((len(entered), most - entered.shape[1]), np.bool_)
            self._rooms = self._rooms._replace(entered=np.concatenate((entered, added), axis=1))
        self._rooms.entered[row] = False
        side = self._config.side(world_extent(world) + self._config.cell)
        self._covered = laid(self._covered, row, side, world_centre(world))
        # Of a square without cells none is ever looked at.
        side = self._config.side(map_extent(world)) if self._has_ground else 0
        self._believed = laid(self._believed, row, side, (0.0, 0.0))
        if self._has_sketches:
            side = self._wayfinding.side(map_extent(world))
            self._sketches = laid_sketch(self._sketches, row, side)
        findings = self.findings
        findings.ground[row], findings.rooms_entered[row] = 0, 0
        findings.moved[row] = np.inf
        return reachable

    def keep(self, row: int) -> Surveyed:
        """What a robot has found out so far (copies)."""
        findings = self.findings
        return Surveyed(
            covered=words_of(self._covered, row).copy(),
            believed=words_of(self._believed, row).copy(),
            entered=self._rooms.entered[row].copy(),
            ground=int(findings.ground[row]),
            rooms_entered=int(findings.rooms_entered[row]),
            moved=findings.moved[row].copy(),
        )

    def resume(self, row: int, surveyed: Surveyed) -> None:
        """Let a robot, which has begun, know what another one in its world has found out.

        That one must have kept the ground that it believes covered where this one is to do so.
        Its sketch of the ground is not taken over: it begins an empty one.
        """
        words_of(self._covered, row)[:] = surveyed.covered
        if self._has_ground:
            words_of(self._believed, row)[:] = surveyed.believed
        rooms = min(len(surveyed.entered), self._rooms.entered.shape[1])
        self._rooms.entered[row, :rooms] = surveyed.entered[:rooms]
        findings = self.findings
        findings.ground[row] = surveyed.ground
        findings.rooms_entered[row] = surveyed.rooms_entered
        findings.moved[row] = surveyed.moved

    def _plot(self, world: World) -> _Plot:
        rooms = self._rooms
        first, added = len(rooms.outlines.spans), outlines_of(world.rooms)
        self._rooms = rooms._replace(outlines=joined(rooms.outlines, added))
        names = np.array([room.name for room in world.rooms], object)
        self._names = np.concatenate((self._names, names))
        return _Plot((first, first + len(added.spans)), world.reachable_area)

    def _forget_rooms(self) -> None:
        self._rooms = self._rooms._replace(outlines=NO_ROOMS)
        self._names = self._names[:1]

    def look(
        self,
        rows: Int64[np.ndarray, "some"],
        senses: Senses,
        observations: Float32[np.ndarray, "robots length"],
    ) -> None:
        """Note what robots find out by their readings, and fill in what they observe."""
        changing = self._covered, self._believed, self._rooms, senses, self._sketches
        arguments = self._surveying.arguments(*changing)
        survey(rows, arguments, observations)

    def _plans(
        self,
        covered: Ground,
        believed: Ground,
        rooms: Rooms,
        senses: Senses,
        sketches: Sketches,
    ) -> tuple[Any, ...]:
        """What the survey takes."""
        observing = self._scales, self._layout
        finding = *self._finding, sketches
        return self._sight, covered, believed, rooms, *observing, senses, self.findings, *finding
