"""A mapper led through a journey, and what is kept of it view by view."""

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
"""The mappers on which each experiment of the thesis gives a verdict: to the letter, with the
landmarks of a view together, and ours."""
MAPPERS = (*ALBOT1, "odometry")
"""With the odometer alone beside them."""
EVERY_READING = {"view_spacing": 0.0, "view_turn": 0.0}
"""The config of Albot1's mappers in the thesis's experiments: every reading is a view, for how far
apart views are is part of an experiment."""
CHAPTER_3 = {"remembers_places": False, **EVERY_READING}
"""That in experiments of chapter 3: no network of places either, which chapter 4 adds, and so no
update that an exit forces."""


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
    config: object = None,
) -> MappedJourney:
    """Lead a fresh mapper through the readings.

    Args:
        name: The mapper's name.
        readings: What the robot sensed, view by view.
        snapshots: Views at which its surfaces are kept; they are at the last one anyway.
        watch: Is asked about the mapper after every view.
        config: The mapper's config, as `make_mapper` takes it; that of chapter 3 where none is
            given to a mapper of Albot1.
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
"""So near to a wall a surface is right, and a wall found (m): as far as the walls of the floors are
thick."""
LEAST_PRECISION, LEAST_RECALL = 0.75, 0.5
"""The shape is kept where so much of what a map remembers is right, and so much of what was seen
is found, which is no more than half: the map is incomplete by intent…"""
LARGEST_PATH_ERROR = 1.0
"""…and the believed path is off by no more (m): half the width of a corridor, so that it leads
through the rooms that the robot went through."""
_SPACING = 0.1
"""Walls and surfaces are sampled at points so far apart (m)."""
_IN_VIEW = 0.15
"""A wall is in view where a beam ends so near to it (m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Walls:
    """The walls of a floor as points, and which of them a robot has seen (m)."""

    all: Float64[np.ndarray, "walls 2"]
    """(n, 2): points along all walls."""
    seen: Float64[np.ndarray, "seen 2"]
    """(n, 2): those of them at which beams ended."""

    @classmethod
    def of_journey(cls, walls: Segments, readings: Sequence[Reading], truth: Poses) -> Walls:
        """Those of a journey whose readings were taken at the true poses `truth` (views, 3)."""
        points = sample_segments(walls, _SPACING)
        lasers = [reading.required_laser("wall recall") for reading in readings]
        hits = scan_cloud(lasers, truth, _MOST_HITS)
        near, _ = KDTree(hits).query(points, distance_upper_bound=_IN_VIEW)
        return cls(all=points, seen=points[np.isfinite(near)])


_MOST_HITS = 400_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """How far a map is from the floor that it is a map of."""

    frame: Pose
    """The map's frame as a pose in the world's, under which the two paths agree best."""
    precision: float
    """Share of the surfaces' length within WITHIN of a wall."""
    recall: float
    """Share of the length of the walls seen within WITHIN of a surface."""
    path_error: float
    """Root of the mean squared distance from the believed to the true path (m; the ATE)."""
    surface_error: float
    """Median distance from the surfaces to the true walls (m); infinite without surfaces. Nearly
    blind: half of a map may be anywhere."""


def shape_of(points: Points, poses: Poses, truth: Poses, walls: Walls) -> Shape:
    """Measure a map's shape.

    Args:
        points: Points evenly along what the map remembers (`surface_points`), in its frame (m).
        poses: (views, 3): where the robot believed to be, in the map's frame.
        truth: (views, 3): where it was, in the world's.
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
    """Points evenly along surfaces (m)."""
    return sample_segments(surfaces, _SPACING)


def is_kept(shapes: Sequence[Shape]) -> bool:
    """Whether the shape is kept in the median over the seeds."""
    precision, recall, path_error = (
        float(np.median([getattr(shape, name) for shape in shapes]))
        for name in ("precision", "recall", "path_error")
    )
    return (
        precision >= LEAST_PRECISION and recall >= LEAST_RECALL and path_error <= LARGEST_PATH_ERROR
    )


def shape_figures(shapes: Sequence[Shape], before: str = "") -> dict[str, Figures]:
    """What is reported of the shapes over the seeds, each name after `before`."""
    return {
        f"{before}wall_precision": median_and_worst([each.precision for each in shapes], 2, min),
        f"{before}wall_recall": median_and_worst([each.recall for each in shapes], 2, min),
        f"{before}path_error_m": median_and_worst([each.path_error for each in shapes]),
    }


def median_and_worst(
    values: Sequence[float], digits: int = 3, worst: Callable[[Sequence[float]], float] = max
) -> dict[str, float]:
    """The two figures that are reported of a measure over the seeds; the worst is the largest."""
    return {
        "median": round(float(np.median(values)), digits),
        "worst": round(float(worst(values)), digits),
    }
