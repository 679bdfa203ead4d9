"""The mapper: what every mapping system offers, and what some offer more."""

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
    """What is known of a mapping system before one is made."""

    name: str
    """The name in commands, files and results."""
    summary: str
    """What it does, in one line."""
    paper: str
    """Where it is described."""
    sensors: frozenset[Sensor]
    """The sensors without which it does not work, besides the odometer."""
    layers: tuple[str, ...]
    """The kinds of layers that its maps have (see `albot_core.maps.layers`)."""
    factory: str
    """What makes one from a config, `module:name`, imported when it is first needed."""
    config: str
    """What makes its default config, a frozen dataclass, `module:name`."""
    batch: str | None = None
    """What makes a batch from a count of robots and a config, `module:name`; None where nothing
    does, and the mappers of many robots are looped over."""
    extra: str | None = None
    """The extra of `albot-env` that brings what it needs besides; None where it needs nothing…"""
    modules: tuple[str, ...] = ()
    """…and the modules that it then imports."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """What a mapper believes after its latest reading."""

    pose: Pose
    """Where the robot is, in the map's frame."""
    home: Pose
    """Where the robot set out, in the map's frame."""
    localised: bool = True
    """Whether it believes that the pose is right; false while it knows that it is lost."""
    place: int | None = None
    """Id of the present place; None where it knows no places."""
    matched_reading: int | None = None
    """The earlier reading, counted from 0 since the reset, that it believes was taken at the
    present place on an earlier visit: "I have been here". None where it recognises nothing."""
    updates: int = 0
    """How often it has added what it saw to its map."""
    map_version: int = 0
    """Grows with every change of the map, also where only what was remembered has moved."""

    @property
    def home_from_robot(self) -> Pose:
        """Where the robot set out, in the robot's present frame."""
        return relative(self.pose, self.home)


@runtime_checkable
class Mapper(Protocol):
    """A system that builds a map from readings.

    The map's frame is the robot's frame at the first reading after a reset. A mapper draws every
    random number from the generator given to `reset`, or from one made of seed 0 before the first.
    """

    @property
    def spec(self) -> MapperSpec:
        """What is known of it by its name."""

    @property
    def config(self) -> Any:
        """All its thresholds: a frozen dataclass."""

    @property
    def estimate(self) -> Estimate:
        """What it believes after the latest reading."""

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first."""

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where it was added to the map.

        The motion of the first reading after a reset is ignored: it says how the robot came to
        the place where the map begins.

        Raises:
            InputError: The reading lacks a sensor that the spec names.
        """

    def snapshot(self) -> MapSnapshot:
        """The map as it is now. Its arrays stay as they are while the mapper goes on."""

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`; the run continues as if never stopped."""


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
class RouteHome(Protocol):
    """A mapper that knows a way home, not only where home is."""

    @property
    def way_home(self) -> WayHome:
        """The way home that it believes in, from where it is now (see `WayHome`).

        It may be kept for a little way, until the robot has moved on.
        """


@runtime_checkable
class PlaceMemory(Protocol):
    """A mapper that remembers places, recognises them, and says why."""

    @property
    def events(self) -> Sequence[object]:
        """What happened to its places and why, in order; each is told as one line."""

    def place_at(self, reading: int) -> int:
        """Id of the place where a reading was taken, as it believes now.

        Args:
            reading: The reading's number, counted from 0 since the reset.
        """


@runtime_checkable
class ReturnAware(Protocol):
    """A mapper that maps the way home apart from the way out."""

    def begin_return(self) -> None:
        """Take what was driven so far for the way out, and what follows for the way home."""


@runtime_checkable
class CorrectedTrajectory(Protocol):
    """A mapper that corrects its earlier poses."""

    def corrected_poses(self) -> Poses:
        """The robot's pose at every reading since the reset, as believed now, (readings, 3)."""


@runtime_checkable
class AttractorNetwork(Protocol):
    """A mapper that believes where the robot is by the activity of an attractor network."""

    @property
    def activity(self) -> Activity:
        """The activity as it is now: the same object until it changes."""


Capability = TypeVar("Capability")

_CAPABILITIES: dict[type, str] = {
    RouteHome: "a way home",
    PlaceMemory: "a memory of places",
    CorrectedTrajectory: "a corrected trajectory",
    AttractorNetwork: "an attractor network",
}


def require(mapper: Mapper, capability: type[Capability]) -> Capability:
    """The mapper as one that has a capability, such as `RouteHome` or `PlaceMemory`.

    Raises:
        InputError: The mapper lacks it.
    """
    if not isinstance(mapper, capability):
        has = [what for kind, what in _CAPABILITIES.items() if isinstance(mapper, kind)]
        found = f"one with {', '.join(has)}" if has else "one without"
        expected = f"a mapper with {_CAPABILITIES[capability]}"
        raise InputError(f"mapper {mapper.spec.name}", expected, found)
    return mapper


@runtime_checkable
class MapperBatch(Protocol):
    """Mappers of one kind, one a robot, that take in the readings of many at once.

    What the mapper of a row does is to the last bit what a single one does. Rows do not
    touch each other: threads may update disjoint rows at the same time. The arrays are written
    over by updates.
    """

    @property
    def spec(self) -> MapperSpec:
        """What is known of the mappers by their name."""

    @property
    def poses(self) -> Float64[np.ndarray, "robots 3"]:
        """`Estimate.pose` of each: one and the same array."""

    @property
    def homes(self) -> Float64[np.ndarray, "robots 3"]:
        """`Estimate.home` of each: one and the same array."""

    @property
    def places(self) -> Bool[np.ndarray, "robots 2"]:
        """Whether each recognises its place; whether it is lost: one and the same array."""

    @property
    def matched_readings(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.matched_reading` of each, -1 for none: one and the same array.

        Which reading it is, is as of the last `match_readings`; whether there is one, as of the
        last update.
        """

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Bring `matched_readings` of some up to date."""

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.map_version` of each."""

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.updates` of each."""

    @property
    def segment_counts(self) -> Int64[np.ndarray, "robots"]:
        """How many line segments are in each one's map."""

    @property
    def recognises_places(self) -> bool:
        """Whether they are mappers with a memory of places, who can match readings."""

    @property
    def ways_home(self) -> Float64[np.ndarray, "robots 7"]:
        """`RouteHome.way_home` of each, as of the last `find_ways`: one and the same array.

        Of mappers that know no way home, only the travel that their belief of home rests on.
        """

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the ways home of some."""

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Let one forget everything."""

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Let some take in their readings, which stand in the same rows."""

    def begin_return(self, row: int) -> None:
        """Tell one that the robot turns round for home (see `ReturnAware`)."""

    def snapshot(self, row: int) -> MapSnapshot:
        """The map of one."""

    def activity(self, row: int) -> Activity | None:
        """`AttractorNetwork.activity` of one; None of mappers that have no such network."""

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Everything that one remembers, as arrays by name (copies)."""

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Let one become the one that returned `state`."""
