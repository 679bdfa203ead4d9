"""Arrivals: what a robot remembers of the places where it stopped, and how they compare.

All of it is a function of the readings alone: the mapper, which saw nothing else, says where
the robot believes to be, the laser what stands around.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from albot_core.geometry.poses import compose, transform_points, transform_segments
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.mapper import AttractorNetwork, Mapper, PlaceMemory
from albot_core.maps.activity import Activity
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot
from albot_core.matching.lines import MatchConfig, match_lines, merge_lines
from albot_core.matching.panorama import Panorama, match_panoramas
from albot_core.matching.submaps import longest_lines
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view
from albot_env.tasks.place_recognition.spaces import FEATURES

FARTHEST = 50.0
"""Believed distance shown as 1 (m)."""
LONGEST = 500.0
"""Way shown as 1 (m)."""
PAST = 3.0
"""Sight beyond the other's place shown as 1 (m); as much short of it is -1."""
SHIFT = 3.0
"""Correction of the believed distance shown as 1 (m)."""
TURN = math.radians(45.0)
"""Correction of the believed heading shown as 1 (rad)."""
MATCHES = 16
"""Surfaces in common shown as 1."""
LARGEST = 28
"""Of what is seen around only so many surfaces are compared, the longest."""

_MATCH = MatchConfig()
_VIEW = ViewConfig(fit_lines=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaceDescriptor:
    """What a robot remembers of a place where it stopped and looked around."""

    belief: Pose
    """Where it believed to be (map frame)."""
    way: float
    """How far it had driven, by its odometer (m)."""
    panorama: Panorama
    """What stood around, by the directions of the map."""
    surfaces: Segments
    """The longest surfaces around, by the directions of the map (m)."""
    reading: int
    """The number of its last reading, counted from 0."""


class PlaceDatabase:
    """Follows a robot by its readings and notes down where it arrives.

    Args:
        mapper: The mapper inside; None for none.
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
        """Where the robot believes to be (map frame)."""
        return self._belief.copy() if self._mapper is None else self._mapper.estimate.pose

    @property
    def snapshot(self) -> MapSnapshot:
        """The mapper's map."""
        return EMPTY_MAP if self._mapper is None else self._mapper.snapshot()

    @property
    def activity(self) -> Activity | None:
        """The activity of the mapper's attractor network; None where it has none."""
        mapper = self._mapper
        return mapper.activity if isinstance(mapper, AttractorNetwork) else None

    def follow(self, reading: Reading) -> None:
        """Take in a reading on the way."""
        if self._begun:
            self._belief = compose(self._belief, reading.motion)
            self._way += math.hypot(reading.motion[0], reading.motion[1])
        self._begun = True
        self._readings += 1
        if self._mapper is not None:
            self._mapper.update(reading)

    def arrive(self, readings: Sequence[Reading]) -> Float32[np.ndarray, "arrivals features"]:
        """Take in the readings of a look around, and compare the place with all before.

        Returns:
            The features of each arrival before, in order, in numbers from -1 to 1.
        """
        points: list[Points] = []
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
            reading=self._readings - 1,
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
        """The features by which two arrivals are compared, in numbers from -1 to 1.

        `distance` between the believed places, -1 at 0 and 1 at `FARTHEST`, logarithmic;
        `agreed` and `contradicted`, the shares of `match_panoramas`, -1 for none and 1 for
        all; `sight` past each other's place (m), 0 where it ends there; `shift` and `turn` that
        lay the panoramas best on each other, against what is believed, -1 for none;
        `matches` and `share` of the structure (`match_lines`), -1 for none; `place`:
        1 where the mapper takes both for the same place, -1 where for two, 0 where it knows
        none; `recency`: 1 for the arrival just before, towards -1 the longer ago; `way` driven
        since, -1 for none.
        """
        apart = np.array((*(there.belief - here.belief)[:2], 0.0))
        line_match = match_lines(here.surfaces, there.surfaces, apart, np.zeros(3), _MATCH)
        found = match_panoramas(here.panorama, there.panorama, apart, line_match.pose)
        turn = abs((found.pose[2] + math.pi) % (2 * math.pi) - math.pi)
        place = 0.0
        memory = self._mapper
        if memory is not None and isinstance(memory, PlaceMemory):
            is_same = memory.place_at(here.reading) == memory.place_at(there.reading)
            place = 1.0 if is_same else -1.0
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
    """A length as a number from -1 at 0 to 1 at the longest, finest where short."""
    return 2 * math.log1p(min(length, longest) / knee) / math.log1p(longest / knee) - 1
