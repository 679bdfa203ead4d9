"""Albot1 for many robots at once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Pose, Segments
from albot_core.kernels.arguments import ArgumentsCache
from albot_core.mappers.albot1.addresses import COLUMNS, MapperArrays, addresses_of
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.handle_events import RobotMemory, handle_events
from albot_core.mappers.albot1.perceptual_map.frames import compose_pose
from albot_core.mappers.albot1.perceptual_map.mapping import MAPPING_PROGRESS
from albot_core.mappers.albot1.perceptual_map.memory import (
    ALIVE,
    VISIT,
    clear_map,
    copy_view,
    empty_map,
    empty_view,
    living,
    room_left,
)
from albot_core.mappers.albot1.perceptual_map.odometer_error import unknown_odometer
from albot_core.mappers.albot1.perceptual_map.viewing import SECTORS, note_sectors
from albot_core.mappers.albot1.places.exits import empty_exits, expect_exits
from albot_core.mappers.albot1.places.matches import match_place
from albot_core.mappers.albot1.places.network import START, PlaceNetwork
from albot_core.mappers.albot1.places.wayfinding import way_lines, waypoint_home
from albot_core.mappers.albot1.resuming import resume_robot
from albot_core.mappers.albot1.state import (
    SCHEMA,
    STORED_ROWS,
    enlarged_map,
    rebuilt_arrays,
    stored_arrays,
)
from albot_core.mappers.albot1.step import BatchArrays, step_robots
from albot_core.mappers.albot1.trail.breadcrumbs import WAYPOINT_AHEAD
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, MapperSpec, PlaceMatches
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.schema import Arrays
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot, PlaceGraph, SegmentsLayer
from albot_core.sensing.reading import LaserGeometry, LaserScan, Readings
from albot_core.sensing.view import view_settings

WAY_UPDATE_DISTANCE = 0.2
"""The way home is updated each time the robot has moved this far (m)."""


class Albot1Batch:
    """Many robots with a perceptual map each, stepped by one compiled loop (a `MapperBatch`).

    A single `Albot1` is a batch of one. Threads may update disjoint rows at the same time: each
    robot has its own arrays, also while they are replaced by larger ones.

    Args:
        count: Number of robots.
        config: All thresholds; by default those of `albot1`.
        name: The name under which the mappers are registered.
    """

    recognises_places = True
    """Whether the mappers match readings: always true."""

    def __init__(
        self, count: int, config: Albot1Config | None = None, name: str = "albot1"
    ) -> None:
        self.spec: MapperSpec = mapper_spec(name)
        """The specification registered under the mappers' name."""
        self.config = config or Albot1Config()
        self._limits = self.config.limits
        self._arrays: list[MapperArrays] = []
        self._networks = [PlaceNetwork(self.config.places) for _ in range(count)]
        # The last snapshot of each network, and its version and place then.
        self._graphs: list[tuple[tuple[int, bytes], PlaceGraph] | None] = [None] * count
        self._homes_in_map = np.zeros((count, 3))
        self._matched_readings = np.full(count, -1)
        self._is_recognised = np.zeros(count, np.bool_)
        self._ways_home = np.full((count, 7), np.nan)
        self._next_exits = np.full((count, 4), np.nan)
        self._found_at = np.full((count, 2), np.inf)
        self._network_versions = np.zeros(count, np.int64)
        self._versions = [-1] * count
        self._expecting = [-1] * count
        self._robots = BatchArrays(
            table=np.zeros((count, COLUMNS), np.int64),
            progress=np.zeros(count, MAPPING_PROGRESS),
            odometers=np.tile(unknown_odometer(), (count, 1)),
            sectors=np.zeros((count, SECTORS)),
            since=np.zeros((count, 3)),
            poses=np.zeros((count, 3)),
            surfaces=np.zeros(count, np.int64),
            events=np.zeros(count, np.int64),
            readings=np.zeros(count, np.int64),
            crumb_poses=np.zeros((count, 3)),
            next_ids=np.zeros(count, np.int64),
            current=np.zeros(count, np.int64),
            map_to_graph=np.zeros((count, 3)),
            is_lost=np.zeros(count, np.bool_),
            compared_from=np.full((count, 3), np.nan),
        )
        for network in self._networks:
            parts = empty_map(), empty_view(), empty_exits()
            breadcrumbs = network.breadcrumbs
            self._arrays.append(MapperArrays(*parts, breadcrumbs.crumbs, breadcrumbs.tree.graph))
        for row in range(count):
            self._set_addresses(row)
        self._arguments_cache = ArgumentsCache(self._arguments)

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """The estimated pose of each robot (m, rad; its map's frame). Overwritten by updates."""
        return self._robots.poses

    @property
    def homes_in_map(self) -> Float64[np.ndarray, "robots 3"]:
        """The estimated pose of home in each robot's map frame. Overwritten by updates."""
        return self._homes_in_map

    @property
    def matched_readings(self) -> Int64[np.ndarray, "robots"]:
        """The earlier reading taken nearest to each robot in its present place; -1 in a new place.

        As of the last `match_readings`, or of the robot's last change of place. Overwritten.
        """
        return self._matched_readings

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Update `matched_readings` for the given rows."""
        for row in rows.tolist():
            if self._is_recognised[row]:
                matched = self._networks[row].match_reading(self.poses[row])
                self._matched_readings[row] = -1 if matched is None else matched

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """The number of changes of each robot's map: of its surfaces or its network of places."""
        return self.updates + self._network_versions

    @property
    def is_recognised(self) -> Bool[np.ndarray, "robots"]:
        """Whether each robot recognises its place. Overwritten by the next update."""
        return self._is_recognised

    @property
    def is_lost(self) -> Bool[np.ndarray, "robots"]:
        """Whether each robot is lost. Overwritten by the next update."""
        return self._robots.is_lost

    @property
    def ways_home(self) -> Float64[np.ndarray, "robots 7"]:
        """The believed way home of each robot, as of the last `find_ways`. Overwritten."""
        return self._ways_home

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Update the ways home of robots that have gone on, or whose network has changed.

        The next exit is searched only when the network changes, as it does at each exit crossed, so
        that within a place the robot does not turn round for another exit. There is no next exit
        where the path along the breadcrumbs says that home is near, even if the present place is
        taken for another than home.
        """
        gone = np.hypot(*(self._found_at[rows] - self.poses[rows, :2]).T) > WAY_UPDATE_DISTANCE
        for row, has_gone in zip(rows.tolist(), gone.tolist(), strict=True):
            network = self._networks[row]
            has_changed = self._versions[row] != network.version
            if not (has_gone or has_changed):
                continue
            pose, way, view = self.poses[row], self._ways_home[row], self._arrays[row].view
            if has_changed:
                self._versions[row] = network.version
                exits = way_lines(network, pose, START)
                self._next_exits[row] = exits[0] if len(exits) else np.nan
            self._found_at[row] = pose[:2]
            point, length = waypoint_home(network, pose, view.surfaces[: view.size[0]])
            way[POINT], way[TRAVEL] = point, length
            way[EXIT] = np.nan if length < WAYPOINT_AHEAD else self._next_exits[row]

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """The number of times each robot has laid a view over its map. Overwritten by updates."""
        return self._robots.progress["updates"]

    @property
    def segment_counts(self) -> Int64[np.ndarray, "robots"]:
        """The number of surfaces in each robot's map. Overwritten by updates."""
        return self._robots.surfaces

    @property
    def lost(self) -> Int64[np.ndarray, "robots"]:
        """The number of views at which no landmark was recognised and odometry stood in."""
        return self._robots.progress["unrecognized"]

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Forget all that one robot remembers. Draws no random number."""
        self._robots.readings[row] = 0
        pm, view, exits, _, _ = self._arrays[row]
        clear_map(pm)
        exits.counts[:], exits.crossing[:] = 0, 0
        self._networks[row] = PlaceNetwork(self.config.places, self._networks[row].breadcrumbs)
        self._forget_ways(row)
        view.size[0] = 0
        view.pose[:] = 0.0
        robots = self._robots
        for array in (
            robots.progress,
            robots.sectors,
            robots.since,
            robots.poses,
            robots.crumb_poses,
        ):
            array[row] = 0
        robots.odometers[row] = unknown_odometer()
        self._robots.surfaces[row] = 0

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Process the readings of the given rows; `readings` holds a row for every robot.

        Raises:
            InputError: The robots have no laser.
        """
        ranges, laser = readings.ranges, readings.laser
        if ranges is None or laser is None:
            raise InputError("Readings.laser", f"a laser, which {self.spec.name} needs", "none")
        self.follow(rows, ranges, readings.motions, laser)

    def follow(
        self,
        rows: Int64[np.ndarray, "some"],
        ranges: Float64[np.ndarray, "robots beams"],
        motions: Float64[np.ndarray, "robots 3"],
        laser: LaserGeometry,
    ) -> None:
        """Process readings as `update` does, given as the arrays that the map needs."""
        arguments = self._arguments_cache.arguments(laser)
        ranges = np.ascontiguousarray(ranges, np.float64)
        motions = np.ascontiguousarray(motions, np.float64)
        done = step_robots(rows, arguments, 0, ranges, motions)
        while done < len(rows):
            self._enlarge(int(rows[done]))
            done = step_robots(rows, arguments, done, ranges, motions)
        for row in rows[self._robots.events[rows] > 0].tolist():
            self._handle_events(row)

    def resume(self, row: int, pose: Pose, scan: LaserScan) -> None:
        """Continue one robot's map at a pose on it (see `resuming`)."""
        settings = view_settings(scan.geometry, self.config.view)
        while not self._has_room(row, len(scan.ranges)):
            self._enlarge_map(row)
        ranges = np.ascontiguousarray(scan.ranges, np.float64)
        self._networks[row].reading = max(int(self._robots.readings[row]) - 1, 0)
        resume_robot(self._robot(row), pose, ranges, settings, self._limits)
        robots = self._robots
        robots.since[row], robots.events[row] = 0.0, 0
        note_sectors(ranges, robots.sectors[row])
        robots.surfaces[row] = self._arrays[row].pm.counts[ALIVE]
        self._forget_ways(row)

    def network(self, row: int) -> PlaceNetwork:
        """Return one robot's network of places (not a copy)."""
        return self._networks[row]

    def exits(self, row: int) -> Segments:
        """Return the exits that one robot has seen and remembers, in its map's frame (a copy)."""
        exits = self._arrays[row].exits
        return exits.lines[: exits.counts[0]].copy()

    def begin_return(self, row: int) -> None:
        """Do nothing: the map is the same on the way out and on the way home."""

    def snapshot(self, row: int) -> MapSnapshot:
        """Return one robot's map: its surfaces and its network of places."""
        network = self._networks[row]
        kept, moment = self._graphs[row], (network.version, network.map_to_graph.tobytes())
        if kept is None or kept[0] != moment:
            kept = self._graphs[row] = moment, network.snapshot().place_graph
        return MapSnapshot(layers=(SegmentsLayer(segments=self.surfaces(row)), kept[1]))

    def activity(self, row: int) -> Activity | None:
        """Return None: there is no attractor network."""

    def place_matches(self, row: int, most: int) -> PlaceMatches:
        """Return the earlier stays in one robot's place, and how sure the network is of them."""
        view = self._arrays[row].view
        surfaces = view.surfaces[: view.size[0]]
        return match_place(self._networks[row], self.poses[row], surfaces, most)

    def surfaces(self, row: int) -> Segments:
        """Return the surfaces in one robot's map, in the map's frame (a copy)."""
        pm = self._arrays[row].pm
        alive = living(pm)
        return np.asarray(pm.surfaces[: len(alive)][alive])

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Return everything that one robot remembers, as arrays by name."""
        pm, view, exits, _, _ = self._arrays[row]
        rows = {name: self._stored_rows(field)[row] for name, field in STORED_ROWS.items()}
        return SCHEMA.arrays({**rows, **stored_arrays(pm, view, exits, self._networks[row])})

    def restore(self, row: int, state: Arrays) -> None:
        """Restore one robot's memory from what `state` returned.

        Raises:
            InputError: The arrays contradict each other.
        """
        SCHEMA.check(state)
        pm, view, exits, network = rebuilt_arrays(state, self.config.places)
        breadcrumbs = network.breadcrumbs
        arrays = MapperArrays(pm, view, exits, breadcrumbs.crumbs, breadcrumbs.tree.graph)
        self._arrays[row] = arrays
        self._networks[row] = network
        self._forget_ways(row)
        self._set_addresses(row)
        for name, field in STORED_ROWS.items():
            self._stored_rows(field)[row] = state[name]
        self._robots.surfaces[row] = pm.counts[ALIVE]
        compose_pose(view.pose, self._robots.since[row], self._robots.poses[row])
        self.match_readings(np.array([row]))

    def _stored_rows(self, field: str) -> np.ndarray:
        """Return a field of `BatchArrays`; of records a view, with a column for each number."""
        array: np.ndarray = getattr(self._robots, field)
        if array.dtype.names is None:
            return array
        return array.view(array.dtype[0]).reshape(len(array), -1)

    def kept_way(self, row: int) -> dict[str, np.ndarray]:
        """Return one robot's last way home and whether it is still current (see `find_ways`)."""
        return {
            "found_at": self._found_at[row].copy(),
            "next_exit": self._next_exits[row].copy(),
            "is_current": np.array(self._versions[row] == self._networks[row].version),
        }

    def restore_way(self, row: int, kept: Mapping[str, np.ndarray]) -> None:
        """Restore one robot's way home from what `kept_way` returned, after `restore`."""
        self._found_at[row] = kept["found_at"]
        self._next_exits[row] = kept["next_exit"]
        self._versions[row] = self._networks[row].version if kept["is_current"] else -1

    def _forget_ways(self, row: int) -> None:
        """Mark the way home as outdated, because the network was replaced."""
        self._graphs[row] = None
        self._versions[row] = self._expecting[row] = -1
        self._note_places(row)

    def _note_places(self, row: int) -> None:
        """Copy what the network says of home and the present place into the robot's rows."""
        network = self._networks[row]
        self._homes_in_map[row] = network.home
        matched = network.match_reading(self.poses[row])
        self._matched_readings[row] = -1 if matched is None else matched
        self._network_versions[row] = network.version
        self._is_recognised[row] = matched is not None
        robots = self._robots
        robots.current[row], robots.is_lost[row] = network.current, network.lost_since > 0
        robots.map_to_graph[row] = network.map_to_graph
        robots.compared_from[row] = network.compared_from
        if self.config.places.uses_expected_exits and self._expecting[row] != network.version:
            self._expecting[row] = network.version
            expect_exits(self._arrays[row].exits, network.predicted_exits)

    def _handle_events(self, row: int) -> None:
        """Handle the events of one robot's last reading."""
        self._networks[row].reading = int(self._robots.readings[row]) - 1
        robot, events = self._robot(row), int(self._robots.events[row])
        handle_events(robot, events, self._limits)
        self._robots.surfaces[row] = robot.pm.counts[ALIVE]
        self._note_places(row)

    def _robot(self, row: int) -> RobotMemory:
        robots, arrays = self._robots, self._arrays[row]
        return RobotMemory(
            pm=arrays.pm,
            view=arrays.view,
            exits=arrays.exits,
            network=self._networks[row],
            progress=robots.progress[row],
            pose=robots.poses[row],
            next_id=int(robots.next_ids[row]),
        )

    def _set_addresses(self, row: int) -> None:
        """Write the addresses of a robot's arrays into the table."""
        self._robots.table[row] = addresses_of(self._arrays[row])

    def _enlarge(self, row: int) -> None:
        """Double the capacity of one robot's breadcrumbs or, if these have room, map and view."""
        arrays, breadcrumbs = self._arrays[row], self._networks[row].breadcrumbs
        if not breadcrumbs.ensure_room():
            self._enlarge_map(row)
            return
        crumbs, graph = breadcrumbs.crumbs, breadcrumbs.tree.graph
        self._arrays[row] = arrays._replace(crumbs=crumbs, graph=graph)
        self._set_addresses(row)

    def _enlarge_map(self, row: int) -> None:
        """Double the capacity of one robot's map and view."""
        arrays = self._arrays[row]
        view = empty_view(2 * len(arrays.view.slots))
        copy_view(arrays.view, view)
        self._arrays[row] = arrays._replace(pm=enlarged_map(arrays.pm), view=view)
        self._set_addresses(row)

    def _has_room(self, row: int, beams: int) -> bool:
        """Return whether one robot's arrays have room for a view of any scan, and for a visit."""
        pm, view = self._arrays[row].pm, self._arrays[row].view
        visits = pm.counts[VISIT] + 2
        has_visits = visits < len(pm.reobserved)
        return bool(room_left(pm) >= 2 * beams and has_visits and len(view.slots) >= beams)

    def _arguments(self, laser: LaserGeometry) -> tuple[Any, ...]:
        """Return the arguments of `step_robots`."""
        return self._robots, view_settings(laser, self.config.view), self._limits
