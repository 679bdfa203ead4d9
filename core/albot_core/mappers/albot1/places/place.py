"""A place in the robot's memory, as it changes, and its exits; users see `network_view.Place`."""

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
"""Exits whose middles are nearer than this are one exit (m)…"""
SAME_DIRECTION = np.radians(45.0)
"""…unless the angle between their lines is larger than this (rad)."""
DEVIATIONS = 2.5
"""An exit is a known one within this many standard deviations of its expected position."""
SEEN_ERROR = SAME_EXIT / DEVIATIONS
"""Standard deviation of an exit's position when seen in passing, in a map without drift (m)."""
DRIFT_RATE = 0.05
"""Standard deviation of the map's drift for each metre travelled since the last alignment."""
MAX_DRIFT = 1.5
"""An exit farther than this from its expected position is a different one (m): two doorways between
the same places are farther apart, for each has its width and a wall beside it."""
DISTINCT = 2.0
"""The second nearest known exit must be at least this many times as far away as the nearest."""

EYE = 0.15
"""Distance of the point from which an exit is looked through, inside the exit (m)."""

Line = Float64[np.ndarray, "4"]
Lines = Float64[np.ndarray, "lines 4"]


@dataclass(kw_only=True, eq=False)
class LearnedExit:
    """An exit of a place that the robot has gone through, with its three values (section 4.1)."""

    line: Line
    """The exit's line in the place's frame, with the place to the left (m)."""
    leads_to: int
    """The id of the place behind the exit."""
    exit_there: int
    """The index of the same exit in that place's list."""


@dataclass(kw_only=True, eq=False)
class LearnedPlace:
    """A place: its frame, its description and its exits."""

    id: int
    frame: Pose
    """The pose of the place's frame in the graph frame (see `PlaceNetwork`)."""
    surfaces: Segments = field(default_factory=lambda: np.empty((0, 4)))
    """The description: surfaces in the place's frame (m)."""
    exits: list[LearnedExit] = field(default_factory=list)
    _boxed: Segments | None = field(default=None, repr=False)
    _box: list[float] = field(default_factory=list, repr=False)

    def describe(self, surfaces: Segments, config: PlacesConfig) -> None:
        """Add surfaces, in the place's frame, to the description (algorithm 5, line 11)."""
        both = merge_lines(self.surfaces, surfaces, config.match)
        self.surfaces = both[-config.max_surfaces :]

    def exit_at(self, line: Line, among: int | None = None) -> int | None:
        """Return which of the (first `among`) exits co-locates with a line in the place's frame."""
        best, which = SAME_EXIT, None
        for k, door in enumerate(self.exits[:among]):
            away = float(np.hypot(*(middle(door.line) - middle(line))))
            turned = abs(wrap_angle(direction(door.line) - direction(line)))
            if away < best and turned < SAME_DIRECTION:
                best, which = away, k
        return which

    def likeliest_exit(self, line: Line, others: Lines, drift: float) -> int | None:
        """Return which of the exits a line in the place's frame is, although the map may drift.

        This is ours. It is the nearest exit of about the same direction within `drift`. It must be
        much nearer than the next known exit, and no other exit seen may be nearer to it than the
        line.

        Args:
            line: The exit that is crossed.
            others: The remembered exits that the robot has seen, in the place's frame (n, 4; m).
            drift: How far the map may have drifted (m), as returned by `drift_after`.
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
        """The lines of the exits, in the place's frame (m)."""
        return np.reshape([door.line for door in self.exits], (-1, 4)).astype(float)

    def holds(self, point: Points) -> bool:
        """Return whether a point, in the place's frame, is on the inner side of all exits.

        A point is outside if it is seen through an exit from just inside.
        """
        return not any(_is_behind(door.line, point) for door in self.exits)

    def surrounds(self, x: float, y: float) -> bool:
        """Return whether a point of the graph frame (m) is in the bounding box of the surfaces."""
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

    def as_place(self, visits: int) -> Place:
        """Return the place as users see it."""
        exits = tuple(
            Exit(line=p.line.copy(), leads_to=p.leads_to, exit_there=p.exit_there)
            for p in self.exits
        )
        return Place(
            id=self.id,
            frame=self.frame.copy(),
            surfaces=self.surfaces.copy(),
            exits=exits,
            visits=visits,
        )


def drift_after(way: float) -> float:
    """Return how far off a known exit may be seen (m), after a way (m) since the last alignment."""
    return DEVIATIONS * math.hypot(SEEN_ERROR, DRIFT_RATE * way)


def between(one: Line, other: Line) -> float:
    """Return the distance between the middles of two exits (m); infinite if directions differ."""
    turned = abs(wrap_angle(direction(one) - direction(other)))
    away = float(np.hypot(*(middle(one) - middle(other))))
    return away if turned < SAME_DIRECTION else math.inf


def middle(line: Line) -> Points:
    """Return the middle of a line (m)."""
    return np.asarray(0.5 * (line[:2] + line[2:]))


def direction(line: Line) -> float:
    """Return the direction of a line from its first end to its second (rad)."""
    return math.atan2(line[3] - line[1], line[2] - line[0])


def reversed_line(line: Line) -> Line:
    """Return the same line with its ends exchanged, so that its other side is to the left."""
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
    """Return lines, given in the same frame as `frame`, relative to `frame`."""
    return transform_segments(relative(frame, np.zeros(3)), lines)
