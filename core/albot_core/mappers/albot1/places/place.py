"""A place that a robot remembers, as it changes, and its exits; users see `network_view.Place`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import relative, transform_segments, wrap_angle
from albot_core.geometry.segment_kernels import left_of
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.albot1.config import PlacesConfig
from albot_core.mappers.albot1.places.network_view import Exit, Place
from albot_core.matching.line_merging import merge_lines

SAME_EXIT = 0.75
"""Exits whose middles are nearer than this are one (m)…"""
SAME_DIRECTION = np.radians(45.0)
"""…unless their lines are turned more than this apart (rad)."""
DEVIATIONS = 2.5
"""An exit is known where it is seen within so many standard deviations of where it is expected."""
SEEN_ERROR = SAME_EXIT / DEVIATIONS
"""Standard deviation of where an exit is seen in passing, in a map without drift (m)."""
DRIFT_RATE = 0.05
"""Standard deviation of the map's drift, for each metre from where it was aligned last."""
MAX_DRIFT = 1.5
"""An exit farther than this from where it is expected is another (m): so near to each other are no
two doorways between the same places, for each has its width and a wall beside it."""
DISTINCT = 2.0
"""The known exit next to the nearest must be so many times as far."""

EYE = 0.15
"""How far inside an exit the point is from which it is looked through (m)."""

Line = Float64[np.ndarray, "4"]
Lines = Float64[np.ndarray, "lines 4"]


@dataclass(kw_only=True, eq=False)
class LearnedExit:
    """An exit of a place that the robot has gone through, with its three values (section 4.1)."""

    line: Line
    """In the place's frame, with the place to the left (m)."""
    leads_to: int
    """The id of the place behind it."""
    exit_there: int
    """Which exit of that place it is."""


@dataclass(kw_only=True, eq=False)
class LearnedPlace:
    """A place: its frame, its description and its exits."""

    id: int
    frame: Pose
    """In the graph frame (see `PlaceNetwork`)."""
    surfaces: Segments = field(default_factory=lambda: np.empty((0, 4)))
    """In its own frame (m)."""
    exits: list[LearnedExit] = field(default_factory=list)
    _boxed: Segments | None = field(default=None, repr=False)
    _box: list[float] = field(default_factory=list, repr=False)

    def describe(self, surfaces: Segments, config: PlacesConfig) -> None:
        """Combine surfaces, in its frame, with its description (algorithm 5, line 11)."""
        both = merge_lines(self.surfaces, surfaces, config.match)
        self.surfaces = both[-config.max_surfaces :]

    def exit_at(self, line: Line, among: int | None = None) -> int | None:
        """Which of its (first `among`) exits co-locates with a line in its frame, if any."""
        best, which = SAME_EXIT, None
        for k, door in enumerate(self.exits[:among]):
            away = float(np.hypot(*(middle(door.line) - middle(line))))
            turned = abs(wrap_angle(direction(door.line) - direction(line)))
            if away < best and turned < SAME_DIRECTION:
                best, which = away, k
        return which

    def likeliest_exit(self, line: Line, others: Lines, drift: float) -> int | None:
        """Which of its exits a line in its frame is, though the map may have drifted since.

        This is ours. It is the nearest exit of about that direction within `drift`. It must be so
        by far: the next known exit is much farther, and no other exit seen is nearer to this one.

        Args:
            line: The exit that is crossed.
            others: The exits that the robot remembers to have seen, in the place's frame (n, 4; m).
            drift: How far the map may have drifted (m), as `drift_after` says.
        """
        known = self.exit_at(line)
        if known is not None:
            return known
        away = [between(door.line, line) for door in self.exits]
        drift = min(drift, MAX_DRIFT)
        ranked = sorted(range(len(away)), key=away.__getitem__)
        if not ranked or away[ranked[0]] > drift:
            return None
        nearest = ranked[0]
        if len(ranked) > 1 and away[ranked[1]] < DISTINCT * away[nearest]:
            return None
        expected = self.exits[nearest].line
        is_another = any(between(expected, other) < away[nearest] - SEEN_ERROR for other in others)
        return None if is_another else nearest

    @property
    def exit_lines(self) -> Lines:
        """The lines of its exits, in its frame (m)."""
        return np.reshape([door.line for door in self.exits], (-1, 4)).astype(float)

    def holds(self, point: Points) -> bool:
        """Whether a point, in its frame, is on the inner side of all its exits.

        A point is outside where it is seen through an exit from just inside.
        """
        return not any(_is_behind(door.line, point) for door in self.exits)

    def surrounds(self, x: float, y: float) -> bool:
        """Whether a point of the graph frame (m) is in the box that holds its surfaces."""
        if self._boxed is not self.surfaces:
            ends = self.surfaces.reshape(-1, 2)
            self._box = [*ends.min(0).tolist(), *ends.max(0).tolist()] if len(ends) else []
            self._boxed = self.surfaces
        if not self._box:
            return False
        left, bottom, right, top = self._box
        east, north, turn = self.frame.tolist()
        cos, sin, dx, dy = math.cos(turn), math.sin(turn), x - east, y - north
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        return bool(left <= along <= right and bottom <= across <= top)

    def as_place(self) -> Place:
        """The place as users see it."""
        exits = tuple(
            Exit(line=p.line.copy(), leads_to=p.leads_to, exit_there=p.exit_there)
            for p in self.exits
        )
        return Place(
            id=self.id, frame=self.frame.copy(), surfaces=self.surfaces.copy(), exits=exits
        )


def drift_after(way: float) -> float:
    """How far off what is known may be seen (m), so far (m) from where the map was aligned last."""
    return DEVIATIONS * math.hypot(SEEN_ERROR, DRIFT_RATE * way)


def between(one: Line, other: Line) -> float:
    """Distance between the middles of two exits (m); infinite if their directions differ."""
    turned = abs(wrap_angle(direction(one) - direction(other)))
    away = float(np.hypot(*(middle(one) - middle(other))))
    return away if turned < SAME_DIRECTION else math.inf


def middle(line: Line) -> Points:
    """The middle of a line (m)."""
    return np.asarray(0.5 * (line[:2] + line[2:]))


def direction(line: Line) -> float:
    """Its direction from the first end to the second (rad)."""
    return math.atan2(line[3] - line[1], line[2] - line[0])


def reversed_line(line: Line) -> Line:
    """The same line with the other side to the left."""
    return line[[2, 3, 0, 1]]


def _is_behind(line: Line, point: Points) -> bool:
    along = line[2:] - line[:2]
    eye = middle(line) + EYE * np.array([-along[1], along[0]]) / np.hypot(*along)
    return bool(
        left_of(*line, *point) < 0
        and left_of(*eye, *line[:2], *point) > 0
        and left_of(*eye, *line[2:], *point) < 0
    )


def in_frame(frame: Pose, lines: Segments) -> Segments:
    """Lines given where the frame is given, expressed in the frame."""
    return transform_segments(relative(frame, np.zeros(3)), lines)
