"""The mapper: the interface of all mapping systems, and the capabilities of some."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose, Poses
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Reading, Readings, Sensor


@dataclass(frozen=True, kw_only=True)
class MapperSpec:
    """Description of a mapping system, known before a mapper is made."""

    name: str
    """Name in commands, files and results."""
    summary: str
    """What it does, in one line."""
    paper: str
    """Publication that describes it."""
    sensors: frozenset[Sensor]
    """Sensors that it needs besides the odometer."""
    layers: tuple[str, ...]
    """Kinds of layers of its maps (see `albot_core.maps.layers`)."""
    factory: str
    """`module:name` of what makes a mapper from a config; imported when first needed."""
    config: str
    """`module:name` of what makes its default config, a frozen dataclass."""
    has_exits: bool = False
    """Whether the connections of its place graph have doorways."""
    has_matches: bool = False
    """Whether it says how sure it is of the place that it recognises (`Recognition`)."""
    batch: str | None = None
    """`module:name` of what makes a batch from a number of robots and a config. None: the batch is
    a loop over single mappers."""
    extra: str | None = None
    """Extra of `albot-env` that installs its further dependencies; None if it has none."""
    modules: tuple[str, ...] = ()
    """Modules that it imports from that extra."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """What a mapper believes after its latest reading."""

    pose: Pose
    """The robot's pose in the map's frame."""
    home: Pose
    """The robot's start pose in the map's frame."""
    localised: bool = True
    """Whether it believes that the pose is right; False while it knows that it is lost."""
    place: int | None = None
    """Id of the present place; None if it knows no places."""
    matched_reading: int | None = None
    """Number of an earlier reading, counted from 0 since the reset, that it believes was taken at
    the present place on an earlier visit. None if it recognises nothing."""
    updates: int = 0
    """Number of times that it has added what it saw to its map."""
    map_version: int = 0
    """Number that grows with every change of the map, even if only known parts have moved."""
    segments: int = 0
    """Number of line segments in the map; 0 if its snapshots have no such layer."""

    @property
    def home_from_robot(self) -> Pose:
        """The robot's start pose in its present frame."""
        return relative(self.pose, self.home)


@runtime_checkable
class Mapper(Protocol):
    """A system that builds a map from readings.

    The map's frame is the robot's frame at the first reading after a reset. A mapper draws every
    random number from the generator given to `reset`; before the first reset, from a generator of
    seed 0.
    """

    @property
    def spec(self) -> MapperSpec:
        """The mapper's spec."""

    @property
    def config(self) -> Any:
        """All its parameters: a frozen dataclass."""

    @property
    def estimate(self) -> Estimate:
        """What it believes after the latest reading."""

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first."""

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether it was added to the map.

        The motion of the first reading after a reset is ignored: it leads to the place where the
        map begins.

        Raises:
            InputError: The reading lacks a sensor that the spec lists.
        """

    def snapshot(self) -> MapSnapshot:
        """Return the present map. Its arrays do not change when the mapper goes on."""

    def state(self) -> dict[str, np.ndarray]:
        """Return everything the mapper remembers, as arrays by name."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the mapper that returned `state`; the run continues as if never stopped."""


WayHome = Float64[np.ndarray, "7"]
"""A believed way home in the map's frame: `EXIT`, `POINT` and `TRAVEL`."""
EXIT = slice(0, 4)
"""The line across the next exit on the way, with the present place to its left. NaN if home is in
this place or near, or if no way through exits is known."""
POINT = slice(4, 6)
"""A point a little ahead on the way. NaN if home is nearer, or if no such point is known."""
TRAVEL = 6
"""Length of the travel on which the belief of where home is rests (m): along the remembered way, or
all that was driven if home is known by path integration alone. Infinite if the robot has lost its
way or knows none."""


@runtime_checkable
class RouteHome(Protocol):
    """A mapper that knows a way home, not only where home is."""

    @property
    def way_home(self) -> WayHome:
        """The believed way home from the present pose (see `WayHome`).

        The mapper may reuse it until the robot has moved on a little.
        """


@runtime_checkable
class PlaceMemory(Protocol):
    """A mapper that remembers and recognises places, and tells why."""

    @property
    def events(self) -> Sequence[object]:
        """What happened to its places and why, in order; `str` gives each as one line."""

    def place_at(self, reading: int) -> int:
        """Return the id of the place where a reading was taken, as believed now.

        Args:
            reading: The reading's number, counted from 0 since the reset.
        """


PlaceMatches = Float64[np.ndarray, "matches 6"]
"""Earlier readings that a mapper believes were taken at the present place, the best first. Columns:
score (how much of what is seen now was seen there, from 0 to 1), probability (that the two places
are one), ambiguity (the highest probability of another place), x, y (where the reading was taken,
as believed now: map's frame, m), and the reading's number."""


