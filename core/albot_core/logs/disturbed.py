"""Disturbed versions of a log: what a worse odometer or a poorer laser would have recorded.

A mapper that is tuned on a log may live on its odometer's virtues. How its error grows over such
versions tells how much of it does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.logs.log import Log, with_noise

TURN_SCALE, TURN_FREEDOM = np.radians(4.0), 2
"""A turn's error follows Student's t of so many degrees of freedom, times this (rad): one in 26 is
beyond 20°…"""
LARGEST_TURN_ERROR = np.radians(30.0)
"""…and none beyond this (rad)."""
SHORTEST, LONGEST = 0.85, 1.15
"""A motion's length is off by a factor between these."""
NEAR = 8.0
"""A near-sighted laser sees so far (m)."""


def with_false_turns(log: Log, rng: np.random.Generator) -> Log:
    """A copy of the log in which every turn is off, mostly a little and now and then by far."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    errors = TURN_SCALE * rng.standard_t(TURN_FREEDOM, len(motions))
    motions[:, 2] += np.clip(errors, -LARGEST_TURN_ERROR, LARGEST_TURN_ERROR)
    return _with_motions(log, motions)


def with_false_lengths(log: Log, rng: np.random.Generator) -> Log:
    """A copy of the log in which every motion is longer or shorter, each by a factor of its own."""
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions[:, :2] *= rng.uniform(SHORTEST, LONGEST, (len(motions), 1))
    return _with_motions(log, motions)


def with_half_the_beams(log: Log, rng: np.random.Generator) -> Log:
    """A copy of the log with every second beam, from the first or the second on.

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
    """A copy of the log without every third reading; which of three is drawn."""
    kept = np.arange(len(log.stamps)) % 3 != rng.integers(3)

    def thinned(rows: np.ndarray | None) -> np.ndarray | None:
        return None if rows is None else rows[kept]

    return replace(
        log,
        stamps=log.stamps[kept],
        odometry=log.odometry[kept],
        ranges=thinned(log.ranges),
        echoes=thinned(log.echoes),
        scenes=thinned(log.scenes),
        reference=thinned(log.reference),
    )


def near_sighted(log: Log, _: np.random.Generator) -> Log:
    """A copy of the log whose laser sees no farther than `NEAR`.

    Raises:
        InputError: The log has no laser.
    """
    if log.geometry is None or log.ranges is None:
        raise InputError(log.name, "a laser", "none")
    ranges = np.where(log.ranges < NEAR, log.ranges, np.inf)
    geometry = replace(log.geometry, max_range=min(NEAR, log.geometry.max_range))
    return replace(log, ranges=ranges, geometry=geometry)


def _all(log: Log, rng: np.random.Generator) -> Log:
    for disturb in (with_false_turns, with_false_lengths, without_every_third):
        log = disturb(log, rng)
    return near_sighted(with_half_the_beams(log, rng), rng)


DISTURBANCES: dict[str, Callable[[Log, np.random.Generator], Log]] = {
    "noise": lambda log, _: log,
    "turns": with_false_turns,
    "lengths": with_false_lengths,
    "beams": with_half_the_beams,
    "views": without_every_third,
    "range": near_sighted,
    "all": _all,
}
"""The disturbances by name; "noise" is none but that of `disturbed`."""


def disturbed(log: Log, disturbance: str, seed: int) -> Log:
    """The log under a disturbance, and with a little noise, so that no two seeds are the same.

    Args:
        log: The log.
        disturbance: One of `DISTURBANCES`.
        seed: What is drawn follows from it.
    """
    rng = np.random.default_rng(seed)
    return with_noise(DISTURBANCES[disturbance](log, rng), rng)


def _with_motions(log: Log, motions: np.ndarray) -> Log:
    """A copy of the log with other motions from reading to reading."""
    poses = [log.odometry[0]]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    return replace(log, odometry=np.array(poses))
