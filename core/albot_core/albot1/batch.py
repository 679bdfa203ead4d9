"""Albot1 in many robots at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.albot1.config import Albot1Config, Limits
from albot_core.albot1.entering import enter
from albot_core.albot1.exits import (
    GATE,
    Exits,
    leave_exits,
    no_exits,
    rebuilt_exits,
    stored_exits,
)
from albot_core.albot1.following import ASTRAY, CROSSED, SUSPECTED, TROD, Lens, Robots, follow
from albot_core.albot1.mapping import LOST, STEP, STRANGE, UPDATED_AT, UPDATES
from albot_core.albot1.memory import (
    ALIVE,
    USED,
    VISIT,
    Memory,
    arouse_from,
    begin_visit,
    empty_memory,
    enlarged,
    forget,
    living,
    move_visits,
    rebuilt_memory,
    room_left,
    seen_in_visit,
    stored_memory,
    suspect_still,
)
from albot_core.albot1.network import START, PlaceNetwork
from albot_core.albot1.network_state import rebuilt_network, stored_network
from albot_core.albot1.places import turned_round
from albot_core.albot1.recognition import moved
from albot_core.albot1.sight import (
    Sight,
    copy_sight,
    empty_sight,
    rebuilt_sight,
    stored_sight,
)
from albot_core.albot1.storage import COLUMNS, addresses_of
from albot_core.albot1.structure import joined
from albot_core.albot1.treading import follow_home, tread
from albot_core.albot1.updating import update_map
from albot_core.albot1.wayfinding import way_lines
from albot_core.errors import InputError
from albot_core.geometry.poses import transform_segments
from albot_core.geometry.types import Segments
from albot_core.mapper import EXIT, POINT, TRAVEL
from albot_core.parcel import Packer
from albot_core.perception.reading import LaserGeometry, Readings

AFRESH = 0.2
"""The way home is found anew after so much way (m)."""


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
        self._arrays: list[tuple[Memory, Sight, Exits]] = []
        self._networks = [PlaceNetwork(self.config.places) for _ in range(count)]
        self._homes = np.zeros((count, 3))
        self._places = np.zeros((count, 2), np.bool_)
        self._ways_home = np.full((count, 7), np.nan)
        self._found_at = np.full((count, 2), np.inf)
        self._versions = np.full(count, -1)
        self._robots = Robots(
            table=np.zeros((count, COLUMNS), np.int64),
            progress=np.zeros((count, 5), np.int64),
            since=np.zeros((count, 3)),
            poses=np.zeros((count, 3)),
            surfaces=np.zeros(count, np.int64),
            events=np.zeros(count, np.int64),
            trod=np.zeros((count, 3)),
            next_ids=np.zeros(count, np.int64),
        )
        for row in range(count):
            self._arrays.append((empty_memory(), empty_sight(), no_exits()))
            self._settle(row)
        self._following = Packer(lambda laser: (self._robots, self._lens(laser), self._limits))

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
    def homes(self) -> Float64[np.ndarray, "robots 3"]:
        """Where home is believed to be, in each one's map's frame. Written over by updates."""
        return self._homes

    @property
    def places(self) -> Bool[np.ndarray, "robots 2"]:
        """Whether each knows its place from before; has lost its way. Written over."""
        return self._places

    @property
    def ways_home(self) -> Float64[np.ndarray, "robots 7"]:
        """The way home that each believes in, as of the last `find_ways`. Written over."""
        return self._ways_home

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the way home of those that have gone on (AFRESH), or whose network has changed.

        The next exit is that of when the network last changed, as it does with each exit
        crossed: within a place the way does not turn round for another exit.
        """
        for row in rows.tolist():
            network, pose, way = self._networks[row], self.poses[row], self._ways_home[row]
            if self._versions[row] != network.version:
                self._versions[row] = network.version
                exits = way_lines(network, pose, START)
                way[EXIT] = exits[0] if len(exits) else np.nan
                self._found_at[row] = np.inf
            if np.hypot(*(self._found_at[row] - pose[:2])) > AFRESH:
                self._found_at[row] = pose[:2]
                sight = self._arrays[row][1]
                ahead = follow_home(network, pose, sight.surfaces[: sight.size[0]])
                way[POINT], way[TRAVEL] = ahead.point, ahead.length

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
        memory, sight, exits = self._arrays[row]
        forget(memory)
        exits.counts[:], exits.gate[:] = 0, 0
        self._networks[row] = PlaceNetwork(self.config.places)
        self._forget_ways(row)
        sight.size[0] = 0
        sight.pose[:] = 0.0
        robots = self._robots
        for array in (robots.progress, robots.since, robots.poses, robots.trod):
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
        parcel = self._following.parcel(laser)
        ranges, motions = np.ascontiguousarray(ranges), np.ascontiguousarray(motions)
        done = follow(rows, 0, parcel, ranges, motions)
        while done < len(rows):
            self._enlarge(int(rows[done]))
            done = follow(rows, done, parcel, ranges, motions)
        for row in rows[self._robots.events[rows] > 0].tolist():
            self._attend(row)

    def network(self, row: int) -> PlaceNetwork:
        """The network of places that one remembers (not a copy)."""
        return self._networks[row]

    def exits(self, row: int) -> Segments:
        """The exits that one has seen and remembers, in its map's frame (a copy)."""
        exits = self._arrays[row][2]
        return exits.lines[: exits.counts[0]].copy()

    def surfaces(self, row: int) -> Segments:
        """The surfaces that one remembers, in its map's frame (a copy)."""
        memory = self._arrays[row][0]
        alive = living(memory)
        return np.asarray(memory.surfaces[: len(alive)][alive])

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Everything that one remembers, as arrays by name."""
        memory, sight, exits = self._arrays[row]
        state = {"progress": self._robots.progress[row].copy()}
        state["since"] = self._robots.since[row].copy()
        state["trod"] = self._robots.trod[row].copy()
        network = stored_network(self._networks[row])
        state |= {f"places.{name}": array for name, array in network.items()}
        state |= {f"exits.{name}": array for name, array in stored_exits(exits).items()}
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
        if progress.shape != (5,) or (progress < 0).any():
            raise InputError("progress", "5 counts", str(progress.tolist()))
        if since.shape != (3,) or not np.isfinite(since).all():
            raise InputError("since", "three finite numbers", str(since.tolist()))
        exits = rebuilt_exits(_part(state, "exits."))
        network = rebuilt_network(_part(state, "places."), self.config.places)
        if len(network.visits) != memory.counts[VISIT] + 1:
            expected = f"the map's {memory.counts[VISIT]} visits"
            raise InputError("places.visits", expected, str(len(network.visits) - 1))
        if state["trod"].shape != (3,) or not np.isfinite(state["trod"]).all():
            raise InputError("trod", "three finite numbers", str(state["trod"].tolist()))
        self._arrays[row] = memory, sight, exits
        self._networks[row] = network
        self._forget_ways(row)
        self._settle(row)
        self._robots.progress[row], self._robots.since[row] = progress, since
        self._robots.trod[row] = state["trod"]
        self._robots.surfaces[row] = memory.counts[ALIVE]
        moved(sight.pose, self._robots.since[row], self._robots.poses[row])

    def _forget_ways(self, row: int) -> None:
        """Another network: the way home must be found anew."""
        self._versions[row] = -1
        self._stand(row)

    def _stand(self, row: int) -> None:
        """Note what the network says of home and of the present place."""
        network = self._networks[row]
        self._homes[row] = network.home
        self._places[row] = network.is_familiar, network.lost_since > 0

    def _attend(self, row: int) -> None:
        """See to what happened to one at its last reading (chapter 4)."""
        events, network = self._robots.events[row], self._networks[row]
        if events & ASTRAY:
            self._lose(row)
        elif events & CROSSED:
            self._cross(row)
        elif self._arrays[row][2].counts[1] == GATE:
            pass  # between two places there is no telling which it is in
        elif network.lost_since:
            self._find(row)
        elif events & SUSPECTED:
            self._suspect(row)
        if events & TROD:
            sight = self._arrays[row][1]
            tread(network, self._robots.poses[row], sight.surfaces[: sight.size[0]])
            if events == TROD:
                return
        self._stand(row)

    def _cross(self, row: int) -> None:
        """One has crossed an exit: remember the place left, and enter the next."""
        memory, sight, exits = self._arrays[row]
        gate = exits.gate
        line = gate[:4] if gate[4] > 0 else turned_round(gate[:4])
        step = int(self._robots.progress[row, STEP])
        self._networks[row].remember_place(step, line, seen_in_visit(memory), sight.pose)
        leave_exits(exits, *sight.pose[:2])
        self._begin_visit(row, enter)

    def _begin_visit(self, row: int, take_in: Callable[[Memory, Sight, Limits], None]) -> None:
        """Begin a visit, and take the present view into the map as its first."""
        memory, sight, _ = self._arrays[row]
        if memory.counts[VISIT] + 2 >= len(memory.met) or room_left(memory) < sight.size[0]:
            self._enlarge(row)
            memory, sight, _ = self._arrays[row]
        begin_visit(memory, self._networks[row].suspicions())
        take_in(memory, sight, self._limits)
        progress = self._robots.progress[row]
        progress[UPDATED_AT] = progress[STEP] - 1
        progress[UPDATES] += 1
        progress[STRANGE] = 0
        self._robots.surfaces[row] = memory.counts[ALIVE]

    def _suspect(self, row: int) -> None:
        """One has met again many surfaces of an earlier visit: is it there?"""
        memory, sight, _ = self._arrays[row]
        network, step = self._networks[row], int(self._robots.progress[row, STEP])
        met = memory.met[: len(network.visits), 0]
        suspect_still(memory, memory.met[: len(network.visits), 1])
        if network.recognize_place(step, met, self._before_it(row), sight.pose):
            arouse_from(memory, network.suspicions())

    def _before_it(self, row: int) -> Segments:
        """The surfaces that one has seen in its present visit, those in view among them."""
        memory, sight, _ = self._arrays[row]
        view = transform_segments(sight.pose, sight.surfaces[: sight.size[0]])
        return joined(seen_in_visit(memory), view, self.config.places.alike)

    def _lose(self, row: int) -> None:
        """One sees nothing of what should be there: it was moved."""
        memory, sight, exits = self._arrays[row]
        exits.counts[:] = 0
        before = memory.ids[: memory.counts[USED]] < self._robots.next_ids[row]
        present = memory.marks[: memory.counts[USED]] == memory.counts[VISIT]
        alive = living(memory)
        seen = memory.surfaces[: memory.counts[USED]][before & present & alive]
        self._networks[row].lose(int(self._robots.progress[row, STEP]), seen, sight.pose)
        self._begin_visit(row, update_map)

    def _find(self, row: int) -> None:
        """One that has lost its way looks where it may be."""
        memory, sight, exits = self._arrays[row]
        network, step = self._networks[row], int(self._robots.progress[row, STEP])
        first = network.lost_since
        motion = network.find(step, self._before_it(row), sight.pose)
        if motion is None:
            return
        move_visits(memory, first, motion)
        moved(motion, sight.pose.copy(), sight.pose)
        self._robots.poses[row] = sight.pose
        exits.counts[:] = 0
        arouse_from(memory, network.suspicions())

    def _settle(self, row: int) -> None:
        """Tell the kernel where a robot's arrays are."""
        self._robots.table[row] = addresses_of(*self._arrays[row])

    def _enlarge(self, row: int) -> None:
        """Give one twice the room."""
        memory, old, exits = self._arrays[row]
        sight = empty_sight(2 * len(old.slots))
        copy_sight(old, sight)
        self._arrays[row] = enlarged(memory), sight, exits
        self._settle(row)

    def _lens(self, laser: LaserGeometry) -> Lens:
        """What views are constructed with from this laser's scans."""
        view = self.config.view
        return Lens(
            directions=laser.directions,
            mount=(float(laser.mount[0]), float(laser.mount[1])),
            max_range=float(min(laser.max_range, view.max_range)),
            thresholds=view.thresholds,
            fit_lines=view.fit_lines,
        )


def _part(state: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """The arrays whose names begin with a prefix, without it."""
    return {
        name.removeprefix(prefix): array for name, array in state.items() if name.startswith(prefix)
    }