@runtime_checkable
class Recognition(Protocol):
    """A mapper that says how sure it is of the place that it recognises."""

    def place_matches(self, most: int) -> PlaceMatches:
        """Return the best matches of the present place, at most so many."""


@runtime_checkable
class ReturnAware(Protocol):
    """A mapper that maps the way home separately from the way out."""

    def begin_return(self) -> None:
        """Treat the travel so far as the way out, and what follows as the way home."""


@runtime_checkable
class CorrectedTrajectory(Protocol):
    """A mapper that corrects its earlier poses."""

    def corrected_poses(self) -> Poses:
        """Return the pose at every reading since the reset, as believed now, (readings, 3)."""


@runtime_checkable
class AttractorNetwork(Protocol):
    """A mapper that represents the robot's pose by the activity of an attractor network."""

    @property
    def activity(self) -> Activity:
        """The present activity; the same object until it changes."""


Capability = TypeVar("Capability")

_CAPABILITIES: dict[type, str] = {
    RouteHome: "a way home",
    PlaceMemory: "a memory of places",
    CorrectedTrajectory: "a corrected trajectory",
    AttractorNetwork: "an attractor network",
    Recognition: "evidence of the places that it recognises",
}


def require(mapper: Mapper, capability: type[Capability]) -> Capability:
    """Return the mapper as one with a capability, such as `RouteHome` or `PlaceMemory`.

    Raises:
        InputError: The mapper lacks the capability.
    """
    if not isinstance(mapper, capability):
        has = [what for kind, what in _CAPABILITIES.items() if isinstance(mapper, kind)]
        found = f"one with {', '.join(has)}" if has else "one without"
        expected = f"a mapper with {_CAPABILITIES[capability]}"
        raise InputError(f"mapper {mapper.spec.name}", expected, found)
    return mapper


@runtime_checkable
class MapperBatch(Protocol):
    """Mappers of one kind, one per robot, that process the readings of many robots at once.

    The mapper of a row gives the same result as a single one, to the last bit. Rows are
    independent: threads may update disjoint rows at the same time. Updates overwrite the arrays.
    """

    @property
    def spec(self) -> MapperSpec:
        """The mappers' spec."""

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """`Estimate.pose` of each; always the same array."""

    @property
    def homes_in_map(self) -> Float64[np.ndarray, "robots 3"]:
        """`Estimate.home` of each; always the same array."""

    @property
    def is_recognised(self) -> Bool[np.ndarray, "robots"]:
        """Whether each recognises its place; always the same array."""

    @property
    def is_lost(self) -> Bool[np.ndarray, "robots"]:
        """Whether each is lost; always the same array."""

    @property
    def matched_readings(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.matched_reading` of each, -1 for none; always the same array.

        The last update decides whether there is a matched reading; the last `match_readings`
        decides which one it is.
        """

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Bring `matched_readings` of some rows up to date."""

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.map_version` of each."""

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.updates` of each."""

    @property
    def segment_counts(self) -> Int64[np.ndarray, "robots"]:
        """Number of line segments in each map."""

    @property
    def recognises_places(self) -> bool:
        """Whether the mappers remember places (`PlaceMemory`), and so can match readings."""

    @property
    def ways_home(self) -> Float64[np.ndarray, "robots 7"]:
        """`RouteHome.way_home` of each, as of the last `find_ways`; always the same array.

        If the mappers know no way home, only `TRAVEL` is known.
        """

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the ways home of some rows."""

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Reset the mapper of a row."""

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Update the mappers of some rows with the readings of these rows."""

    def begin_return(self, row: int) -> None:
        """Tell the mapper of a row that the robot turns for home (see `ReturnAware`)."""

    def snapshot(self, row: int) -> MapSnapshot:
        """Return the map of a row."""

    def activity(self, row: int) -> Activity | None:
        """Return `AttractorNetwork.activity` of a row; None if the mappers have no network."""

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Return everything that a row's mapper remembers, as arrays by name (copies)."""

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Restore a row's mapper from what `state` returned."""


@runtime_checkable
class RecognitionBatch(Protocol):
    """A batch of mappers that say how sure they are of the places that they recognise."""

    def place_matches(self, row: int, most: int) -> PlaceMatches:
        """Return `Recognition.place_matches` of a row."""


@runtime_checkable
class KeptWays(Protocol):
    """A batch of mappers that use a way home for a while before they find another.

    `MapperBatch.restore` lets the way be found anew. These two let a run continue as if never
    stopped also in its ways home.
    """

    def kept_way(self, row: int) -> dict[str, np.ndarray]:
        """Return what a row's mapper remembers of the way that it found, besides the way itself."""

    def restore_way(self, row: int, kept: Mapping[str, np.ndarray]) -> None:
        """Restore, after `restore`, what `kept_way` returned."""
