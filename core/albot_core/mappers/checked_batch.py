"""A batch of mappers from outside the project, whose results are checked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.mappers.mapper import TRAVEL, MapperBatch, MapperSpec
from albot_core.mappers.result_checks import (
    check_activity,
    check_array,
    check_rows,
    check_snapshot,
    check_state,
)
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Readings

_READINGS = "checked.readings"
"""Array that a state holds besides the batch's own."""
_KEPT: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
    "poses": (np.float64, (3,)),
    "homes": (np.float64, (3,)),
    "places": (np.bool_, (2,)),
    "matched_readings": (np.int64, ()),
    "ways_home": (np.float64, (7,)),
}
"""Type, and shape per robot, of the arrays that are always the same. Compiled code reads them by
their address, so a wrong shape or type is worse than a wrong number."""


class CheckedMappers:
    """A batch from outside as a `MapperBatch`; each call checks its results once for all rows.

    Args:
        mappers: The batch.
        count: Number of robots.
        spec: The mappers' spec.

    Raises:
        InputError: The batch is not as the protocol says; its methods and properties raise this.
    """

    def __init__(self, mappers: MapperBatch, count: int, spec: MapperSpec) -> None:
        self._mappers = mappers
        self.spec = spec
        self.recognises_places = bool(mappers.recognises_places)
        self._readings = np.zeros(count, np.int64)
        self._kept = {name: getattr(mappers, name) for name in _KEPT}
        for name, (kind, shape) in _KEPT.items():
            check_array(self._kept[name], name, kind, (count, *shape), spec)
        self.poses: Float64[np.ndarray, "robots 3"] = self._kept["poses"]
        self.homes: Float64[np.ndarray, "robots 3"] = self._kept["homes"]
        self.places: Bool[np.ndarray, "robots 2"] = self._kept["places"]
        self.matched_readings: Int64[np.ndarray, "robots"] = self._kept["matched_readings"]
        self.ways_home: Float64[np.ndarray, "robots 7"] = self._kept["ways_home"]
        self._check(np.arange(count))

    @property
    def map_versions(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.map_version` of each."""
        return self._counts("map_versions")

    @property
    def updates(self) -> Int64[np.ndarray, "robots"]:
        """`Estimate.updates` of each."""
        return self._counts("updates")

    @property
    def segment_counts(self) -> Int64[np.ndarray, "robots"]:
        """Number of line segments in each map."""
        return self._counts("segment_counts")

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Reset the mapper of a row."""
        self._mappers.reset(row, rng)
        self._readings[row] = 0
        self._check(np.array([row]))

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Update the mappers of some rows with the readings of these rows."""
        self._mappers.update(rows, readings)
        self._readings[rows] += 1
        self._check(rows)

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Bring `matched_readings` of some rows up to date."""
        self._mappers.match_readings(rows)
        matched = self.matched_readings[rows]
        earlier = (matched >= -1) & (matched < self._readings[rows])
        expected = "the number of an earlier reading, or -1"
        self._check_rows("matched_readings", rows, earlier, expected)

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the ways home of some rows."""
        self._mappers.find_ways(rows)
        known = ~np.isnan(self.ways_home[rows, TRAVEL])
        self._check_rows("ways_home", rows, known, "7 numbers, of which the last is not NaN")

    def begin_return(self, row: int) -> None:
        """Tell the mapper of a row that the robot turns for home."""
        self._mappers.begin_return(row)
        self._check(np.array([row]))

    def snapshot(self, row: int) -> MapSnapshot:
        """Return the map of a row."""
        snapshot = self._mappers.snapshot(row)
        check_snapshot(snapshot, self.spec, int(self._readings[row]) - 1)
        return snapshot

    def activity(self, row: int) -> Activity | None:
        """Return the activity of a row's attractor network; None if the mappers have none."""
        activity = self._mappers.activity(row)
        if activity is not None:
            check_activity(activity, self.spec, int(self._readings[row]) - 1)
        return activity

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Return everything that a row's mapper remembers, as arrays by name (copies)."""
        state = self._mappers.state(row)
        check_state(state, self.spec, int(self._readings[row]) - 1)
        return state | {_READINGS: np.array(self._readings[row])}

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Restore a row's mapper from what `state` returned."""
        if _READINGS not in state:
            expected, found = f"an array {_READINGS}", ", ".join(state) or "none"
            raise InputError(f"mapper {self.spec.name}, batch", expected, found, place="restore")
        own = {name: array for name, array in state.items() if name != _READINGS}
        self._mappers.restore(row, own)
        self._readings[row] = state[_READINGS]
        self._check(np.array([row]))

    def _counts(self, name: str) -> Int64[np.ndarray, "robots"]:
        """Return whole numbers of each row, which may be another array each time."""
        counts: Int64[np.ndarray, "robots"] = getattr(self._mappers, name)
        check_array(counts, name, np.int64, self._readings.shape, self.spec)
        return counts

    def _check(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Check that the arrays are those of the beginning, and the poses of some rows finite."""
        for name, kept in self._kept.items():
            now = getattr(self._mappers, name)
            if now is not kept and not _is_same_memory(now, kept):
                expected = "always the same array, whose numbers change"
                raise InputError(f"mapper {self.spec.name}, batch", expected, "another", place=name)
        for name in ("poses", "homes"):
            finite = np.isfinite(self._kept[name][rows]).all(axis=1)
            self._check_rows(name, rows, finite, "3 finite numbers, (x, y, heading)")

    def _check_rows(
        self,
        name: str,
        rows: Int64[np.ndarray, "some"],
        right: Bool[np.ndarray, "some"],
        expected: str,
    ) -> None:
        check_rows(self._kept[name], name, rows, right, expected, self.spec, self._readings)


def _is_same_memory(now: object, kept: np.ndarray) -> bool:
    """Whether an array is the kept one or another view of all its numbers."""
    if not isinstance(now, np.ndarray):
        return False
    same_kind = now.dtype == kept.dtype and now.shape == kept.shape
    return same_kind and now.strides == kept.strides and now.ctypes.data == kept.ctypes.data
