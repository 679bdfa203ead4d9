"""Exits: found in a view, remembered in the perceptual map, and crossed (section 4.1.1).

An exit is a gap of doorway size, about 1 m. The thesis does not say how a gap is found in a view.
Here a gap is where a wall ends, another begins, and all surfaces seen between the two are farther
away than the straight line between these two ends. Exits are part of the transient map: each is
remembered where it was last seen, and forgotten if a later view shows it to be shut. Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import rotate_back
from albot_core.geometry.segment_kernels import crosses_line, distance_left_of, transform_segment
from albot_core.geometry.types import Segments
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Albot1Limits
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView
from albot_core.matching.lines import line_length
from albot_core.sensing.view import CORNER, OCCLUDING

EXIT_RANGE = 6.0
"""Gaps farther away than this are ignored (m): there neighbouring beams are 10 cm apart."""
JAMB = 0.35
"""A surface at a gap's side that is shorter than this may be the wall's face in the gap (m)."""
WALL = 0.25
"""Minimum length of a wall beside a gap (m)."""
ASLANT = np.radians(30.0)
"""Maximum angle between such a wall and the line across the gap (rad)."""
MAX_EXITS = 48
"""Maximum number of exits that a robot remembers; the farthest is forgotten for a new one."""
SEEN_EXIT_RANGE = 0.6
"""Exits whose middles are nearer than this are one exit (m)."""
NEARBY = 3.0
"""When the robot leaves a place, exits farther away than this are forgotten (m)."""
THROUGH = 0.3
"""A robot has crossed an exit once it is this far beyond its line (m)."""
FAR = 1.0
"""It has crossed an exit that it does not see once it is this far beyond its line (m)…"""
WIDE = 3.0
"""…unless it has moved this far sideways before (m)."""
ASIDE = 1.2
"""An expected exit this near to a seen one is the same exit (m): the map may have drifted."""
NOT_CROSSING, CROSSING_SEEN, CROSSING_EXPECTED = 0, 1, 2
"""Values of `ExitMemory.counts[1]`: the robot stands in no exit whose line it has passed; in one
that it has seen; in one that is only expected."""


class ExitMemory(NamedTuple):
    """The arrays of the exits that one robot remembers."""

    lines: np.ndarray
    """(MAX_EXITS, 4) float64: the exits' ends x1, y1, x2, y2 in the map's frame (m)."""
    crossing: np.ndarray
    """(5,) float64: the exit whose line the robot has passed, and the side it came from (-1, 1)."""
    counts: np.ndarray
    """(3,) int64: number of exits; state of the crossing (see NOT_CROSSING); number of exits
    expected."""
    expected: np.ndarray
    """(MAX_EXITS, 4) float64: expected positions of the present place's known exits, as `lines`."""


def empty_exits() -> ExitMemory:
    """Return the exits of a robot that has seen none."""
    return ExitMemory(
        np.zeros((MAX_EXITS, 4)), np.zeros(5), np.zeros(3, np.int64), np.zeros((MAX_EXITS, 4))
    )


@kernel()
def find_exits(view: LocatedView, limits: Albot1Limits, lines: np.ndarray) -> int:
    """Write the exits in view into `lines` (n, 4), in the robot's frame; return their number.

    An exit runs from the end of one surface to the beginning of a later one, right to left
    as the robot sees it, so that the robot is to its left.
    """
    found = 0
    for i in range(view.size[0] - 1):
        # A surface that hides nothing at its end can open only towards the next surface.
        last = view.size[0] if view.edges[i, 1] == OCCLUDING else i + 2
        for j in range(i + 1, last):
            if found == lines.shape[0]:
                return found
            if _opens(view, i, j) and _measure_gap(view, i, j, lines[found], limits):
                found += 1
                break
    return found


@kernel()
def _opens(view: LocatedView, i: int, j: int) -> bool:
    """Return whether a gap is possible between surfaces i and j: one hides what is behind it."""
    right, left = view.edges[i, 1] == OCCLUDING, view.edges[j, 0] == OCCLUDING
    return bool(right or left if j == i + 1 else right and left)


@kernel()
def _measure_gap(view: LocatedView, i: int, j: int, line: np.ndarray, limits: Albot1Limits) -> bool:
    """Write the line (4,) across the gap between two surfaces; return whether it is an exit."""
    right, left = _wall_at(view, i, 0), _wall_at(view, j, 1)
    px, py = view.surfaces[right, 2], view.surfaces[right, 3]
    qx, qy = view.surfaces[left, 0], view.surfaces[left, 1]
    dx, dy = qx - px, qy - py
    width = np.sqrt(dx * dx + dy * dy)
    if (
        width < limits.min_exit_width
        or width > limits.max_exit_width
        or px * px + py * py > EXIT_RANGE**2
    ):
        return False
    if distance_left_of(px, py, qx, qy, 0.0, 0.0) < 0.0:
        return False
    # All surfaces between the two must lie behind the line.
    for k in range(i + 1, j):
        for end in range(2):
            x, y = view.surfaces[k, 2 * end], view.surfaces[k, 2 * end + 1]
            if distance_left_of(px, py, qx, qy, x, y) > -0.05:
                return False
    line[0], line[1], line[2], line[3] = px, py, qx, qy
    walls = view.surfaces
    return bool(_runs_along(walls[right], dx, dy) and _runs_along(walls[left], dx, dy))


