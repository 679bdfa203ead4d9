"""Exits: found in a view, remembered in the perceptual map, and crossed (section 4.1.1).

An exit is a gap of doorway size, about 1 m. The thesis does not say how a gap is found in a view;
here it is where a wall ends, another begins, and all that is seen between the two is farther than
the straight line from the one to the other. Exits are part of the transient map: each is
remembered where it was last seen, and what a later view shows to be shut is forgotten. Compiled.
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
"""Gaps farther away are not looked at (m): there a beam is 10 cm from the next."""
JAMB = 0.35
"""A surface this short at a gap's side may be the wall's face in the gap (m)."""
WALL = 0.25
"""A wall beside a gap is at least this long (m)…"""
ASLANT = np.radians(30.0)
"""…and turned no more than this from the line across the gap (rad)."""
MAX_EXITS = 48
"""Exits that a robot remembers; the farthest is forgotten for a new one."""
SEEN_EXIT_RANGE = 0.6
"""Exits whose middles are nearer than this are one (m)."""
NEARBY = 3.0
"""When a place is left, exits farther away are forgotten (m)."""
THROUGH = 0.3
"""A robot has crossed an exit once it is this far beyond its line (m)."""
FAR = 1.0
"""It has crossed one that it does not see once it is this far beyond its line (m)…"""
WIDE = 3.0
"""…unless it has gone so far aside before (m)."""
ASIDE = 1.2
"""An exit expected so near to one that is seen (m) is that one: the map may have drifted."""
NOT_CROSSING, CROSSING_SEEN, CROSSING_EXPECTED = 0, 1, 2
"""In `ExitMemory.counts[1]`: whether the robot stands in an exit whose line it has passed; in one
that it has seen, or in one that is only expected."""


class ExitMemory(NamedTuple):
    """The arrays of the exits that one robot remembers."""

    lines: np.ndarray
    """(MAX_EXITS, 4) float64: their ends x1, y1, x2, y2 in the map's frame (m)."""
    crossing: np.ndarray
    """(5,) float64: the exit whose line the robot has passed, and from which side (-1, 1)."""
    counts: np.ndarray
    """(3,) int64: exits remembered; whether one is crossed (see NOT_CROSSING); exits expected."""
    expected: np.ndarray
    """(MAX_EXITS, 4) float64: where known exits of the present place should be, as `lines`."""


def empty_exits() -> ExitMemory:
    """The exits of a robot that has seen none."""
    return ExitMemory(
        np.zeros((MAX_EXITS, 4)), np.zeros(5), np.zeros(3, np.int64), np.zeros((MAX_EXITS, 4))
    )


@kernel()
def find_exits(view: LocatedView, limits: Albot1Limits, lines: np.ndarray) -> int:
    """Write the exits in view into `lines` (n, 4), in the robot's frame; return how many.

    An exit runs from the end of one surface to the beginning of a later one, right to left
    as the robot sees it, so that the robot is to its left.
    """
    found = 0
    for i in range(view.size[0] - 1):
        # What hides nothing at its end can open only towards the next surface.
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
    """Whether there may be a gap between the surfaces i and j: one hides what is behind it."""
    right, left = view.edges[i, 1] == OCCLUDING, view.edges[j, 0] == OCCLUDING
    return bool(right or left if j == i + 1 else right and left)


@kernel()
def _measure_gap(view: LocatedView, i: int, j: int, line: np.ndarray, limits: Albot1Limits) -> bool:
    """Write the line (4,) across the gap between two surfaces. Returns whether it is an exit."""
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
    # All that is seen between the two must lie behind the line.
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
    """The wall whose end a gap begins at, past the face that the wall has in the gap."""
    beside = k - 1 if side == 0 else k + 1
    is_corner = 0 <= beside < view.size[0] and view.edges[k, side] == CORNER
    return beside if is_corner and line_length(view.surfaces[k]) < JAMB else k


@kernel()
def _runs_along(surface: np.ndarray, dx: float, dy: float) -> bool:
    """Whether a surface is a wall that runs along the direction (dx, dy)."""
    ux, uy = surface[2] - surface[0], surface[3] - surface[1]
    length = np.sqrt(ux * ux + uy * uy)
    along = abs(ux * dx + uy * dy) / (length * np.sqrt(dx * dx + dy * dy))
    return bool(length >= WALL and along >= np.cos(ASLANT))


