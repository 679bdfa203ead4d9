"""The public logs of experiment 6, and the true paths and floors as far as known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from albot_core.errors import InputError
from albot_core.evaluation.map_quality import sample_segments, scan_cloud
from albot_core.evaluation.moments import pair_moments
from albot_core.evaluation.registration import register
from albot_core.evaluation.trajectory import (
    Relations,
    Trajectory,
    alignment,
    read_relations,
)
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log, read_reference
from albot_core.logs.wean import read_wean_map
from albot_experiments.registry import data_folder

_MOST = 200_000
"""Number of points of a reference map."""


@dataclass(frozen=True, kw_only=True)
class RealLog:
    """A log by its files' names, in the folder `logs` of the data."""

    name: str
    log: str
    reference: str = ""
    """File of corrected poses; if empty, the log holds them itself, or there are none."""
    relations: str = ""
    """File of true relations between poses."""
    floor: str = ""
    """File of a map of the building, if no corrected poses are known."""


LOGS = (
    RealLog(
        name="Intel",
        log="intel_raw.json.gz",
        reference="intel_reference.json.gz",
        relations="intel.relations",
    ),
    RealLog(name="ACES", log="aces-corrected.log.gz"),
    RealLog(name="Freiburg 101", log="freiburg-101-corrected.log.gz"),
    RealLog(name="Wean 1", log="wean_robotdata1.log.xz", floor="wean_map.dat.gz"),
    RealLog(name="Wean 2", log="wean_robotdata2.log.xz", floor="wean_map.dat.gz"),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownLog:
    """A log and its ground truth, as far as known."""

    log: Log
    truth: Trajectory | None
    """The robot's true poses."""
    relations: Relations | None
    floor: Points
    """(n, 2): points of the walls, from the building's map or from the scans at the true poses."""

    def frame_of(self, believed: Trajectory, surfaces: Segments) -> Pose:
        """Return the pose of the map's frame on the floor, by the two paths or by the walls."""
        frame = None if self.truth is None else alignment(believed, self.truth)
        return register(sample_segments(surfaces, 0.2), self.floor) if frame is None else frame


def read_real_log(real: RealLog) -> KnownLog:
    """Read a log and its ground truth, as far as known.

    Raises:
        InputError: There is no folder of data, or a file is missing or damaged.
    """
    folder = data_folder() / "logs"
    log = read_log(folder / real.log)
    truth = read_reference(folder / real.reference) if real.reference else log.reference_trajectory
    return KnownLog(
        log=log,
        truth=truth,
        relations=read_relations(folder / real.relations) if real.relations else None,
        floor=read_wean_map(folder / real.floor) if real.floor else _laid(log, truth),
    )


def _laid(log: Log, truth: Trajectory | None) -> Points:
    """Return the points of the scans, placed by the robot's true poses."""
    if truth is None:
        raise InputError(log.name, "corrected poses, or a map of the building", "neither")
    pairs = pair_moments(truth.stamps, log.stamps)
    lasers = [log.readings[scan].required_laser("map entropy") for scan in pairs.second]
    return np.asarray(scan_cloud(lasers, truth.poses[pairs.first], _MOST))
