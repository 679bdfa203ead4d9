"""Robot paths, and the surfaces beside them by sonar.

Schmidt, Wong and Yeap, section 2: a *robot path* is a straight movement of the robot. The sonars
that point sideways measure how far the ground reaches to the left and right. Where they hear
nothing there is a gap: small gaps are closed, large ones are treated as distant surfaces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import wrap_angle
from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot0.steps import ECHOES, PLACES, SONARS, Steps
from albot_core.mappers.schema import LONGEST
from albot_core.ranges import NOT_NEGATIVE, Range, check_fields
from albot_core.sensing.reading import SonarGeometry, SonarScan

_TURN = Range("an angle within (0, pi]", 0.0, np.pi, beyond=True)
_LENGTH = Range(f"a number within (0, {LONGEST:g}]", 0.0, LONGEST, beyond=True)
_STEP = Range("a number from 0.1", 0.1)
_SIDEWAYS = math.radians(45.0)
"""A sonar points sideways if its bearing differs from ±90° by at most this (rad)."""
_SPACING = 0.02
"""The robot has moved since the last sample if it has gone at least this far (m)."""
_CELL = 0.1
"""Approximate distance of the points along a path at which widths are compared (m)."""
_ROUNDING = 1e-6
"""Lengths and turns that differ by less than this (m; rad) are equal, so that a path of equal
motions ends at the same reading in whatever frame it is driven."""
_NARROWEST = 0.05
"""Minimum distance of a surface from the robot's middle (m)."""
FARTHEST = 1e7
"""Nothing is mapped farther from the start than this (m), because numbers are inexact there."""


@dataclass(frozen=True, kw_only=True)
class PathConfig:
    """How the journey is cut into robot paths, and sonar readings are turned into surfaces.

    All of it is ours: the paper's robot paths end at obstacles, and the paper accepts any
    approximation of surfaces.
    """

    turn: float = math.radians(20.0)
    """A robot path ends where the heading differs from that at its start by more than this
    (rad)…"""
    longest: float = 3.0
    """…or when it is this long (m), so that the robot localises itself in long corridors too."""
    shortest: float = 0.3
    """Shorter paths (m) are left out, because the robot turned on the spot."""
    step: float = 1.0
    """A path is cut into steps of about this length (m). Regions are split between steps."""
    gap: float = 1.0
    """Gaps in the surfaces beside a path that are narrower than this (m) are closed: missed echoes
    and doorways. Wider ones count as distant surfaces, at the sonar's range limit."""
    turned_round: float = math.radians(135.0)
    """The robot has turned round for home if the directions of two consecutive paths differ by at
    least this (rad)…"""
    detects_return: bool = True
    """…if this is set; otherwise only a call of `Albot0.begin_return` begins the way home."""

    def __post_init__(self) -> None:
        check_fields(self, _TURN, "turn", "turned_round")
        check_fields(self, _LENGTH, "longest", "shortest")
        check_fields(self, _STEP, "step")
        check_fields(self, NOT_NEGATIVE, "gap")
        if self.shortest > self.longest:
            found = f"{self.shortest:g} and {self.longest:g}"
            raise InputError("PathConfig.shortest", "no more than longest", found)


Sample = tuple[float, ...]
"""x, y of the robot; x, y of the echo to its left and of that to its right; whether each was heard
(0 or 1); the sonars' range limit (m); the reading's number; x, y of the echoes of up to eight
sonars, or of the robot where no echo was heard."""
_ECHOED = 10
"""Index in a sample at which the echoes of all sonars begin."""
SAMPLE = _ECHOED + 2 * SONARS
"""The length of a sample."""


