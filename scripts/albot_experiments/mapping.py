"""A mapper run on a journey, and the record of its states at the views."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import KDTree

from albot_core.evaluation.map_quality import (
    precision_and_recall,
    sample_segments,
    scan_cloud,
)
from albot_core.evaluation.trajectory import align
from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Points, Pose, Poses, Segments
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading
from albot_experiments.report import Figures

ALBOT1 = ("albot1-thesis", "albot1-tracked", "albot1")
"""The mappers on which each experiment of the thesis gives a verdict: the thesis to the letter, the
one that localises by all tracked landmarks jointly, and ours."""
MAPPERS = (*ALBOT1, "odometry")
"""The same mappers, and the odometer alone."""
EVERY_READING = {"view_spacing": 0.0, "view_turn": 0.0}
"""The config of Albot1's mappers in the thesis's experiments: every reading is a view, because the
distance between views is part of an experiment."""
CHAPTER_3 = {"remembers_places": False, **EVERY_READING}
"""The config in the experiments of chapter 3: also without the network of places, which chapter 4
adds, and so without the updates that an exit forces."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MappedJourney:
    """A mapper at the end of a journey."""

    mapper: Mapper
    """The mapper after the last view."""
    poses: Poses
    """(views, 3): the estimated pose at every view, in the map's frame."""
    home: Poses
    """(views, 3): the believed pose of home, in the robot's frame at every view."""
    updates: Int64[np.ndarray, "views"]
    """Number of views laid over the map up to each view."""
    watched: Int64[np.ndarray, "views"]
    """The value of `watch` after every view; 0 without `watch`."""
    surfaces: Mapping[int, Segments]
    """The map's surfaces at the requested views and at the last one."""


def map_readings(
    name: str,
    readings: Sequence[Reading],
    snapshots: Collection[int] = (),
    watch: Callable[[Mapper], int] = lambda _: 0,
    config: object = None,
) -> MappedJourney:
    """Run a new mapper on the readings.

    Args:
        name: The mapper's name.
        readings: The readings, one for each view.
        snapshots: Views at which the map's surfaces are kept, in addition to the last one.
        watch: Called with the mapper after every view; its values are kept.
        config: The mapper's config, as for `make_mapper`; by default, for a mapper of Albot1, that
            of chapter 3.
    """
    if config is None and name in ALBOT1:
        config = CHAPTER_3
    mapper = make_mapper(name, config=config)
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


WITHIN = 0.2
"""A surface is right, and a wall is found, within this distance (m): the thickness of the floors'
walls."""
LEAST_PRECISION, LEAST_RECALL = 0.75, 0.5
"""The shape is kept if at least this share of a map is right, and this share of the seen walls is
found, which is only half because the map is incomplete by intent…"""
LARGEST_PATH_ERROR = 1.0
"""…and if the estimated path is off by at most this (m): half the width of a corridor, so that the
path leads through the rooms that the robot went through."""
_SPACING = 0.1
"""Distance between the points at which walls and surfaces are sampled (m)."""
_IN_VIEW = 0.15
"""A wall is in view if a beam ends within this distance of it (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Walls:
    """The walls of a floor as points, and those of them that a robot has seen (m)."""

    all: Float64[np.ndarray, "walls 2"]
    """(n, 2): points along all walls."""
    seen: Float64[np.ndarray, "seen 2"]
    """(n, 2): the points of `all` at which beams ended."""

    @classmethod
    def of_journey(cls, walls: Segments, readings: Sequence[Reading], truth: Poses) -> Walls:
        """Return the walls of a journey, given its readings and their true poses (views, 3)."""
        points = sample_segments(walls, _SPACING)
        lasers = [reading.required_laser("wall recall") for reading in readings]
        hits = scan_cloud(lasers, truth, _MOST_HITS)
        near, _ = KDTree(hits).query(points, distance_upper_bound=_IN_VIEW)
        return cls(all=points, seen=points[np.isfinite(near)])


_MOST_HITS = 400_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """Measures of a map against the true floor."""

    frame: Pose
    """The map's frame as a pose in the world's, for which the two paths agree best."""
    precision: float
    """Share of the surfaces' length within WITHIN of a wall."""
    recall: float
    """Share of the length of the walls seen within WITHIN of a surface."""
    path_error: float
    """Root mean squared distance of the estimated path from the true one (m; the ATE)."""
    surface_error: float
    """Median distance from the surfaces to the true walls (m); infinite without surfaces. It is
    insensitive, because half of a map may be anywhere."""


def shape_of(points: Points, poses: Poses, truth: Poses, walls: Walls) -> Shape:
    """Measure a map's shape.

    Args:
        points: Points evenly along the map's surfaces (`surface_points`), in the map's frame (m).
        poses: (views, 3): the estimated poses, in the map's frame.
        truth: (views, 3): the true poses, in the world's frame.
        walls: The true walls.
    """
    frame = align(poses[:, :2], truth[:, :2])
    offsets = transform_points(frame, poses[:, :2]) - truth[:, :2]
    laid = transform_points(frame, points)
    precision, recall = precision_and_recall(laid, walls.all, walls.seen, WITHIN)
    return Shape(
        frame=frame,
        precision=precision,
        recall=recall,
        path_error=float(np.sqrt((offsets**2).sum(axis=1).mean())),
        surface_error=float(np.median(KDTree(walls.all).query(laid)[0])) if len(laid) else np.inf,
    )


def surface_points(surfaces: Segments) -> Points:
    """Return points evenly along surfaces (m)."""
    return sample_segments(surfaces, _SPACING)


def is_kept(shapes: Sequence[Shape]) -> bool:
    """Return whether the shape is kept in the median over the seeds."""
    precision, recall, path_error = (
        float(np.median([getattr(shape, name) for shape in shapes]))
        for name in ("precision", "recall", "path_error")
    )
    return (
        precision >= LEAST_PRECISION and recall >= LEAST_RECALL and path_error <= LARGEST_PATH_ERROR
    )


def shape_figures(shapes: Sequence[Shape], before: str = "") -> dict[str, Figures]:
    """Return the reported figures of the shapes over the seeds, with `before` as prefix."""
    return {
        f"{before}wall_precision": median_and_worst([each.precision for each in shapes], 2, min),
        f"{before}wall_recall": median_and_worst([each.recall for each in shapes], 2, min),
        f"{before}path_error_m": median_and_worst([each.path_error for each in shapes]),
    }


def median_and_worst(
    values: Sequence[float], digits: int = 3, worst: Callable[[Sequence[float]], float] = max
) -> dict[str, float]:
    """Return the median and the worst of a measure over the seeds; `worst` selects the worst."""
    return {
        "median": round(float(np.median(values)), digits),
        "worst": round(float(worst(values)), digits),
    }
