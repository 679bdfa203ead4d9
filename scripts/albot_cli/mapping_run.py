"""A mapper run over a log, and how long it took."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.evaluation.trajectory import Trajectory
from albot_core.geometry.types import Points
from albot_core.localisation.mapper import MapUser
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
    localisation: LocalisationRun | None = None
    """How the robot localised itself in a saved map; None if it made its own."""

    @property
    def located(self) -> Trajectory:
        """The poses estimated while the robot was localised in a saved map; all if it made its own.

        Before that the estimate is the likeliest of several, and may jump.
        """
        if self.localisation is None:
            return self.believed
        at = self.localisation.is_localised
        return Trajectory(stamps=self.believed.stamps[at], poses=self.believed.poses[at])


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalisationRun:
    """How a robot localised itself in a saved map, at each scan of a log."""

    saved_map: Path
    """The map's file."""
    extended: bool
    """Whether the map was extended."""
    standings: tuple[str, ...]
    """`undecided`, `localised` or `lost`, at each scan."""
    hypotheses: int
    """Number of possible poses at the end."""
    way: Float64[np.ndarray, "scans"]
    """Path length by the odometer at each scan (m)."""

    @property
    def is_localised(self) -> Bool[np.ndarray, "scans"]:
        """Whether the robot was localised at each scan."""
        return np.array([standing == "localised" for standing in self.standings], np.bool_)

    @property
    def figures(self) -> dict[str, Any]:
        """The figures, as JSON."""
        at = self.is_localised
        first = int(np.argmax(at)) if at.any() else None
        return {
            "map": str(self.saved_map),
            "extended": self.extended,
            "standing": self.standings[-1],
            "hypotheses": self.hypotheses,
            "localised_share": float(at.mean()),
            "localised_after_m": None if first is None else float(self.way[first]),
            "localised_after_scans": first,
            "losses": int((at[:-1] & ~at[1:]).sum()),
        }


def warm_up(
    name: str,
    config: Any,
    log: Log,
    seconds: float = math.inf,
    saved_map: Path | None = None,
    extend: bool = False,
) -> None:
    """Run a mapper over the log's beginning, so that the next one finds its code compiled.

    It stops early after `seconds` seconds. A wrong reading is reported when the log is mapped, not
    here. The other arguments are those of `run_mapper`.
    """
    mapper = _made(name, config, None, saved_map, extend)
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
    saved_map: Path | None = None,
    extend: bool = False,
) -> MappingRun:
    """Run a new mapper over the log, or one that localises itself in a saved map.

    Args:
        name: The mapper's name.
        config: The mapper's parameters (see `make_mapper`).
        log: The log.
        update: Called from time to time with the number of scans done.
        rng: The mapper's random generator (see `make_mapper`).
        follow: Called after each reading, outside of the time that is measured.
        saved_map: File of the map; None for a new one.
        extend: Whether the saved map is extended.

    Raises:
        InputError: What the mapper returns is not as its interface says: an estimate, or at the
            end its snapshot, its state, its events or its corrected poses.
    """
    mapper = _made(name, config, rng, saved_map, extend)
    spec, standings = mapper.spec, []
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
        if isinstance(mapper, MapUser):
            standings.append(mapper.standing)
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
        localisation=_localisation(mapper, standings, log, saved_map),
    )


def _made(
    name: str, config: Any, rng: np.random.Generator | None, saved_map: Path | None, extend: bool
) -> Mapper:
    """Return the mapper of a run."""
    localise = saved_map is not None
    return make_mapper(
        name, config=config, rng=rng, map=saved_map, localise=localise, extend=extend
    )


def _localisation(
    mapper: Mapper, standings: list[str], log: Log, saved_map: Path | None
) -> LocalisationRun | None:
    """Return how a mapper localised itself; None if it made its own map."""
    if not isinstance(mapper, MapUser) or saved_map is None:
        return None
    steps = np.array([np.hypot(*reading.motion[:2]) for reading in log.readings])
    steps[:1] = 0.0
    return LocalisationRun(
        saved_map=saved_map,
        extended=mapper.extends,
        standings=tuple(standings),
        hypotheses=len(mapper.hypotheses),
        way=np.cumsum(steps),
    )
