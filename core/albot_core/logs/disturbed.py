"""Disturbed versions of a log: what a worse odometer or a poorer laser would have recorded.

The growth of a mapper's error over such versions tells how far it depends on the log that it was
tuned on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.logs.log import Log, with_noise
from albot_core.sensing.faults.effect import ReadingFault
from albot_core.sensing.faults.fault import Clock
from albot_core.sensing.faults.injector import FaultInjector, packed
from albot_core.sensing.faults.registry import READING_FAULTS, check_needs, parse_faults
from albot_core.sensing.reading import LaserGeometry

TURN_SCALE, TURN_FREEDOM = np.radians(4.0), 2
"""Scale (rad) and degrees of freedom of the error of a turn, which follows Student's t: one turn in
26 is off by more than 20°."""
LARGEST_TURN_ERROR = np.radians(30.0)
"""Largest error of a turn (rad)."""
BAD_TURN, BAD_LENGTH = np.radians(25.0), 0.1
"""Largest error of a bad odometer's turn (rad), and of a length, as a share of it."""
SHORTEST, LONGEST = 0.85, 1.15
"""Least and largest factor by which a motion's length is off."""
FINE_TURN = np.radians(24.0)
"""Largest error of a turn (rad) with the finer laser."""
SAME_WALL = 0.3
"""Neighbouring ranges that differ by less (m) are of one wall: a beam between them meets it too."""
STRAIGHT = 0.05
"""So are points, however far apart, that lie no farther than this (m) from the straight line
through their neighbours: of a wall that the beams meet at a grazing angle."""
FROZEN = "frozen-odometer:at=0s,lasting=1000000s"
"""An odometer that counts nothing from the first reading to the last."""
NEAR = 8.0
"""Range of the near-sighted laser (m)."""


