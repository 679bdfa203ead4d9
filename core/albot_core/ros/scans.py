"""Laser scans of ROS as ranges along the same beams, counter-clockwise as seen from above."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float32, Float64

from albot_core.counts import many
from albot_core.errors import InputError
from albot_core.logs.log import NO_RETURN, SICK_BEAM_WIDTH, SICK_SPACINGS
from albot_core.ros.frames import Transform, frame_name
from albot_core.sensing.reading import LaserGeometry

_MOST_RANGES = 1 << 27
"""Most ranges that are held; of 8 bytes each."""
_LARGEST_TILT = math.radians(10)
"""Largest angle between a laser's plane and the level (rad)."""
_ROUNDING = 1e-4
"""Largest error of a full turn of beams (rad), from angles in single precision."""
_LEAST_STEP = 1e-5
"""Smallest angle between beams (rad)."""
_LARGEST_BEARING = 100.0
"""Largest bearing of a first beam (rad)."""


class _Layout(NamedTuple):
    """How the beams of a scan lie in the laser's frame."""

    first: float
    """Bearing of the first beam (rad)."""
    step: float
    """Angle from each beam to the next (rad), negative if they run clockwise."""
    beams: int

    @property
    def is_usable(self) -> bool:
        """Whether these can be beams of a laser."""
        is_spaced = _LEAST_STEP <= abs(self.step) <= math.pi
        return self.beams > 1 and is_spaced and abs(self.first) <= _LARGEST_BEARING


class Scans:
    """The scans of a topic, in the order of the bag.

    Args:
        path: The bag, for errors.
        topic: The topic.
    """

    def __init__(self, path: Path, topic: str) -> None:
        self._path = path
        self._topic = topic
        self._frame: str | None = None
        self._stamps: list[float] = []
        self._layouts: list[_Layout] = []
        self._ranges: list[Float32[np.ndarray, "beams"]] = []
        self._count = 0
        self._reach = 0.0

    def add(self, stamp: float, message: Any) -> None:
        """Add a LaserScan. What is no measurement becomes infinite."""
        frame = frame_name(message.header.frame_id)
        if self._frame is None:
            self._frame = frame
        elif self._frame != frame:
            expected = f"scans of one laser, in the frame {self._frame}"
            raise InputError(self._path, expected, frame, place=self._topic)
        ranges = np.array(message.ranges, np.float32)
        # Also false of NaN. At 0 or below the minimum drivers put what they could not measure.
        is_hit = (ranges > 0) & (ranges < np.inf)
        is_hit &= ~(ranges < message.range_min)
        if message.range_max > 0:
            is_hit &= ranges < message.range_max
            self._reach = max(self._reach, message.range_max)
        ranges[~is_hit] = np.inf
        beams = len(ranges)
        step = message.angle_increment
        if not (math.isfinite(step) and step) and beams > 1:
            step = (message.angle_max - message.angle_min) / (beams - 1)
        self._stamps.append(stamp)
        self._layouts.append(_Layout(message.angle_min, step, beams))
        self._ranges.append(ranges)
        self._count += beams
        if self._count > _MOST_RANGES:
            raise InputError(
                self._path, f"{_MOST_RANGES:,} ranges at most", "more", place=self._topic
            )

    def laser(self) -> Laser:
        """Return all scans with the commonest layout of beams.

        Raises:
            InputError: There is no scan, or none with beams.
        """
        usable = Counter(each for each in self._layouts if each.is_usable)
        if not usable:
            found = f"{many(len(self._stamps), 'scan')}, none of them such"
            expected = "scans of two beams or more, at some angle to each other"
            raise InputError(self._path, expected, found, place=self._topic)
        layout = _at_most_a_turn(usable.most_common(1)[0][0])
        others = 0
        ranges = np.empty((len(self._stamps), layout.beams))
        for scan, own in enumerate(self._layouts):
            if own.first == layout.first and own.beams >= layout.beams and _same(own, layout):
                ranges[scan] = self._ranges[scan][: layout.beams]
            else:
                others += 1
                ranges[scan] = _nearest_beams(self._ranges[scan], own, layout)
        notes = []
        if others:
            notes.append(
                f"{many(others, 'scan')} of {len(ranges):,} with other beams than the "
                f"{layout.beams} of most; each beam is taken from the nearest"
            )
        reach = self._reach
        if not math.isfinite(reach) or not reach:
            hits = ranges[np.isfinite(ranges)]
            reach = above(hits.max()) if len(hits) else NO_RETURN
        return Laser(
            self._topic, self._frame or "", np.array(self._stamps), layout, ranges, reach, notes
        )