@kernel()
def _wall_at(view: LocatedView, k: int, side: int) -> int:
    """Return the wall whose end bounds a gap, past the face that the wall has in the gap."""
    beside = k - 1 if side == 0 else k + 1
    is_corner = 0 <= beside < view.size[0] and view.edges[k, side] == CORNER
    return beside if is_corner and line_length(view.surfaces[k]) < JAMB else k


@kernel()
def _runs_along(surface: np.ndarray, dx: float, dy: float) -> bool:
    """Return whether a surface is a wall that runs along the direction (dx, dy)."""
    ux, uy = surface[2] - surface[0], surface[3] - surface[1]
    length = np.sqrt(ux * ux + uy * uy)
    along = abs(ux * dx + uy * dy) / (length * np.sqrt(dx * dx + dy * dy))
    return bool(length >= WALL and along >= np.cos(ASLANT))


_along, _across, _seen, _in_map = scratch(4), scratch(4), scratch(16, 4), scratch(4)


@kernel()
def remember_exits(exits: ExitMemory, view: LocatedView, limits: Albot1Limits) -> None:
    """Remember the exits in view at their present position, and forget those seen to be shut."""
    pose = view.pose
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    # Forget exits that are shut.
    k = 0
    while k < exits.counts[0]:
        line = exits.lines[k]
        dx, dy = line[0] - pose[0], line[1] - pose[1]
        if dx * dx + dy * dy < EXIT_RANGE * EXIT_RANGE and _is_shut(line, view, cos, sin):
            _forget_exit(exits, k)
        else:
            k += 1
    # Each exit in view replaces a remembered one nearby, or is a new one.
    seen, in_map = _seen(), _in_map()
    for k in range(find_exits(view, limits, seen)):
        transform_segment(pose, seen[k], in_map)
        x, y = 0.5 * (in_map[0] + in_map[2]), 0.5 * (in_map[1] + in_map[3])
        which, away = nearest_exit(exits, x, y)
        if away >= SEEN_EXIT_RANGE:
            if exits.counts[0] == exits.lines.shape[0]:
                _forget_exit(exits, _farthest(exits, pose[0], pose[1]))
            which = exits.counts[0]
            exits.counts[0] += 1
        for i in range(4):
            exits.lines[which, i] = in_map[i]


@kernel()
def _is_shut(line: np.ndarray, view: LocatedView, cos: float, sin: float) -> bool:
    """Return whether a surface of the view stands in the middle of a remembered exit.

    The surface crosses the middle half of the exit's line or, as a shut door does, runs along it.
    """
    x = 0.5 * (line[0] + line[2]) - view.pose[0]
    y = 0.5 * (line[1] + line[3]) - view.pose[1]
    east, north = rotate_back(cos, sin, x, y)
    dx, dy = rotate_back(cos, sin, line[2] - line[0], line[3] - line[1])
    ux, uy = 0.25 * dx, 0.25 * dy
    along, across = _along(), _across()
    along[0], along[1], along[2], along[3] = east - ux, north - uy, east + ux, north + uy
    across[0], across[1], across[2], across[3] = east + uy, north - ux, east - uy, north + ux
    for k in range(view.size[0]):
        wall = view.surfaces[k]
        if crosses_line(along, wall[0], wall[1], wall[2], wall[3]):
            return True
        if crosses_line(across, wall[0], wall[1], wall[2], wall[3]):
            return True
    return False


@kernel()
def nearest_exit(exits: ExitMemory, x: float, y: float) -> tuple[int, float]:
    """Return the remembered exit whose middle is nearest to a point, and its distance (m)."""
    best, which = np.inf, -1
    for k in range(exits.counts[0]):
        dx = 0.5 * (exits.lines[k, 0] + exits.lines[k, 2]) - x
        dy = 0.5 * (exits.lines[k, 1] + exits.lines[k, 3]) - y
        square = dx * dx + dy * dy
        if square < best:
            best, which = square, k
    return which, np.sqrt(best)


@kernel()
def _farthest(exits: ExitMemory, x: float, y: float) -> int:
    """Return the remembered exit farthest from a point."""
    best, which = -1.0, 0
    for k in range(exits.counts[0]):
        dx, dy = exits.lines[k, 0] - x, exits.lines[k, 1] - y
        if dx * dx + dy * dy > best:
            best, which = dx * dx + dy * dy, k
    return which


@kernel()
def _forget_exit(exits: ExitMemory, k: int) -> None:
    """Forget an exit; the last exit takes its index in the list."""
    last = exits.counts[0] - 1
    for i in range(4):
        exits.lines[k, i] = exits.lines[last, i]
    exits.counts[0] = last