@dataclass(kw_only=True, eq=False)
class PathInProgress:
    """The robot path that has not ended yet."""

    samples: list[Sample]
    """The samples of the path, one for each reading at which the robot had moved."""
    heading: float = 0.0
    """The robot's heading at the path's start (rad)."""
    travelled: float = 0.0
    """The distance that the robot has travelled on the path (m)."""
    direction_before: float | None = None
    """The direction of the previous path (rad); None if there is none."""

    def follow(
        self,
        pose: tuple[float, float, float],
        sonar: SonarScan,
        reading: int,
        config: PathConfig,
    ) -> Steps | None:
        """Process the robot's next pose and the sonar scan there.

        Returns:
            The steps of the path if it has ended, None if it has not or was too short.
        """
        x, y, heading = pose
        finished = None
        if self.samples:
            turned = float(wrap_angle(heading - self.heading))
            gone = math.hypot(x - self.samples[-1][0], y - self.samples[-1][1])
            if abs(turned) > config.turn + _ROUNDING:
                finished = self._finish(config)
                self.samples.clear()
            elif gone < _SPACING - _ROUNDING:
                return None
            else:
                self.travelled += gone
        sample = _sample(pose, sonar, reading)
        if not self.samples:
            self.heading, self.travelled = heading, 0.0
        self.samples.append(sample)
        if self.travelled >= config.longest - _ROUNDING:
            finished = self._finish(config)
            self.samples[:] = [sample]
            self.heading, self.travelled = heading, 0.0
        return finished

    def stop(self, config: PathConfig) -> Steps | None:
        """End the path at the robot's position; return its steps, None if it was too short."""
        finished = self._finish(config)
        self.samples.clear()
        return finished

    def has_turned_round(self, config: PathConfig) -> bool:
        """Return whether the robot drives roughly against the direction of the previous path."""
        is_short = math.hypot(*self.chord) < config.shortest - _ROUNDING
        if self.direction_before is None or is_short:
            return False
        turned = float(wrap_angle(self.direction - self.direction_before))
        return abs(turned) >= config.turned_round - _ROUNDING

    @property
    def direction(self) -> float:
        """The direction of the robot's front along the path (rad), also if it drives backwards."""
        x, y = self.chord
        direction = math.atan2(y, x)
        is_forward = abs(float(wrap_angle(direction - self.heading))) <= math.pi / 2
        return direction if is_forward else float(wrap_angle(direction + math.pi))

    @property
    def chord(self) -> tuple[float, float]:
        """The vector from the path's start to the robot's position (m)."""
        if not self.samples:
            return 0.0, 0.0
        first, last = self.samples[0], self.samples[-1]
        return last[0] - first[0], last[1] - first[1]

    def _finish(self, config: PathConfig) -> Steps | None:
        if not config.shortest - _ROUNDING <= math.hypot(*self.chord) <= LONGEST:
            return None  # It turned on the spot; or was carried away.
        if max(map(abs, (*self.samples[0][:2], *self.samples[-1][:2]))) > FARTHEST:
            return None
        self.direction_before = self.direction
        return make_steps(np.array(self.samples), config)


def make_steps(samples: Float64[np.ndarray, "samples sample"], config: PathConfig) -> Steps:
    """Return the steps of a robot path from its samples; the first and last lie apart."""
    length = math.hypot(*(samples[-1, :2] - samples[0, :2]).tolist())
    steps = max(1, round(length / config.step))
    cells = steps * max(1, math.ceil(length / steps / _CELL))
    half = int(min(config.gap / 2 / (length / cells), cells))
    widths, walled = _ground_beside(samples, length, (steps, cells, half))
    lines, readings = _lines_along(samples, steps, length / steps)
    return Steps(
        lines=lines,
        widths=widths,
        walled=walled,
        begins=np.arange(steps) == 0,
        readings=readings,
        echoes=_echoes_along(samples, steps, length / steps),
    )


