"""Arrivals: descriptors of the places where a robot stopped, and their comparison.

All of it is a function of the readings alone: the mapper, whose only input is the readings,
gives the believed pose, and the laser gives the surroundings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from albot_core.geometry.poses import compose, transform_points, transform_segments, wrap_angle
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.mapper import AttractorNetwork, Mapper, PlaceMemory
from albot_core.mappers.result_checks import (
    check_activity,
    check_estimate,
    check_place,
    check_snapshot,
    is_from_outside,
)
from albot_core.maps.activity import Activity
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot
from albot_core.matching.line_matching import MatchConfig, match_lines
from albot_core.matching.line_merging import merge_lines
from albot_core.matching.panorama import Panorama, match_panoramas
from albot_core.matching.submaps import longest_lines
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view
from albot_env.tasks.place_recognition.spaces import FEATURES

FARTHEST = 50.0
"""Believed distance shown as 1 (m)."""
LONGEST = 500.0
"""Distance driven shown as 1 (m)."""
PAST = 3.0
"""Free sight beyond the other arrival's position shown as 1 (m); the same short of it is -1."""
SHIFT = 3.0
"""Correction of the believed distance shown as 1 (m)."""
TURN = math.radians(45.0)
"""Correction of the believed heading shown as 1 (rad)."""
MATCHES = 16
"""Number of common surfaces shown as 1."""
LARGEST = 28
"""Maximum number of surfaces around an arrival that are compared; the longest are used."""

_MATCH = MatchConfig()
_VIEW = ViewConfig(fit_lines=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceDescriptor:
    """Descriptor of a place where the robot stopped and looked around."""

    belief: Pose
    """Believed pose (map frame)."""
    way: float
    """Distance driven so far, by the odometer (m)."""
    panorama: Panorama
    """Laser panorama, with directions in the map frame."""
    surfaces: Segments
    """The longest surfaces around, relative to the robot, with directions in the map frame (m)."""
    reading: int
    """Index of its last reading, counted from 0."""


class PlaceDatabase:
    """Follows a robot's readings and stores a descriptor of each arrival.

    Args:
        mapper: The robot's mapper; None for none.
    """

    def __init__(self, mapper: Mapper | None) -> None:
        self._mapper = mapper
        self._belief = np.zeros(3)
        self._way = 0.0
        self._begun = False
        self._readings = 0
        self.arrivals: list[PlaceDescriptor] = []
        """All arrivals so far."""

    @property
    def belief(self) -> Pose:
        """Believed pose of the robot (map frame)."""
        if self._mapper is None:
            return self._belief.copy()
        estimate = self._mapper.estimate
        check_estimate(estimate, self._mapper.spec, self._readings - 1)
        return estimate.pose

    @property
    def snapshot(self) -> MapSnapshot:
        """The mapper's map."""
        if self._mapper is None:
            return EMPTY_MAP
        snapshot = self._mapper.snapshot()
        if is_from_outside(self._mapper.spec):
            check_snapshot(snapshot, self._mapper.spec, self._readings - 1)
        return snapshot

    @property
    def activity(self) -> Activity | None:
        """The activity of the mapper's attractor network; None if it has none."""
        mapper = self._mapper
        if mapper is None or not isinstance(mapper, AttractorNetwork):
            return None
        activity = mapper.activity
        check_activity(activity, mapper.spec, self._readings - 1)
        return activity

    def follow(self, reading: Reading) -> None:
        """Process a reading taken on the way."""
        if self._begun:
            self._belief = compose(self._belief, reading.motion)
            self._way += math.hypot(reading.motion[0], reading.motion[1])
        self._begun = True
        self._readings += 1
        if self._mapper is not None:
            self._mapper.update(reading)

    def arrive(self, readings: Sequence[Reading]) -> Float32[np.ndarray, "arrivals features"]:
        """Process the readings of a look around, and compare the place with all earlier arrivals.

        Returns:
            The features of each earlier arrival, in order, as numbers from -1 to 1.
        """
        points: list[Points] = [np.empty((0, 2))]
        seen: Segments = np.empty((0, 4))
        for reading in readings:
            self.follow(reading)
            around = np.array((0.0, 0.0, self.belief[2]))
            laser = reading.required_laser("place recognition")
            points.append(transform_points(around, laser.points))
            view = transform_segments(around, construct_view(laser, _VIEW).surfaces)
            seen = merge_lines(seen, view, _MATCH)
        arrival = PlaceDescriptor(
            belief=self.belief,
            way=self._way,
            panorama=Panorama.of(np.concatenate(points)),
            surfaces=longest_lines(seen, LARGEST),
            reading=self._readings - 1,  # The last that arrived.
        )
        compared = [
            self._compare(arrival, other, len(self.arrivals) - k)
            for k, other in enumerate(self.arrivals)
        ]
        self.arrivals.append(arrival)
        return np.reshape(np.array(compared, np.float32), (-1, len(FEATURES)))

    def _compare(
        self, here: PlaceDescriptor, there: PlaceDescriptor, ago: int
    ) -> Float64[np.ndarray, "features"]:
        """Return the features by which two arrivals are compared, as numbers from -1 to 1.

        `distance` between the believed positions, logarithmic, -1 at 0 and 1 at `FARTHEST`;
        `agreed` and `contradicted`, the shares of `match_panoramas`, -1 for none and 1 for all;
        `sight` beyond each other's position (m), 0 if it ends there; `shift` and `turn` that align
        the panoramas best, relative to the believed poses, -1 for none; `matches` and `share` of
        the structure (`match_lines`), -1 for none; `place`: 1 if the mapper assigns both to the
        same place, -1 if to two, 0 if it knows no place; `recency`: 1 for the previous arrival,
        towards -1 for older ones; `way` driven since, -1 for none.
        """
        apart = np.array((*(there.belief - here.belief)[:2], 0.0))
        line_match = match_lines(here.surfaces, there.surfaces, apart, np.zeros(3), _MATCH)
        found = match_panoramas(here.panorama, there.panorama, apart, line_match.pose)
        turn = float(abs(wrap_angle(found.pose[2])))
        place = 0.0
        memory = self._mapper
        if memory is not None and isinstance(memory, PlaceMemory):
            ids = []
            for arrival in (here, there):
                ids.append(memory.place_at(arrival.reading))
                check_place(ids[-1], memory.spec, arrival.reading)
            place = 1.0 if ids[0] == ids[1] else -1.0
        numbers = (
            _logarithmic(float(np.hypot(*apart[:2])), 1.0, FARTHEST),
            2 * found.agreed - 1,
            2 * found.contradicted - 1,
            found.sight / PAST,
            2 * float(np.hypot(*(found.pose - apart)[:2])) / SHIFT - 1,
            2 * turn / TURN - 1,
            2 * line_match.matches / MATCHES - 1,
            2 * line_match.share - 1,
            place,
            2 / ago - 1,
            _logarithmic(here.way - there.way, 10.0, LONGEST),
        )
        return np.clip(numbers, -1, 1)


def _logarithmic(length: float, knee: float, longest: float) -> float:
    """Return a length as a number from -1 at 0 to 1 at the longest, with high resolution near 0."""
    return 2 * math.log1p(min(length, longest) / knee) / math.log1p(longest / knee) - 1
