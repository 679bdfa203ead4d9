"""A batch of single mappers, for mappers without a batch of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Int64

from albot_core.mappers.mapper import (
    TRAVEL,
    AttractorNetwork,
    Mapper,
    MapperSpec,
    PlaceMatches,
    PlaceMemory,
    Recognition,
    ReturnAware,
    RouteHome,
)
from albot_core.mappers.result_checks import (
    check_activity,
    check_estimate,
    check_place_matches,
    check_snapshot,
    check_state,
    check_way_home,
    is_from_outside,
)
from albot_core.maps.activity import Activity
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Readings

_TRAVEL, _READINGS = "batch.travel", "batch.readings"
"""Arrays that a state holds besides the mapper's own."""


class LoopedMappers:
    """Single mappers as a `MapperBatch`; their readings are processed one after another.

    Args:
        mappers: The mappers, one per robot; at least one, all of one kind.

    Raises:
        InputError: What a mapper returns is not as the protocols say; the methods raise this.
    """

    def __init__(self, mappers: Sequence[Mapper]) -> None:
        self._mappers = tuple(mappers)
        count = len(self._mappers)
        self.spec: MapperSpec = self._mappers[0].spec
        self._from_outside = is_from_outside(self.spec)
        self.recognises_places = isinstance(self._mappers[0], PlaceMemory)
        self._knows_routes = isinstance(self._mappers[0], RouteHome)
        self.poses = np.zeros((count, 3))
        self.homes_in_map = np.zeros((count, 3))
        self.is_recognised = np.zeros(count, np.bool_)
        self.is_lost = np.zeros(count, np.bool_)
        self.matched_readings = np.full(count, -1)
        self.map_versions = np.zeros(count, np.int64)
        self.updates = np.zeros(count, np.int64)
        self.segment_counts = np.zeros(count, np.int64)
        self.ways_home = np.full((count, 7), np.nan)
        self.ways_home[:, TRAVEL] = 0.0
        self._readings = [0] * count
        for row in range(count):
            self._take_estimate(row)

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Reset the mapper of a row."""
        self._mappers[row].reset(rng)
        self.ways_home[row, TRAVEL] = 0.0
        self._readings[row] = 0
        self._take_estimate(row)

    def update(self, rows: Int64[np.ndarray, "some"], readings: Readings) -> None:
        """Update the mappers of some rows with the readings of these rows."""
        for row in rows.tolist():
            reading = readings[row]
            self._mappers[row].update(reading)
            if self._readings[row] and not self._knows_routes:
                x, y, _ = reading.motion.tolist()
                self.ways_home[row, TRAVEL] += math.hypot(x, y)
            self._readings[row] += 1
            self._take_estimate(row)

    def begin_return(self, row: int) -> None:
        """Tell the mapper of a row that the robot turns for home, if it is `ReturnAware`."""
        mapper = self._mappers[row]
        if isinstance(mapper, ReturnAware):
            mapper.begin_return()
            self._take_estimate(row)

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Do nothing; `matched_readings` are always up to date."""

    def find_ways(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Find the ways home of some rows, if the mappers know any."""
        if self._knows_routes:
            for row in rows.tolist():
                mapper = self._mappers[row]
                assert isinstance(mapper, RouteHome)
                way = mapper.way_home
                check_way_home(way, self.spec, self._readings[row] - 1)
                self.ways_home[row] = way

    def snapshot(self, row: int) -> MapSnapshot:
        """Return the map of a row."""
        snapshot = self._mappers[row].snapshot()
        if self._from_outside:
            check_snapshot(snapshot, self.spec, self._readings[row] - 1)
        return snapshot

    def activity(self, row: int) -> Activity | None:
        """Return the activity of a row's attractor network; None if the mappers have none."""
        mapper = self._mappers[row]
        if not isinstance(mapper, AttractorNetwork):
            return None
        activity = mapper.activity
        check_activity(activity, self.spec, self._readings[row] - 1)
        return activity

    def place_matches(self, row: int, most: int) -> PlaceMatches:
        """Return the best matches of a row's place; none if the mappers say nothing of it."""
        mapper = self._mappers[row]
        if not isinstance(mapper, Recognition):
            return np.empty((0, 6))
        matches = mapper.place_matches(most)
        check_place_matches(matches, self.spec, self._readings[row] - 1)
        return matches

    def state(self, row: int) -> dict[str, np.ndarray]:
        """Return everything that a row's mapper remembers, as arrays by name (copies)."""
        state = self._mappers[row].state()
        check_state(state, self.spec, self._readings[row] - 1)
        return state | {
            _TRAVEL: np.array(self.ways_home[row, TRAVEL]),
            _READINGS: np.array(self._readings[row]),
        }

    def restore(self, row: int, state: Mapping[str, np.ndarray]) -> None:
        """Restore a row's mapper from what `state` returned."""
        own = {name: array for name, array in state.items() if not name.startswith("batch.")}
        self._mappers[row].restore(own)
        self.ways_home[row, TRAVEL] = state[_TRAVEL]
        self._readings[row] = int(state[_READINGS])
        self._take_estimate(row)

    def _take_estimate(self, row: int) -> None:
        estimate = self._mappers[row].estimate
        check_estimate(estimate, self.spec, self._readings[row] - 1)
        self.poses[row] = estimate.pose
        self.homes_in_map[row] = estimate.home
        self.updates[row] = estimate.updates
        matched = estimate.matched_reading
        self.matched_readings[row] = -1 if matched is None else matched
        self.is_recognised[row] = matched is not None
        self.is_lost[row] = not estimate.localised
        self.map_versions[row] = estimate.map_version
        self.segment_counts[row] = estimate.segments