@kernel(arrays=True)
def _ground_beside(
    samples: np.ndarray, length: float, counts: tuple[int, int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the width of the ground on each side of each step (m), and whether it has a surface.

    Args:
        samples: (samples, sample): the path's samples, whose first and last differ in position.
        length: Length of the path (m).
        counts: See `_widths`.
    """
    x, y = samples[0, :2]
    east, north = (samples[-1, :2] - samples[0, :2]) / length
    lefts = 0.0
    for sample in samples:
        lefts += east * (sample[3] - sample[1]) - north * (sample[2] - sample[0])
    reach = samples[:, 8].max()
    widths = np.empty((counts[0], 2))
    ahead, away = np.empty(samples.shape[0]), np.empty(samples.shape[0])
    for side in range(2):
        # If the robot drives backwards, its left sonars are on the right of its way.
        column = side if lefts >= 0.0 else 1 - side
        for k in range(samples.shape[0]):
            u, v = samples[k, 2 + 2 * column] - x, samples[k, 3 + 2 * column] - y
            ahead[k], away[k] = u * east + v * north, reach
            if samples[k, 6 + column] > 0.0:
                away[k] = min(max(abs(v * east - u * north), _NARROWEST), reach)
        widths[:, side] = _widths(ahead, away, length, counts)
    return widths, widths < reach


@kernel(arrays=True)
def _lines_along(samples: np.ndarray, steps: int, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the line of each step of a path (m), and the first reading that was taken on it.

    For a short step the reading may be the one before.

    Args:
        samples: (samples, sample): the path's samples, whose first and last differ in position.
        steps: Number of steps.
        length: Length of each step (m).
    """
    x, y = samples[0, :2]
    east, north = (samples[-1, :2] - samples[0, :2]) / (steps * length)
    lines, readings = np.empty((steps, 4)), np.empty(steps, np.int64)
    first, last = 0, samples.shape[0] - 1
    for step in range(steps):
        begin, end = step * length, (step + 1) * length
        lines[step, 0], lines[step, 1] = x + begin * east, y + begin * north
        lines[step, 2], lines[step, 3] = x + end * east, y + end * north
        while (
            first < last
            and (samples[first, 0] - x) * east + (samples[first, 1] - y) * north < begin
        ):
            first += 1
        readings[step] = int(samples[first, 9])
    return lines, readings


@kernel(arrays=True)
def _echoes_along(samples: np.ndarray, steps: int, length: float) -> np.ndarray:
    """Return the echoes heard at points spread along each step, in the steps' frames (m).

    Args:
        samples: (samples, sample): the path's samples, whose first and last differ in position.
        steps: Number of steps.
        length: Length of each step (m).
    """
    x, y = samples[0, :2]
    east, north = (samples[-1, :2] - samples[0, :2]) / (steps * length)
    gone = (samples[:, 0] - x) * east + (samples[:, 1] - y) * north
    echoes = np.zeros((steps, ECHOES, 2))
    for step in range(steps):
        from_x, from_y = x + step * length * east, y + step * length * north
        for place in range(PLACES):
            middle = (step + (place + 0.5) / PLACES) * length
            sample = samples[np.abs(gone - middle).argmin()]
            for sonar in range(SONARS):
                u, v = sample[_ECHOED + 2 * sonar], sample[_ECHOED + 2 * sonar + 1]
                if u != sample[0] or v != sample[1]:
                    ahead, left, k = u - from_x, v - from_y, SONARS * place + sonar
                    echoes[step, k] = ahead * east + left * north, left * east - ahead * north
    return echoes


@kernel(arrays=True)
def _widths(
    ahead: np.ndarray, away: np.ndarray, length: float, counts: tuple[int, int, int]
) -> np.ndarray:
    """Return the width of the ground beside each step of a path (m), with small gaps closed.

    Args:
        ahead: See `_profile`.
        away: See `_profile`.
        length: See `_profile`.
        counts: Number of steps; number of cells; number of cells in half a gap.
    """
    steps, cells, half = counts
    closed = _close_gaps(_profile(ahead, away, length, cells), half)
    widths, each = np.empty(steps), cells // steps
    for step in range(steps):
        widths[step] = np.median(closed[step * each : (step + 1) * each])
    return widths


@kernel(arrays=True)
def _profile(ahead: np.ndarray, away: np.ndarray, length: float, cells: int) -> np.ndarray:
    """Return the width of the ground (m) in each of the cells into which a path is cut.

    Args:
        ahead: (samples,): position of each echo along the path (m).
        away: (samples,): distance of each echo from the path (m).
        length: Length of the path (m).
        cells: Number of cells.
    """
    profile = np.empty(cells)
    for cell in range(cells):
        middle = (cell + 0.5) * length / cells
        profile[cell] = away[np.abs(ahead - middle).argmin()]
    return profile


@kernel(arrays=True)
def _close_gaps(profile: np.ndarray, half: int) -> np.ndarray:
    """Return the profile of a side without openings narrower than a window of cells.

    This is a grey-scale opening of the profile: a part that is farther away than all cells beside
    it is cut off unless it is as wide as the window, which reaches `half` cells to either side.
    Near surfaces do not change.
    """
    nearest, closed = np.empty_like(profile), np.empty_like(profile)
    for cell in range(profile.shape[0]):
        nearest[cell] = profile[max(cell - half, 0) : cell + half + 1].min()
    for cell in range(profile.shape[0]):
        closed[cell] = nearest[max(cell - half, 0) : cell + half + 1].max()
    return closed


def _sample(pose: tuple[float, float, float], sonar: SonarScan, reading: int) -> Sample:
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    geometry, points, flags = sonar.geometry, [x, y], []
    ranges, max_range = sonar.ranges.tolist(), geometry.max_range
    for index in side_sonars(geometry):
        heard = ranges[index] < max_range
        east, north = _echo(geometry, index, ranges[index] if heard else max_range)
        points += (x + cos * east - sin * north, y + sin * east + cos * north)
        flags.append(float(heard))
    echoes: list[float] = []
    for index in _kept_sonars(geometry):
        east, north = 0.0, 0.0
        if ranges[index] < max_range:
            east, north = _echo(geometry, index, ranges[index])
        echoes += (x + cos * east - sin * north, y + sin * east + cos * north)
    echoes += (x, y) * (SONARS - len(echoes) // 2)
    return (*points, *flags, max_range, float(reading), *echoes)


def _echo(geometry: SonarGeometry, index: int, distance: float) -> tuple[float, float]:
    """Return the origin of a sonar's echo, in the robot's frame (m)."""
    bearing, (east, north) = geometry.bearings[index], geometry.places[index]
    return east + distance * math.cos(bearing), north + distance * math.sin(bearing)


@lru_cache(maxsize=8)
def _kept_sonars(geometry: SonarGeometry) -> tuple[int, ...]:
    """Return the sonars whose echoes are kept: all, or up to SONARS of them, spread evenly."""
    count = len(geometry.bearings)
    kept = min(count, SONARS)
    return tuple((np.arange(kept) * count // kept).tolist())


@lru_cache(maxsize=8)
def side_sonars(geometry: SonarGeometry) -> tuple[int, int]:
    """Return the sonars that point most nearly to the left and to the right.

    Raises:
        InputError: No sonar points to one of the sides.
    """
    bearings = np.array(geometry.bearings)
    chosen = []
    for side, name in ((np.pi / 2, "left"), (-np.pi / 2, "right")):
        aside = np.abs(wrap_angle(bearings - side))
        chosen.append(int(aside.argmin()))
        if aside.min() > _SIDEWAYS:
            found = f"bearings {np.degrees(bearings).round().tolist()}°"
            raise InputError("Reading.sonar", f"a sonar that looks to the {name}", found)
    return chosen[0], chosen[1]