_along, _across, _seen, _in_map = scratch(4), scratch(4), scratch(16, 4), scratch(4)


@kernel()
def remember_exits(exits: ExitMemory, view: LocatedView, limits: Albot1Limits) -> None:
    """Remember the exits in view where they are seen now, and forget those seen to be shut."""
    pose = view.pose
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    # Forget what is shut.
    k = 0
    while k < exits.counts[0]:
        line = exits.lines[k]
        dx, dy = line[0] - pose[0], line[1] - pose[1]
        if dx * dx + dy * dy < EXIT_RANGE * EXIT_RANGE and _is_shut(line, view, cos, sin):
            _forget_exit(exits, k)
        else:
            k += 1
    # Each exit in view takes the place of a remembered one nearby, or is a new one.
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
    """Whether a surface of the view stands in the middle of a remembered exit.

    It crosses the middle half of the exit's line, or, as a shut door does, runs along it.
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
    """The remembered exit with its middle nearest to a point, and how near (m)."""
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
    """The remembered exit farthest from a point."""
    best, which = -1.0, 0
    for k in range(exits.counts[0]):
        dx, dy = exits.lines[k, 0] - x, exits.lines[k, 1] - y
        if dx * dx + dy * dy > best:
            best, which = dx * dx + dy * dy, k
    return which


@kernel()
def _forget_exit(exits: ExitMemory, k: int) -> None:
    """Forget an exit; the last one takes its place in the list."""
    last = exits.counts[0] - 1
    for i in range(4):
        exits.lines[k, i] = exits.lines[last, i]
    exits.counts[0] = last


@kernel()
def cross_exit(exits: ExitMemory, ax: float, ay: float, pose: np.ndarray) -> bool:
    """Note the way from (ax, ay) to `pose`. Returns whether the robot got through an exit.

    Its line is then in `exits.crossing`. A robot that has passed the line is through only when
    it is THROUGH beyond it, so that one that dithers in a doorway does not cross it often.
    It also gets through known exits that it does not see, where they are expected: seen aslant, or
    with something beside it, a doorway may not look like one. Then the robot must come FAR beyond
    the line, and not WIDE aside first, as it would where the line lies in a corridor by error.
    And it must pass no other exit, least of all one that it sees, which may be the one expected.
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
    """Note as being crossed the exit nearest to (x, y), if any, that was passed on the way there.

    If `what` is CROSSING_SEEN, of the exits seen; if CROSSING_EXPECTED, of those expected and not
    seen, but for the one being crossed: a robot that goes back through it has crossed nothing.
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
    """Whether an exit is remembered about where one is expected."""
    _, away = nearest_exit(exits, 0.5 * (line[0] + line[2]), 0.5 * (line[1] + line[3]))
    return bool(away < ASIDE)


@kernel()
def _is_being_crossed(exits: ExitMemory, line: np.ndarray) -> bool:
    """Whether the robot stands in this exit."""
    same = exits.counts[1] != NOT_CROSSING
    for i in range(4):
        same = same and exits.crossing[i] == line[i]
    return bool(same)


@kernel()
def _is_aside(crossing: np.ndarray, x: float, y: float) -> bool:
    """Whether a point is WIDE aside of an exit's middle."""
    dx, dy = crossing[2] - crossing[0], crossing[3] - crossing[1]
    along = dx * (x - 0.5 * (crossing[0] + crossing[2])) + dy * (
        y - 0.5 * (crossing[1] + crossing[3])
    )
    return bool(abs(along) > WIDE * np.sqrt(dx * dx + dy * dy))


def expect_exits(exits: ExitMemory, lines: Segments) -> None:
    """Expect exits at `lines` (n, 4; map frame, m), and no others; only the last MAX_EXITS."""
    lines = lines[-MAX_EXITS:]
    exits.expected[: len(lines)] = lines
    exits.counts[2] = len(lines)


def leave_exits(exits: ExitMemory, x: float, y: float) -> None:
    """Forget the exits of the place left at (x, y), but those nearby: they are the new place's.

    When the robot comes back they are seen again, and elsewhere if the map has drifted since.
    """
    lines = exits.lines[: exits.counts[0]]
    away = np.hypot(*(0.5 * (lines[:, :2] + lines[:, 2:]) - (x, y)).T)
    kept = lines[away < NEARBY]
    exits.lines[: len(kept)] = kept
    exits.counts[0] = len(kept)
