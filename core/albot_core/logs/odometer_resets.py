"""Jumps of a log's odometer that its robot did not make, and the motions that it made instead.

A driver that is started again sets its odometer to zero; a line that is damaged, or a counter that
runs over, makes it jump as well. A mapper that takes such a jump for a motion tears its map.

Two kinds of evidence are weighed. *Speed*: how much longer a step is than those that the log's
robot makes in such a time; the robot's own speeds are the measure, so a car may drive as cars do.
*Scans*: whether the scan fits those before it better where the robot can have come to in that time
than where the odometer says, in an area that allows for bad odometers. A scan that fits neither
says nothing. Both are summed as logarithms of odds; a step is a jump where they are above even.

Where a step is a jump, the robot's motion is measured by its scans. Where these cannot tell, or
there is no laser, the robot is taken to go on as before and after.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.poses import compose, inverse, wrap_angle
from albot_core.geometry.types import Pose, Poses
from albot_core.matching.correlation import Window, correlate
from albot_core.matching.likelihood_field import FieldConfig, LikelihoodField
from albot_core.matching.refinement import refine
from albot_core.matching.scan_points import matched_points, surface_points
from albot_core.sensing.reading import LaserGeometry, LaserScan

_RATE = 2e-3
"""Share of steps that are jumps, before anything is known of a step."""
_TAIL = 4.0
"""Exponent of the power law by which a robot's steps are longer than its usual ones."""
_TURN_TAIL = 3.0
"""The same of turns; so small that a turn alone, of at most a half turn, never makes a jump."""
_MARGIN = 0.3
"""A step that is longer than the usual ones by less is no jump (m): mappers deal with it."""
_TURN_MARGIN = math.radians(45.0)
"""The same of turns (rad)."""
_USUAL = 0.75
"""The quantile of the steps that counts as a usual one, of those in which the robot moves."""
_STILL, _STRAIGHT = 0.01, math.radians(1.0)
"""Smaller steps (m) and turns (rad) are none."""
_AROUND = 3
"""Number of steps before and after a step that tell how fast the robot is at that time."""
_SCANS_BEFORE = 5
"""Number of scans before a step with which the scan after it is compared."""
_BAD_LENGTH, _BAD_PLACE, _BAD_TURN = 0.15, 0.3, math.radians(30.0)
"""Errors of a bad odometer's step: a share of its length, a distance (m), and an angle (rad)."""
_WIDEST = 2.0
"""Largest half-width of the area around the odometer's step (m)."""
_HEADING_STEP = math.radians(1.0)
"""Spacing of the headings that are tried (rad)."""
_FIELD = FieldConfig(half=25.0)
_REACH = 20.0
"""Largest distance of a point that is compared (m)."""
_LEAST_POINTS = 20
"""A scan with fewer points says nothing."""
_FITS = 0.5
"""Smallest mean likelihood of the points of a scan that tells the robot's motion."""
_SAMPLE = 16
"""Number of scans that tell how well scans fit those before them, and those of other places."""
_LEAST_DEVIATION = 0.12
"""Smallest standard deviation of such fits, which a sample so small does not tell."""
_SUREST = 6.0
"""Largest logarithm of odds of one fit: scenes change, and places look alike."""