def above(reach: float) -> float:
    """Return a number above a range that single precision, as in messages, tells from it."""
    return float(np.nextafter(np.float32(reach), np.float32(np.inf)))


def _same(own: _Layout, layout: _Layout) -> bool:
    """Return whether beams lie alike to a tenth of their spacing."""
    return abs(own.step - layout.step) * layout.beams < 0.1 * abs(layout.step)


def _at_most_a_turn(layout: _Layout) -> _Layout:
    """Return a layout without the beams beyond a full turn."""
    span, turn = (layout.beams - 1) * abs(layout.step), 2 * math.pi
    if span <= turn:
        return layout
    if span <= turn + _ROUNDING:
        return layout._replace(step=math.copysign(turn / (layout.beams - 1), layout.step))
    return layout._replace(beams=int(turn / abs(layout.step)) + 1)


def _nearest_beams(
    ranges: Float32[np.ndarray, "own"], own: _Layout, layout: _Layout
) -> Float64[np.ndarray, "beams"]:
    """Return the ranges of the beams of `own` that are nearest to those of `layout`."""
    nearest = np.full(layout.beams, np.inf)
    if not own.is_usable:
        return nearest
    turn = 2 * math.pi / abs(own.step)
    bearings = layout.first + layout.step * np.arange(layout.beams)
    beams = ((bearings - own.first) / own.step) % turn
    beams = np.where(turn - beams < 0.5, 0, np.rint(beams)).astype(np.int64)
    known = beams < own.beams
    nearest[known] = ranges[beams[known]]
    return nearest


class Laser(NamedTuple):
    """The scans of a laser, all with the same beams."""

    topic: str
    frame: str
    stamps: Float64[np.ndarray, "scans"]
    layout: _Layout
    ranges: Float64[np.ndarray, "scans beams"]
    reach: float
    """Maximum range (m)."""
    notes: list[str]

    def mounted(
        self, path: Path, mount: Transform
    ) -> tuple[LaserGeometry, Float64[np.ndarray, "scans beams"]]:
        """Return the laser's geometry on the robot, and its ranges in the order of its beams.

        `LaserGeometry` has beams that run counter-clockwise as seen from above. Those of a laser
        that hangs upside down, at a roll of 180°, run clockwise, and so do those of a laser with a
        negative angle increment. A beam at the bearing b of a laser upside down lies at -b to its
        axis, so such scans are turned over exactly.

        Args:
            path: The bag, for errors.
            mount: The laser's pose in the robot's frame.

        Raises:
            InputError: The laser does not scan the level, or its beams are none that a
                `LaserGeometry` can have.
        """
        upright = float(mount[2, 2])
        tilt = math.acos(min(abs(upright), 1.0))
        if tilt > _LARGEST_TILT:
            found = f"one that is tilted by {math.degrees(tilt):.0f}°"
            raise InputError(path, "a laser that scans the level", found, place=self.topic)
        first, step, beams = self.layout
        ranges = self.ranges
        if upright < 0:
            first, step = -first, -step
        if step < 0:
            first, step = first + (beams - 1) * step, -step
            ranges = ranges[:, ::-1]
        is_sick = abs(SICK_SPACINGS.get(beams, math.inf) - math.degrees(step)) < 1e-3
        try:
            geometry = LaserGeometry(
                beams=beams,
                first_bearing=first,
                spacing=step,
                beam_width=SICK_BEAM_WIDTH if is_sick else 0.0,
                max_range=self.reach,
                mount=(
                    float(mount[0, 3]),
                    float(mount[1, 3]),
                    math.atan2(mount[1, 0], mount[0, 0]),
                ),
            )
        except InputError as error:
            raise InputError(path, error.expected, error.found, place=self.topic) from None
        return geometry, ranges
