"""A mapper led through a journey, and what is kept of it view by view."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.types import Poses, Segments
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading

MAPPERS = ("albot1", "albot1-thesis", "odometry")
"""Which mappers the thesis's experiments run: ours, the thesis's, and the odometer alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedJourney:
    """A mapper at the end of a journey."""

    mapper: Mapper
    """The mapper after the last view."""
    poses: Poses
    """(views, 3): where it believed to be at every view, in the map's frame."""
    home: Poses
    """(views, 3): where it believed home to be, in the robot's frame at every view."""
    updates: Int64[np.ndarray, "views"]
    """How often it had laid a view over its map, up to every view."""
    lost: Int64[np.ndarray, "views"]
    """At how many views no landmark had been recognised, up to every view. 0 throughout for
    mappers that recognise none."""
    surfaces: Mapping[int, Segments]
    """Its surfaces at the views asked for and at the last one."""


def map_readings(
    name: str, readings: Sequence[Reading], snapshots: Collection[int] = ()
) -> MappedJourney:
    """Lead a fresh mapper through the readings.

    Args:
        name: The mapper's name.
        readings: What the robot sensed, view by view.
        snapshots: Views at which its surfaces are kept; they are at the last one anyway.
    """
    mapper = make_mapper(name)
    views, last = len(readings), len(readings) - 1
    poses, home = np.empty((views, 3)), np.empty((views, 3))
    updates, lost = np.zeros(views, np.int64), np.zeros(views, np.int64)
    surfaces, laid = {}, 0
    for view, reading in enumerate(readings):
        laid += mapper.update(reading)
        estimate = mapper.estimate
        poses[view], home[view] = estimate.pose, estimate.home_from_robot
        updates[view] = laid
        if isinstance(mapper, Albot1):
            lost[view] = mapper.lost
        if view in snapshots or view == last:
            surfaces[view] = mapper.snapshot().segments
    return MappedJourney(
        mapper=mapper, poses=poses, home=home, updates=updates, lost=lost, surfaces=surfaces
    )