Source = Literal["scans", "speed"]
"""What a motion is taken from: the scans, or the speeds before and after."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OdometerReset:
    """A step of the odometer that the robot did not make."""

    scan: int
    """Index of the scan at the end of the step."""
    reported: Pose
    """The odometer's motion (m, m, rad), in the robot's frame at the scan before."""
    motion: Pose
    """The motion that is used instead, in the same frame."""
    source: Source
    """What it is taken from."""

    def __str__(self) -> str:
        """Return what happened, in one line."""
        source = "the scans" if self.source == "scans" else "the speed before and after"
        return (
            f"at scan {self.scan + 1} the odometer jumps by {_in_words(self.reported)}, which is "
            f"taken for {_in_words(self.motion)} by {source}"
        )


def _in_words(motion: Pose) -> str:
    return f"{math.hypot(*motion[:2]):.2f} m and {math.degrees(motion[2]):.0f}°"


def find_resets(
    stamps: Float64[np.ndarray, "scans"],
    motions: Poses,
    geometry: LaserGeometry | None,
    ranges: Float64[np.ndarray, "scans beams"] | None,
) -> tuple[OdometerReset, ...]:
    """Return the steps of an odometer that the robot did not make, in the order of the scans.

    Args:
        stamps: Time of every scan (s). Where most are not after the one before, they are ignored.
        motions: The odometer's motion to every scan, in the robot's frame at the scan before; the
            first is not used.
        geometry: Beam geometry of the laser; None without a laser.
        ranges: Distance along every beam (m), infinity where there was no return; None without a
            laser.
    """
    if len(motions) < 3:
        return ()
    steps = _Steps.of(stamps, motions)
    doubtful = np.flatnonzero(steps.is_doubtful)
    if not len(doubtful):
        return ()
    scans = None if geometry is None or ranges is None else _Scans(geometry, ranges)
    believed, resets = motions.copy(), []
    for number in doubtful.tolist():
        expected = steps.expected(number)
        fit = None if scans is None else scans.compare(number, believed, steps, expected)
        odds = math.log(_RATE) + steps.evidence(number) + (0.0 if fit is None else fit.evidence)
        if odds <= 0:
            continue
        measured = None if fit is None else fit.motion
        believed[number] = expected if measured is None else measured
        resets.append(
            OdometerReset(
                scan=number,
                reported=motions[number].copy(),
                motion=believed[number].copy(),
                source="speed" if measured is None else "scans",
            )
        )
    return tuple(resets)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Steps:
    """The steps of an odometer, and what is usual among them. Entry 0 of each array is unused."""

    motions: Poses
    durations: Float64[np.ndarray, "scans"]
    """Time of every step (s), or 1 without a clock; not below the usual, as stamps are uneven."""
    lengths: Float64[np.ndarray, "scans"]
    turns: Float64[np.ndarray, "scans"]
    usual_lengths: Float64[np.ndarray, "scans"]
    """What the robot drives in such a time (m)."""
    usual_turns: Float64[np.ndarray, "scans"]
    longest: Float64[np.ndarray, "scans"]
    """Length up to which a step is surely no jump (m)."""
    widest: Float64[np.ndarray, "scans"]
    """The same of a turn (rad)."""
    is_doubtful: Bool[np.ndarray, "scans"]
    """Whether a step or turn is so much longer than usual ones that it may be a jump."""
    has_clock: bool
    """Whether the stamps tell how long a step took."""

    @classmethod
    def of(cls, stamps: Float64[np.ndarray, "scans"], motions: Poses) -> _Steps:
        """Measure the steps."""
        has_clock, durations = _durations(stamps)
        lengths = np.hypot(motions[:, 0], motions[:, 1])
        turns = np.abs(wrap_angle(motions[:, 2]))
        by_time, by_step = _usual(lengths, durations, _STILL)
        turn_by_time, turn_by_step = _usual(turns, durations, _STRAIGHT)
        longest = _MARGIN + np.minimum(by_time, by_step)
        widest = _TURN_MARGIN + np.minimum(turn_by_time, turn_by_step)
        is_doubtful = (lengths > longest) | (turns > widest)
        is_doubtful[0] = False
        return cls(
            motions=motions,
            durations=durations,
            lengths=lengths,
            turns=turns,
            usual_lengths=by_time,
            usual_turns=turn_by_time,
            longest=longest,
            widest=widest,
            is_doubtful=is_doubtful,
            has_clock=has_clock,
        )

    def evidence(self, number: int) -> float:
        """Return what the speed says of a step: the logarithm of the odds that it is a jump."""
        length = self.lengths[number] / (self.usual_lengths[number] + _MARGIN)
        turn = self.turns[number] / (self.usual_turns[number] + _TURN_MARGIN)
        evidence = max(_TAIL * math.log(max(length, 1.0)), _TURN_TAIL * math.log(max(turn, 1.0)))
        # Without a clock, scans may be missing before a long step: the scans that are there must
        # tell.
        return evidence if self.has_clock else min(evidence, -0.5 * math.log(_RATE))

    def window(self, number: int) -> tuple[Window, Float64[np.ndarray, "3"]]:
        """Return where the robot can have come to, around `expected`, and the prior there."""
        reach = min(float(self.longest[number]), _WIDEST)
        turn = min(float(self.widest[number]), math.pi)
        prior = 0.5 / np.array((reach, reach, turn)) ** 2
        return Window(reach, turn, _HEADING_STEP), prior

    def expected(self, number: int) -> Pose:
        """Return the motion of a step if the robot goes on as before and after."""
        certain = np.flatnonzero(~self.is_doubtful[1:]) + 1
        nearest = (certain[certain < number][-1:], certain[certain > number][:1])
        alike = [
            # In more time than theirs, the robot may as well have stood.
            self.motions[k] * min(self.durations[number] / self.durations[k], 1.0)
            for k in np.concatenate(nearest).tolist()
            if abs(k - number) <= _AROUND
        ]
        return np.asarray(np.mean(alike, axis=0)) if alike else np.zeros(3)


def _durations(
    stamps: Float64[np.ndarray, "scans"],
) -> tuple[bool, Float64[np.ndarray, "scans"]]:
    """Return whether the stamps are a clock's, and the time of every step (s); 1 if they are not.

    They are not where they are the scans' numbers, or where most are not after the one before.
    """
    differences = np.diff(stamps, prepend=stamps[:1])
    passing = differences[differences > 0]
    are_numbers = bool((differences[1:] == 1.0).all())
    if are_numbers or 2 * len(passing) < len(stamps) - 1:
        return False, np.ones(len(stamps))
    return True, np.maximum(differences, np.median(passing))


def _usual(
    sizes: Float64[np.ndarray, "scans"], durations: Float64[np.ndarray, "scans"], least: float
) -> tuple[Float64[np.ndarray, "scans"], Float64[np.ndarray, "scans"]]:
    """Return how large each step usually is: by its time, and whatever its time."""
    return (
        _usual_rate(sizes / durations, sizes > least) * durations,
        _usual_rate(sizes, sizes > least),
    )


def _usual_rate(
    rates: Float64[np.ndarray, "scans"], is_moving: Bool[np.ndarray, "scans"]
) -> Float64[np.ndarray, "scans"]:
    """Return the usual rate around each step: that of the log, or that of its neighbours if more.

    The median of the neighbours follows a robot that is fast for a while; one jump, out and back,
    does not change it.
    """
    moving = rates[1:][is_moving[1:]]
    of_log = float(np.quantile(moving, _USUAL, method="lower")) if len(moving) else 0.0
    padded = np.pad(rates[1:], _AROUND, mode="reflect" if len(rates) > _AROUND + 1 else "edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1), axis=1)
    return np.concatenate(([0.0], np.maximum(of_log, around)))


class _Normal(NamedTuple):
    """A normal distribution of mean likelihoods of scans."""

    mean: float
    deviation: float

    @classmethod
    def of(cls, found: list[float]) -> _Normal:
        """Return the distribution of a sample; a wide one of an empty sample."""
        if not found:
            return cls(0.5, 1.0)
        return cls(float(np.median(found)), max(float(np.std(found)), _LEAST_DEVIATION))

    def log_density(self, value: float) -> float:
        """Return the logarithm of the density, but for a constant."""
        return -0.5 * ((value - self.mean) / self.deviation) ** 2 - math.log(self.deviation)


class _Fit(NamedTuple):
    """How a scan fits those before it."""

    evidence: float
    """Logarithm of the odds that the odometer's step is a jump, by the scans alone."""
    motion: Pose | None
    """The robot's motion by the scans; None where they do not tell."""


