"""A mapper led through a journey, and what is kept of it view by view."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.evaluation.map_quality import surface_error
from albot_core.evaluation.trajectory import align
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Pose, Poses, Segments
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
    watched: Int64[np.ndarray, "views"]
    """What was asked of the mapper after every view; 0 where nothing was."""
    surfaces: Mapping[int, Segments]
    """Its surfaces at the views asked for and at the last one."""


def map_readings(
    name: str,
    readings: Sequence[Reading],
    snapshots: Collection[int] = (),
    watch: Callable[[Mapper], int] = lambda _: 0,
) -> MappedJourney:
    """Lead a fresh mapper through the readings.

    Args:
        name: The mapper's name.
        readings: What the robot sensed, view by view.
        snapshots: Views at which its surfaces are kept; they are at the last one anyway.
        watch: Is asked about the mapper after every view.
    """
    mapper = make_mapper(name)
    views, last = len(readings), len(readings) - 1
    poses, home = np.empty((views, 3)), np.empty((views, 3))
    updates, watched = np.zeros(views, np.int64), np.zeros(views, np.int64)
    surfaces = {}
    for view, reading in enumerate(readings):
        mapper.update(reading)
        estimate = mapper.estimate
        poses[view], home[view] = estimate.pose, estimate.home_from_robot
        updates[view] = estimate.updates
        watched[view] = watch(mapper)
        if view in snapshots or view == last:
            surfaces[view] = mapper.snapshot().segments
    return MappedJourney(
        mapper=mapper, poses=poses, home=home, updates=updates, watched=watched, surfaces=surfaces
    )


SHAPE_BOUND = 0.2
"""The shape is kept where half of what a map remembers lies nearer than this to a wall (m): as
far as the walls of these floors are thick. A floor plan laid on itself askew, at random, has
0.5 to 0.8 m."""

_Walls = Float64[np.ndarray, "walls 4"]

_SPACING = 0.2
"""The distance is taken at points so far apart along the surfaces (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """How far a map is from the floor that it is a map of."""

    frame: Pose
    """The map's frame as a pose in the world's, under which the two paths agree best."""
    surface_error: float
    """Median distance from the surfaces to the true walls (m); infinite without surfaces."""
    path_error: float
    """Root of the mean squared distance from the believed to the true path (m; the ATE)."""


def shape_of(surfaces: Segments, poses: Poses, truth: Poses, walls: _Walls) -> Shape:
    """Measure a map's shape.

    Args:
        surfaces: What the map remembers, in the map's frame.
        poses: (views, 3): where the robot believed to be, in the map's frame.
        truth: (views, 3): where it was, in the world's.
        walls: The true walls.
    """
    frame = align(poses[:, :2], truth[:, :2])
    offsets = transform_points(frame, poses[:, :2]) - truth[:, :2]
    error = surface_error(surfaces, walls, frame, _SPACING)
    return Shape(
        frame=frame,
        surface_error=np.inf if error is None else error,
        path_error=float(np.sqrt((offsets**2).sum(axis=1).mean())),
    )


def median_and_worst(values: Sequence[float], digits: int = 3) -> dict[str, float]:
    """The two figures that are reported of a measure over the seeds."""
    return {
        "median": round(float(np.median(values)), digits),
        "worst": round(float(np.max(values)), digits),
    }
