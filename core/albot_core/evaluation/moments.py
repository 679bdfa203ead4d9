"""Stamps of scans and poses: whether they tell the time, and what belongs together.

Stamps of real logs are often bad: printed with six digits (`1.13486e+09`), so that hundreds of
scans share two stamps; set back while the robot drove; or of messages that arrived late. Two lists
of stamps are therefore paired by time only where both tell it, and otherwise line by line if they
have as many lines. Pairs that could be others are not made.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.counts import many
from albot_core.geometry.types import Poses

STAMP_TOLERANCE = 0.01
"""Largest difference of stamps of the same moment (s)."""
MOST_REPEATED = 0.1
"""Largest share of stamps that repeat the one before, of a clock that is fine enough to tell
scans apart."""
CLEARLY_SHORTER = 0.9
"""A path below this share of another's length is clearly shorter. Odometers and SLAM systems
jitter, so that a wrong order of two poses can shorten a path a little."""
Stamps = Float64[np.ndarray, "moments"]


@dataclass(frozen=True, kw_only=True)
class Clock:
    """What is wrong with a list of stamps; nothing if both numbers are zero."""

    repeated: int
    """Number of stamps that are the same as the one before."""
    setbacks: Int64[np.ndarray, "setbacks"]
    """Indices of the stamps that are before the previous one."""
    steps: Float64[np.ndarray, "setbacks"]
    """By how much (s)."""
    count: int
    """Number of stamps."""

    @property
    def is_coarse(self) -> bool:
        """Whether too many moments share their stamps to be told apart by them."""
        return self.repeated > MOST_REPEATED * max(self.count - 1, 1)

    @property
    def is_good(self) -> bool:
        """Whether the stamps tell the time."""
        return not (self.is_coarse or len(self.setbacks))


def read_clock(stamps: Stamps) -> Clock:
    """Return what is wrong with stamps, which are in the order in which they were written."""
    steps = np.diff(stamps)
    setbacks = np.flatnonzero(steps < 0)
    return Clock(
        repeated=int(np.count_nonzero(steps == 0)),
        setbacks=setbacks + 1,
        steps=-steps[setbacks],
        count=len(stamps),
    )


def clock_fault(stamps: Stamps, what: str) -> str | None:
    """Return what is wrong with stamps in a few words; None if they tell the time.

    Args:
        stamps: The stamps, in the order in which they were written.
        what: What has the stamps ("scan" or "pose").
    """
    clock = read_clock(stamps)
    if clock.is_good:
        return None
    if clock.is_coarse:
        return f"{many(clock.count, what)} share {many(len(np.unique(stamps)), 'stamp')}"
    first, step = clock.setbacks[0] + 1, clock.steps[0]
    if len(clock.setbacks) == 1:
        return f"the clock steps back by {step:.3g} s at {what} {first}"
    return (
        f"the clock steps back {len(clock.setbacks)} times, first by {step:.3g} s at {what} {first}"
    )


def rising_times(stamps: Stamps) -> Stamps:
    """Return times that do not decrease, for what must know how much time went by.

    They are the stamps themselves where these tell the time. Where a clock is set back, a typical
    step takes the place of that one, and all later times are moved with it. Of a clock too coarse
    to tell moments apart nothing is used: a moment's time is its number.
    """
    clock = read_clock(stamps)
    if clock.is_coarse:
        return np.arange(len(stamps), dtype=np.float64)
    if clock.is_good:
        return stamps
    steps = np.diff(stamps)
    forward = steps[steps > 0]
    typical = float(np.median(forward)) if len(forward) else 0.0
    moved = stamps.copy()
    moved[1:] += np.cumsum(np.where(steps < 0, typical - steps, 0.0))
    return np.maximum.accumulate(moved)


def time_order(
    stamps: Stamps, poses: Poses, *, lines_have_order: bool = True
) -> Int64[np.ndarray, "moments"]:
    """Return the order of moments in time: that of the lines, except where the poses deny it.

    Stamps that fall may be of messages that arrived late, or of a clock that was set back. The
    robot's way tells one from the other: each stretch of lines whose stamps are out of order is
    sorted by stamp if that makes the way clearly shorter, and stays as it is written if it makes it
    longer.

    Args:
        stamps: The stamps, in the order in which they were written.
        poses: The robot's pose at each, by odometer or reference.
        lines_have_order: Whether to keep the order of the lines where the way does not decide, as
            in a log, rather than that of the stamps.
    """
    order = np.arange(len(stamps))
    if not (np.diff(stamps) < 0).any():
        return order
    by_stamp = np.argsort(stamps, kind="stable")
    # The way of a point 1 m ahead of the robot, which tells of turns, too.
    ahead = poses[:, :2] + np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=1)
    for begin, end in _disordered(by_stamp):
        sorted_part = by_stamp[begin:end]
        if read_clock(stamps[sorted_part]).is_coarse:
            continue
        before, after = order[max(begin - 1, 0) : begin], order[end : end + 1]
        lengths = [
            _length(ahead[np.concatenate((before, part, after))])
            for part in (sorted_part, order[begin:end])
        ]
        by_stamps, by_lines = lengths
        if by_stamps < CLEARLY_SHORTER * by_lines or (
            not lines_have_order and by_lines >= CLEARLY_SHORTER * by_stamps
        ):
            order[begin:end] = sorted_part
    return order


def _disordered(by_stamp: Int64[np.ndarray, "moments"]) -> Iterator[tuple[int, int]]:
    """Yield the beginning and end of each shortest stretch that sorting changes in itself."""
    ends = np.flatnonzero(np.maximum.accumulate(by_stamp) == np.arange(len(by_stamp))) + 1
    begin = 0
    for end in ends.tolist():
        if end - begin > 1:
            yield begin, end
        begin = end


def _length(points: Float64[np.ndarray, "points 2"]) -> float:
    steps = np.diff(points, axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def associate(
    stamps: Stamps, wanted: Float64[np.ndarray, "others"], tolerance: float = STAMP_TOLERANCE
) -> tuple[Int64[np.ndarray, "pairs"], Int64[np.ndarray, "pairs"]]:
    """Pair each stamp in `wanted` with the nearest one in `stamps`, if within `tolerance` (s).

    `stamps` must not decrease. Returns the indices of the pairs in `stamps` and in `wanted`. Of
    equally near stamps the earlier one is taken; a stamp may be taken more than once. What has the
    same stamp as another of its list is not paired, for it could be either.
    """
    nearest = _nearest(stamps, wanted, tolerance)
    paired = (nearest >= 0) & _is_alone(wanted)
    return nearest[paired], np.flatnonzero(paired)


def look_up(
    stamps: Stamps, wanted: Float64[np.ndarray, "others"], tolerance: float
) -> Int64[np.ndarray, "others"]:
    """Return the index of each wanted stamp; -1 if there is none within `tolerance` (s).

    For stamps that were copied from the list, whose clock may therefore step back; but -1 for all
    if too many share their stamps, and for what is found both before and after a step.
    """
    clock = read_clock(stamps)
    if clock.is_coarse or not clock.count:
        return np.full(len(wanted), -1)
    runs = np.split(np.arange(clock.count), clock.setbacks)
    found = np.stack([_nearest(stamps[run], wanted, tolerance) for run in runs])
    begins = np.array([run[0] for run in runs])
    is_found = found >= 0
    only = is_found.sum(axis=0) == 1
    return np.where(only, np.where(is_found, found + begins[:, None], 0).sum(axis=0), -1)


def _nearest(
    stamps: Stamps, wanted: Float64[np.ndarray, "others"], tolerance: float
) -> Int64[np.ndarray, "others"]:
    """Return the index of the nearest stamp; -1 if none is near, or several have that stamp."""
    if not len(stamps):
        return np.full(len(wanted), -1)
    after = np.searchsorted(stamps, wanted).clip(0, len(stamps) - 1)
    before = (after - 1).clip(0)
    nearer = np.abs(wanted - stamps[before]) <= np.abs(stamps[after] - wanted)
    nearest = np.where(nearer, before, after)
    close = np.abs(stamps[nearest] - wanted) <= tolerance
    return np.where(close & _is_alone(stamps)[nearest], nearest, -1)


def _is_alone(stamps: Stamps) -> Bool[np.ndarray, "moments"]:
    """Whether no other stamp is the same."""
    _, which, counts = np.unique(stamps, return_inverse=True, return_counts=True)
    return np.asarray(counts[which] == 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Moments of two lists that are the same."""

    first: Int64[np.ndarray, "pairs"]
    """Indices in the first list."""
    second: Int64[np.ndarray, "pairs"]
    """Indices in the second."""
    how: str
    """How they were found, as the end of a sentence about them."""