@kernel()
def cross_exit(exits: ExitMemory, ax: float, ay: float, pose: np.ndarray) -> bool:
    """Process the motion from (ax, ay) to `pose`; return whether the robot crossed an exit.

    The exit's line is then in `exits.crossing`. A robot that has passed the line has crossed the
    exit only when it is THROUGH beyond it, so that moving to and fro in a doorway does not cross it
    often. The robot also crosses known exits that it does not see, where they are expected: a
    doorway seen at a sharp angle, or with something beside it, may not look like one. Then the
    robot must come FAR beyond the line, and must not move WIDE sideways first, as it would if the
    line lay in a corridor by error. And it must pass no other exit, above all none that it sees,
    which may be the expected one.
    """
    x, y, crossing, counts = pose[0], pose[1], exits.crossing, exits.counts
    if counts[1] != CROSSING_SEEN:
        _note_passed(exits, ax, ay, x, y, CROSSING_SEEN)
    if counts[1] != CROSSING_SEEN:
        _note_passed(exits, ax, ay, x, y, CROSSING_EXPECTED)
    if counts[1] == CROSSING_EXPECTED and _is_aside(crossing, x, y):
        counts[1] = NOT_CROSSING
    if counts[1] == NOT_CROSSING:
        return False
    through = -crossing[4] * distance_left_of(
        crossing[0], crossing[1], crossing[2], crossing[3], x, y
    )
    if abs(through) < (THROUGH if counts[1] == CROSSING_SEEN else FAR):
        return False
    counts[1] = NOT_CROSSING
    return bool(through > 0.0)


@kernel()
def _note_passed(exits: ExitMemory, ax: float, ay: float, x: float, y: float, what: int) -> None:
    """Start the crossing of the exit nearest to (x, y) among those that the motion there passes.

    If `what` is CROSSING_SEEN, only exits seen are considered. If it is CROSSING_EXPECTED, only
    those expected and not seen, except the one being crossed: a robot that goes back through it has
    crossed nothing.
    """
    lines, count = exits.lines, exits.counts[0]
    if what == CROSSING_EXPECTED:
        lines, count = exits.expected, exits.counts[2]
    nearest = np.inf
    for k in range(count):
        line = lines[k]
        is_candidate = what == CROSSING_SEEN or not (
            _is_being_crossed(exits, line) or _is_seen(exits, line)
        )
        if is_candidate and crosses_line(line, ax, ay, x, y):
            dx, dy = 0.5 * (line[0] + line[2]) - x, 0.5 * (line[1] + line[3]) - y
            if dx * dx + dy * dy < nearest:
                nearest = dx * dx + dy * dy
                for i in range(4):
                    exits.crossing[i] = line[i]
                side = distance_left_of(line[0], line[1], line[2], line[3], ax, ay)
                exits.crossing[4] = 1.0 if side > 0.0 else -1.0
                exits.counts[1] = what


@kernel()
def _is_seen(exits: ExitMemory, line: np.ndarray) -> bool:
    """Return whether an exit has been seen near an expected one."""
    _, away = nearest_exit(exits, 0.5 * (line[0] + line[2]), 0.5 * (line[1] + line[3]))
    return bool(away < ASIDE)


@kernel()
def _is_being_crossed(exits: ExitMemory, line: np.ndarray) -> bool:
    """Return whether the robot stands in this exit."""
    same = exits.counts[1] != NOT_CROSSING
    for i in range(4):
        same = same and exits.crossing[i] == line[i]
    return bool(same)


@kernel()
def _is_aside(crossing: np.ndarray, x: float, y: float) -> bool:
    """Return whether a point is WIDE sideways of an exit's middle."""
    dx, dy = crossing[2] - crossing[0], crossing[3] - crossing[1]
    along = dx * (x - 0.5 * (crossing[0] + crossing[2])) + dy * (
        y - 0.5 * (crossing[1] + crossing[3])
    )
    return bool(abs(along) > WIDE * np.sqrt(dx * dx + dy * dy))


def expect_exits(exits: ExitMemory, lines: Segments) -> None:
    """Set the expected exits to `lines` (n, 4; map frame, m), only the last MAX_EXITS of them."""
    lines = lines[-MAX_EXITS:]
    exits.expected[: len(lines)] = lines
    exits.counts[2] = len(lines)


def leave_exits(exits: ExitMemory, x: float, y: float) -> None:
    """Forget the exits of the place left at (x, y), except those nearby: the new place has them.

    When the robot comes back they are seen again, at other positions if the map has drifted since.
    """
    lines = exits.lines[: exits.counts[0]]
    away = np.hypot(*(0.5 * (lines[:, :2] + lines[:, 2:]) - (x, y)).T)
    kept = lines[away < NEARBY]
    exits.lines[: len(kept)] = kept
    exits.counts[0] = len(kept)