def with_false_turns(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log in which every turn is off, usually slightly, at times strongly."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    errors = TURN_SCALE * rng.standard_t(TURN_FREEDOM, len(motions))
    motions[:, 2] += np.clip(errors, -LARGEST_TURN_ERROR, LARGEST_TURN_ERROR)
    return _with_motions(log, motions)


def with_bad_odometer(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log in which every turn is off by up to 25°, every length by a tenth."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions[:, :2] *= rng.uniform(1 - BAD_LENGTH, 1 + BAD_LENGTH, (len(motions), 1))
    motions[:, 2] += rng.uniform(-BAD_TURN, BAD_TURN, len(motions))
    return _with_motions(log, motions)


def with_false_lengths(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log in which each motion is scaled by a random factor."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions[:, :2] *= rng.uniform(SHORTEST, LONGEST, (len(motions), 1))
    return _with_motions(log, motions)


def with_half_the_beams(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log with every second beam, from the first or the second on.

    Raises:
        InputError: The log has no laser.
    """
    if log.geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    first = int(rng.integers(2))
    ranges = np.ascontiguousarray(log.ranges[:, first::2])
    geometry = replace(
        log.geometry,
        beams=ranges.shape[1],
        first_bearing=float(log.geometry.bearings[first]),
        spacing=2 * log.geometry.spacing,
    )
    return replace(log, ranges=ranges, geometry=geometry)


def without_every_third(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log without every third reading, from a random first one on."""
    kept = np.arange(len(log.stamps)) % 3 != rng.integers(3)
    return log.with_scans(kept)


def near_sighted(log: Log, _: np.random.Generator) -> Log:
    """Return a copy of the log whose laser sees no farther than `NEAR`.

    Raises:
        InputError: The log has no laser.
    """
    if log.geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    ranges = np.where(log.ranges < NEAR, log.ranges, np.inf)
    geometry = replace(log.geometry, max_range=min(NEAR, log.geometry.max_range))
    return replace(log, ranges=ranges, geometry=geometry)


def with_a_fine_laser(log: Log, rng: np.random.Generator) -> Log:
    """Return a copy of the log with a beam between any two, and turns off by up to 24°.

    A beam between two that meet one wall meets it where the straight line between their points
    runs; any other measures the nearer of the two, for a beam is wide.

    Raises:
        InputError: The log has no laser.
    """
    if log.geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    first, last = log.ranges[:, :-1], log.ranges[:, 1:]
    with np.errstate(invalid="ignore"):
        is_wall = (np.abs(first - last) < SAME_WALL) | _are_straight(log.ranges, log.geometry)
        on_line = 2 * np.cos(log.geometry.spacing / 2) * first * last / (first + last)
    ranges = np.empty((len(first), 2 * first.shape[1] + 1))
    ranges[:, ::2] = log.ranges
    ranges[:, 1::2] = np.where(is_wall, on_line, np.minimum(first, last))
    geometry = replace(log.geometry, beams=ranges.shape[1], spacing=log.geometry.spacing / 2)
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions[:, 2] += rng.uniform(-FINE_TURN, FINE_TURN, len(motions))
    return _with_motions(replace(log, ranges=ranges, geometry=geometry), motions)


def _are_straight(
    ranges: Float64[np.ndarray, "readings beams"], geometry: LaserGeometry
) -> Bool[np.ndarray, "readings gaps"]:
    """Whether each pair of neighbouring points lies on one straight wall.

    Either of the two is within `STRAIGHT` of the line through the other and the point beyond it.
    """
    run = np.diff(ranges[..., None] * geometry.directions, axis=1)
    before, between, after = run[:, :-2], run[:, 1:-1], run[:, 2:]
    is_straight = np.zeros(run.shape[:2], np.bool_)  # The first and the last have no point beyond.
    is_straight[:, 1:-1] = _is_beside(between, before) & _is_beside(between, after)
    return is_straight


def _is_beside(
    run: Float64[np.ndarray, "readings gaps 2"], line: Float64[np.ndarray, "readings gaps 2"]
) -> Bool[np.ndarray, "readings gaps"]:
    """Whether a run from a line's point ends within `STRAIGHT` of the line."""
    across = line[..., 0] * run[..., 1] - line[..., 1] * run[..., 0]
    return np.asarray(np.abs(across) < STRAIGHT * np.hypot(line[..., 0], line[..., 1]))


def with_faults(log: Log, specs: Any, seed: int) -> Log:
    """Return the log as it would be if faults had struck while it was recorded.

    Distances of a schedule are the odometer's. A scan is where it arrived, with its own stamp, and
    with the odometer's pose at its arrival.

    Args:
        log: The log.
        specs: The faults of readings (see `parse_faults`).
        seed: Selects the random streams of their schedules.

    Raises:
        InputError: A fault is unknown, its parameters are not valid, or it needs a sensor that the
            log has not, or contact, which no log tells.
    """
    faults = [
        fault
        for fault in parse_faults(specs, READING_FAULTS, log.name)
        if isinstance(fault, ReadingFault)
    ]
    check_needs(faults, log.sensors, log.name, log.name)
    injector = FaultInjector(faults, (seed,), log.geometry, log.sonar)
    travelled, arrived = 0.0, []
    for reading in log.recorded_readings:
        travelled += float(np.hypot(*reading.motion[:2]))
        clock = Clock(reading.stamp - float(log.times[0]), travelled)
        arrived += injector.feed(reading, clock)
    scans = np.searchsorted(log.times, [reading.stamp for reading in arrived])
    worse = log.with_scans(scans)
    held = packed(arrived)
    worse = replace(
        worse,
        ranges=None if log.ranges is None else held["ranges"],
        echoes=None if log.echoes is None else held["echoes"],
        scenes=None if log.scenes is None else held["scenes"],
    )
    return _with_motions(worse, held["motions"][1:])


def _all(log: Log, rng: np.random.Generator) -> Log:
    for disturb in (with_false_turns, with_false_lengths, without_every_third):
        log = disturb(log, rng)
    return near_sighted(with_half_the_beams(log, rng), rng)


DISTURBANCES: dict[str, Callable[[Log, np.random.Generator], Log]] = {
    "noise": lambda log, _: log,
    "turns": with_false_turns,
    "lengths": with_false_lengths,
    "odometer": with_bad_odometer,
    "beams": with_half_the_beams,
    "views": without_every_third,
    "range": near_sighted,
    "fine": with_a_fine_laser,
    "frozen": lambda log, rng: with_faults(log, FROZEN, int(rng.integers(2**32))),
    "all": _all,
}
"""The disturbances by name; "noise" adds only the noise of `disturbed`."""


def disturbed(log: Log, disturbance: str, seed: int) -> Log:
    """Return the log under a disturbance, with a little noise, so that no two seeds are the same.

    Args:
        log: The log.
        disturbance: One of `DISTURBANCES`; or faults of readings, as `laser-dropout:at=20m`.
        seed: Seed of the random numbers.

    Raises:
        InputError: As for `with_faults`; or the log has no laser, and the disturbance needs one.
    """
    rng = np.random.default_rng(seed)
    if disturbance not in DISTURBANCES:
        return with_faults(with_noise(log, rng), disturbance, seed)
    return DISTURBANCES[disturbance](with_noise(log, rng), rng)


def _with_motions(log: Log, motions: np.ndarray) -> Log:
    """Return a copy of the log with other motions between readings."""
    poses = [log.odometry[0]]
    for motion in motions:
        # Standing still is to the last bit: composition would turn by rounding errors.
        poses.append(compose(poses[-1], motion) if motion.any() else poses[-1])
    return replace(log, odometry=np.array(poses))