BY_TIME, BY_LINE = "paired by time", "paired line by line"
BETWEEN_STEPS = "paired by time between the steps of the clock"
NOT_PAIRED = "not compared: stamps that do not tell the time, and not one for each"


def pair_moments(
    first: Stamps, second: Float64[np.ndarray, "others"], tolerance: float = STAMP_TOLERANCE
) -> Pairs:
    """Return which moments of two lists of stamps are the same; both in the order written.

    Lists with the same stamps are paired line by line. Otherwise, where both tell the time, each
    stamp of `second` is paired with the nearest of `first` (see `associate`). Where one does not,
    they are paired line by line if they have as many lines, and else not at all; but two lists
    whose clocks step back as often are paired by time between the steps.
    """
    clocks = read_clock(first), read_clock(second)
    trusted = clocks[0].is_good and clocks[1].is_good
    if len(first) == len(second) and (not trusted or np.array_equal(first, second)):
        every = np.arange(len(first))
        return Pairs(first=every, second=every, how=BY_LINE)
    if trusted:
        mine, theirs = associate(first, second, tolerance)
        return Pairs(first=mine, second=theirs, how=BY_TIME)
    runs = [np.split(np.arange(clock.count), clock.setbacks) for clock in clocks]
    if clocks[0].is_coarse or clocks[1].is_coarse or len(runs[0]) != len(runs[1]):
        none = np.empty(0, np.int64)
        return Pairs(first=none, second=none, how=NOT_PAIRED)
    pairs = []
    for mine, theirs in zip(*runs, strict=True):
        at, other = associate(first[mine], second[theirs], tolerance)
        pairs.append((mine[at], theirs[other]))
    mine, theirs = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return Pairs(first=mine, second=theirs, how=BETWEEN_STEPS)