class _Scans:
    """The scans of a log, to be compared."""

    def __init__(self, geometry: LaserGeometry, ranges: Float64[np.ndarray, "scans beams"]) -> None:
        self._geometry = geometry
        self._ranges = ranges
        self._field = LikelihoodField(_FIELD)
        self._measured: tuple[_Normal, _Normal] | None = None

    def compare(self, number: int, motions: Poses, steps: _Steps, expected: Pose) -> _Fit | None:
        """Compare a scan with those before it; None if it has too few points."""
        points, normals = matched_points(self._scan(number), _REACH, _FIELD.cell)
        if len(points) < _LEAST_POINTS:
            return None
        usual, chance = self._likelihoods(steps)
        self._lay_out(number - 1, motions)
        reported = steps.motions[number]
        around = min(_BAD_LENGTH * steps.lengths[number] + _BAD_PLACE, _WIDEST)
        window = Window(around, _BAD_TURN, _HEADING_STEP)
        there = correlate(self._field, points, reported, window, np.zeros(3))
        window, prior = steps.window(number)
        here = correlate(self._field, points, expected, window, prior)
        evidence = _likelier(here.response, usual, chance)
        evidence += _likelier(there.response, chance, usual)
        if here.response < _FITS:
            return _Fit(evidence, None)
        found = refine(self._field, points, normals, here.pose, expected, prior)
        found.pose[2] = wrap_angle(found.pose[2])
        return _Fit(evidence, found.pose)

    def _likelihoods(self, steps: _Steps) -> tuple[_Normal, _Normal]:
        """Return how well scans of this log fit the ones before them, and ones of other places."""
        if self._measured is None:
            certain = np.flatnonzero(~steps.is_doubtful[1:]) + 1
            places = np.linspace(0, len(certain) - 1, min(_SAMPLE, len(certain))).astype(int)
            sample = certain[places].tolist()
            count = len(self._ranges)
            near: list[float] = []
            far: list[float] = []
            for number in dict.fromkeys(sample):
                points, _ = matched_points(self._scan(number), _REACH, _FIELD.cell)
                if len(points) < _LEAST_POINTS:
                    continue
                window, prior = steps.window(number)
                for before, found in (
                    (number - 1, near),
                    ((number + count // 2) % count, far),
                ):
                    self._lay_out(before, steps.motions)
                    best = correlate(self._field, points, steps.expected(number), window, prior)
                    found.append(best.response)
            self._measured = _Normal.of(near), _Normal.of(far)
        return self._measured

    def _scan(self, number: int) -> LaserScan:
        return LaserScan(ranges=self._ranges[number], geometry=self._geometry)

    def _lay_out(self, last: int, motions: Poses) -> None:
        """Fill the field with a scan and those before it, in the robot's frame at that scan."""
        self._field.clear(np.zeros(2))
        pose = np.zeros(3)
        for scan in range(last, max(last - _SCANS_BEFORE, -1), -1):
            self._field.add(pose, surface_points(self._scan(scan), _REACH, _FIELD.cell))
            pose = compose(pose, inverse(motions[scan]))


def _likelier(response: float, first: _Normal, second: _Normal) -> float:
    """Return how much likelier a response is by one distribution, as a logarithm, within limits."""
    ratio = first.log_density(response) - second.log_density(response)
    return min(max(ratio, -_SUREST), _SUREST)
