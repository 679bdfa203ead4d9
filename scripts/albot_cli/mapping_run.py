"""A mapper's run over a log, and what it came to."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from albot_core.evaluation.trajectory import (
    RelationError,
    Relations,
    Trajectory,
    TrajectoryError,
    relation_error,
    trajectory_error,
)
from albot_core.logs.log import Log
from albot_core.mappers.mapper import Mapper
from albot_core.mappers.registry import make_mapper

_WARM_UP = 2500
"""Scans by which a first mapper is led, so that the second finds its code compiled: so many that
the robot has been through some exits and come back to a place."""

_TELL_EVERY = 50
"""Scans between two words on how far the run has come."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MappingRun:
    """A mapper that has been led through a log."""

    mapper: Mapper
    """The mapper at the end of the log."""
    believed: Trajectory
    """Where it believed the robot to be, scan by scan, in its map's frame."""
    updates: int
    """How many scans it has added to its map."""
    seconds: float
    """Time spent in its updates alone: no reading of files, no compiling, no drawing."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """How far a trajectory is from the truth; None where the truth is not known."""

    trajectory: TrajectoryError | None
    relations: RelationError | None


def warm_up(name: str, log: Log) -> None:
    """Lead a mapper through the log's beginning, so that the next finds its code compiled."""
    mapper = make_mapper(name)
    for reading in log.readings[:_WARM_UP]:
        mapper.update(reading)


def run_mapper(name: str, log: Log, tell: Callable[[int], None]) -> MappingRun:
    """Lead a fresh mapper through the log.

    Args:
        name: The mapper's name.
        log: What the robot sensed.
        tell: Is called now and then with the number of scans done.
    """
    mapper = make_mapper(name)
    poses = np.empty((len(log.readings), 3))
    seconds, updates = 0.0, 0
    for number, reading in enumerate(log.readings):
        begin = time.perf_counter()
        updates += mapper.update(reading)
        seconds += time.perf_counter() - begin
        poses[number] = mapper.estimate.pose
        if number % _TELL_EVERY == 0:
            tell(number)
    tell(len(log.readings))
    believed = Trajectory(stamps=log.stamps, poses=poses)
    return MappingRun(mapper=mapper, believed=believed, seconds=seconds, updates=updates)


def score(
    trajectory: Trajectory, reference: Trajectory | None, relations: Relations | None
) -> Score:
    """Hold a trajectory against what is known of the truth."""
    return Score(
        trajectory=trajectory_error(trajectory, reference) if reference else None,
        relations=relation_error(trajectory, relations) if relations else None,
    )
