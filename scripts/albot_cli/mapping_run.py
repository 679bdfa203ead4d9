"""A mapper run over a log, and how long it took."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from albot_core.evaluation.trajectory import Trajectory
from albot_core.geometry.types import Points
from albot_core.logs.log import Log
from albot_core.mappers.mapper import AttractorNetwork, CorrectedTrajectory, Mapper, PlaceMemory
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.result_checks import (
    check_activity,
    check_corrected_poses,
    check_estimate,
    check_events,
    check_snapshot,
    check_state,
)
from albot_core.sensing.reading import Reading

_WARM_UP = 2500
"""Scans given to a first mapper so that the timed one finds its code compiled. They are enough for
the robot to pass some exits and return to a place."""
_TELL_EVERY = 50
"""Scans between two progress updates."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MappingRun:
    """A mapper after a complete log."""

    mapper: Mapper
    """The mapper at the end of the log."""
    believed: Trajectory
    """The pose estimated online at each scan, in the map's frame."""
    corrected: Trajectory | None
    """The poses of all scans as estimated at the end, in the map's frame; None if the mapper does
    not correct earlier poses."""
    packets: Points | None
    """Position of the network's largest packet at each scan (m); None without a network."""
    seconds: float
    """Total time of the updates (s), without reading files, compiling and drawing."""
    slowest: float
    """Time of the longest update (s)."""


def warm_up(name: str, config: Any, log: Log, seconds: float = math.inf) -> None:
    """Run a mapper over the log's beginning, so that the next one finds its code compiled.

    It stops early after `seconds` seconds. A wrong reading is reported when the log is mapped, not
    here.
    """
    mapper = make_mapper(name, config=config)
    end = time.perf_counter() + seconds
    for reading in log.readings[:_WARM_UP]:
        mapper.update(reading)
        if time.perf_counter() > end:
            break


def run_mapper(
    name: str,
    config: Any,
    log: Log,
    update: Callable[[int], None],
    rng: np.random.Generator | None = None,
    follow: Callable[[Reading, Mapper], None] = lambda _, __: None,
) -> MappingRun:
    """Run a new mapper over the log.

    Args:
        name: The mapper's name.
        config: The mapper's parameters (see `make_mapper`).
        log: The log.
        update: Called from time to time with the number of scans done.
        rng: The mapper's random generator (see `make_mapper`).
        follow: Called after each reading, outside of the time that is measured.

    Raises:
        InputError: What the mapper returns is not as its interface says: an estimate, or at the
            end its snapshot, its state, its events or its corrected poses.
    """
    mapper = make_mapper(name, config=config, rng=rng)
    spec = mapper.spec
    poses, packets = np.empty((len(log.readings), 3)), np.empty((len(log.readings), 2))
    seconds = slowest = 0.0
    for number, reading in enumerate(log.readings):
        begin = time.perf_counter()
        mapper.update(reading)
        taken = time.perf_counter() - begin
        seconds, slowest = seconds + taken, max(slowest, taken)
        estimate = mapper.estimate
        check_estimate(estimate, spec, number)
        poses[number] = estimate.pose
        follow(reading, mapper)
        if isinstance(mapper, AttractorNetwork):
            activity = mapper.activity
            check_activity(activity, spec, number)
            packets[number] = activity.packet[:2]
        if number % _TELL_EVERY == 0:
            update(number)
    update(len(log.readings))
    check_snapshot(mapper.snapshot(), spec, len(log.readings) - 1)
    check_state(mapper.state(), spec, len(log.readings) - 1)
    if isinstance(mapper, PlaceMemory):
        check_events(mapper.events, spec, len(log.readings) - 1)
    corrected = None
    if isinstance(mapper, CorrectedTrajectory):
        poses_at_end = mapper.corrected_poses()
        check_corrected_poses(poses_at_end, spec, len(log.readings))
        corrected = Trajectory(stamps=log.stamps, poses=poses_at_end)
    believed = Trajectory(stamps=log.stamps, poses=poses)
    return MappingRun(
        mapper=mapper,
        believed=believed,
        corrected=corrected,
        packets=packets if isinstance(mapper, AttractorNetwork) else None,
        seconds=seconds,
        slowest=slowest,
    )
