"""The mapper: what all mapping systems offer, and how they are found, saved and restored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Segments
from albot_core.maps.place_graph import Network
from albot_core.sensing.reading import Reading, Readings

WayHome = Float64[np.ndarray, "7"]
"""A believed way home, in the map's frame: `EXIT`, `POINT` and `TRAVEL`."""
EXIT = slice(0, 4)
"""The line across the next exit on the way, the present place to its left; NaN where home is in
this place or at hand, or where no way through exits is known."""
POINT = slice(4, 6)
"""A point a little ahead on the way; NaN where home is nearer, or where none is known."""
TRAVEL = 6
"""Length of the travel that the belief of where home is rests on (m): along the way remembered,
or all that was driven where home is known by path integration alone; infinite where the
robot has lost its way or knows none."""


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
    def exits(self) -> Segments:
        """The lines across the exits seen and remembered, in the map's frame, if any."""

    @property
    def network(self) -> Network:
        """The places remembered and the exits between them; empty where it knows no places."""

    @property
    def events(self) -> Sequence[object]:
        """What happened to the network and why, in order; each is told as one line."""

    @property
    def way_home(self) -> WayHome:
        """The way home that it believes in, as seen from where it is now (see `WayHome`).

        It may be kept for a little way, until the robot has moved on.
        """

    @property
    def is_lost(self) -> bool:
        """Whether it knows that the robot is not where it believed, and not yet where it is."""

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


@runtime_checkable
class MapperBatch(Protocol):
    """Mappers of one kind, one a robot, that take in the readings of many at once.

    What the mapper of a row does is to the last bit what a single one does. Rows do not
    touch each other: threads may update disjoint rows at the same time.
    """

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """Where each robot believes to be, in its map's frame: one array, written over."""

    @property
    def homes(self) -> Float64[np.ndarray, "robots 3"]:
        """Where home is believed to be, in each one's map's frame: written over."""

    @property
    def ways_home(self) -> Float64[np.ndarray, "robots 7"]:
        """The way home that each believes in, as of the last `find_ways`: written over."""

    @property
    def places(self) -> Bool[np.ndarray, "robots 2"]:
        """Whether each is in a place that it knows from before; whether it has lost its way.

        Written over (see `Network.familiar` and `Mapper.is_lost`).
        """

    @property
    def current_places(self) -> Int64[np.ndarray, "robots"]:
        """The id of the place that each believes to be in; -1 where it knows no places.

        Written over (see `Network.current`).
        """

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the ways home of some."""

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """How often each has added a view to its map since its reset."""

    @property
    def surface_counts(self) -> Int64[np.ndarray, "robots"]:
        """How many surfaces each remembers."""

    def reset(self, row: int) -> None:
        """Let one forget everything."""

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Let some take in their readings, which stand in the same rows."""

    def surfaces(self, row: int) -> Segments:
        """The surfaces that one remembers, in its map's frame (a copy)."""

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Everything that one remembers, as arrays by name (copies)."""

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Let one become the one that returned `state`."""


class LoopedMappers:
    """A batch of mappers that know nothing of batches: one after the other.

    Args:
        mappers: The mappers, one a robot.
    """

    def __init__(self, mappers: Sequence[Mapper]) -> None:
        self._mappers = tuple(mappers)
        self.poses = np.zeros((len(self._mappers), 3))
        self.homes = np.zeros((len(self._mappers), 3))
        self.ways_home = np.full((len(self._mappers), 7), np.nan)
        self.places = np.zeros((len(self._mappers), 2), np.bool_)
        self.current_places = np.full(len(self._mappers), -1)
        self.updates = np.zeros(len(self._mappers), np.int64)
        self.surface_counts = np.zeros(len(self._mappers), np.int64)

    def reset(self, row: int) -> None:
        """Let one forget everything."""
        self._mappers[row].reset()
        self._note(row)

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Let some take in their readings, which stand in the same rows."""
        for row in rows.tolist():
            if self._mappers[row].update(readings[row]):
                self._note(row)
            self._place(row)

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the ways home of some."""
        for row in rows.tolist():
            self.ways_home[row] = self._mappers[row].way_home

    def surfaces(self, row: int) -> Segments:
        """The surfaces that one remembers, in its map's frame."""
        return self._mappers[row].surfaces.copy()

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Everything that one remembers, as arrays by name."""
        return self._mappers[row].state()

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Let one become the one that returned `state`."""
        self._mappers[row].restore(state)
        self._note(row)

    def _note(self, row: int) -> None:
        mapper = self._mappers[row]
        self._place(row)
        self.updates[row] = mapper.updates
        self.surface_counts[row] = len(mapper.surfaces)

    def _place(self, row: int) -> None:
        mapper = self._mappers[row]
        self.poses[row] = mapper.pose
        self.homes[row] = compose(mapper.pose, mapper.home)
        network = mapper.network
        self.places[row] = network.familiar, mapper.is_lost
        self.current_places[row] = -1 if network.current is None else network.current
