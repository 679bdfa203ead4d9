"""Exits seen and remembered in the perceptual map.

Exits are part of the transient map: each is remembered where it was last seen, and what a
later view shows to be shut is forgotten. Compiled, for many robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Segments
from albot_core.kernels.compiled import kernel, scratch
from albot_core.mappers.albot1.config import Limits
from albot_core.mappers.albot1.gaps import REACH, crosses, find_exits
from albot_core.mappers.albot1.sight import Sight

ROOM = 48
"""Exits that a robot remembers; the farthest is forgotten for a new one."""
SAME = 0.6
"""Exits whose middles are nearer than this are one (m)."""
NEARBY = 3.0
"""When a place is left, exits farther away are forgotten (m)."""
NO_GATE, GATE, EXPECTED = 0, 1, 2
"""In `Exits.counts[1]`: whether the robot stands in an exit whose line it has passed; of one that
is seen, or of one that is only expected."""


class Exits(NamedTuple):
    """The arrays of the exits that one robot remembers."""

    lines: np.ndarray
    """(ROOM, 4) float64: their ends x1, y1, x2, y2 in the map's frame (m)."""
    gate: np.ndarray
    """(5,) float64: the exit whose line the robot has passed, and from which side (-1, 1)."""
    counts: np.ndarray
    """(3,) int64: exits remembered; NO_GATE, GATE or EXPECTED; exits expected."""
    expected: np.ndarray
    """(ROOM, 4) float64: where known exits of the present place should be, as `lines`."""


def no_exits() -> Exits:
    """The exits of a robot that has seen none."""
    return Exits(np.zeros((ROOM, 4)), np.zeros(5), np.zeros(3, np.int64), np.zeros((ROOM, 4)))


def expect_exits(exits: Exits, lines: Segments) -> None:
    """Expect exits at `lines` (n, 4), in the map's frame (m), and no others; only the last ROOM."""
    lines = lines[-ROOM:]
    exits.expected[: len(lines)] = lines
    exits.counts[2] = len(lines)


@kernel()
def _forget(exits: Exits, k: int) -> None:
    last = exits.counts[0] - 1
    for i in range(4):
        exits.lines[k, i] = exits.lines[last, i]
    exits.counts[0] = last


@kernel()
def nearest_exit(exits: Exits, x: float, y: float) -> tuple[int, float]:
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
def _farthest(exits: Exits, x: float, y: float) -> int:
    best, which = -1.0, 0
    for k in range(exits.counts[0]):
        dx, dy = exits.lines[k, 0] - x, exits.lines[k, 1] - y
        if dx * dx + dy * dy > best:
            best, which = dx * dx + dy * dy, k
    return which


_along, _across, _seen, _placed = scratch(4), scratch(4), scratch(16, 4), scratch(4)


@kernel()
def _is_shut(line: np.ndarray, sight: Sight, cos: float, sin: float) -> bool:
    """Whether a surface of the view stands in the middle of a remembered exit.

    It crosses the middle half of the exit's line, or, as a shut door does, runs along it.
    """
    x = 0.5 * (line[0] + line[2]) - sight.pose[0]
    y = 0.5 * (line[1] + line[3]) - sight.pose[1]
    east, north = cos * x + sin * y, cos * y - sin * x
    dx, dy = line[2] - line[0], line[3] - line[1]
    ux, uy = 0.25 * (cos * dx + sin * dy), 0.25 * (cos * dy - sin * dx)
    along, across = _along(), _across()
    along[0], along[1], along[2], along[3] = east - ux, north - uy, east + ux, north + uy
    across[0], across[1], across[2], across[3] = east + uy, north - ux, east - uy, north + ux
    for k in range(sight.size[0]):
        wall = sight.surfaces[k]
        if crosses(along, wall[0], wall[1], wall[2], wall[3]):
            return True
        if crosses(across, wall[0], wall[1], wall[2], wall[3]):
            return True
    return False


@kernel()
def remember_exits(exits: Exits, sight: Sight, limits: Limits) -> None:
    """Remember the exits in view where they are seen now, and forget those seen to be shut."""
    pose = sight.pose
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    k = 0
    while k < exits.counts[0]:
        line = exits.lines[k]
        dx, dy = line[0] - pose[0], line[1] - pose[1]
        if dx * dx + dy * dy < REACH * REACH and _is_shut(line, sight, cos, sin):
            _forget(exits, k)
        else:
            k += 1
    seen, placed = _seen(), _placed()
    for k in range(find_exits(sight, limits, seen)):
        for end in range(2):
            x, y = seen[k, 2 * end], seen[k, 2 * end + 1]
            placed[2 * end] = pose[0] + cos * x - sin * y
            placed[2 * end + 1] = pose[1] + sin * x + cos * y
        x, y = 0.5 * (placed[0] + placed[2]), 0.5 * (placed[1] + placed[3])
        which, away = nearest_exit(exits, x, y)
        if away >= SAME:
            if exits.counts[0] == exits.lines.shape[0]:
                _forget(exits, _farthest(exits, pose[0], pose[1]))
            which = exits.counts[0]
            exits.counts[0] += 1
        for i in range(4):
            exits.lines[which, i] = placed[i]


def leave_exits(exits: Exits, x: float, y: float) -> None:
    """A place is left at (x, y): forget its exits but those nearby, of the place entered.

    When the robot comes back they are seen again, and elsewhere if the map has drifted since.
    """
    lines = exits.lines[: exits.counts[0]]
    away = np.hypot(*(0.5 * (lines[:, :2] + lines[:, 2:]) - (x, y)).T)
    kept = lines[away < NEARBY]
    exits.lines[: len(kept)] = kept
    exits.counts[0] = len(kept)


def stored_exits(exits: Exits) -> dict[str, np.ndarray]:
    """Copies of the fields, as far as they are in use."""
    return {
        "lines": exits.lines[: exits.counts[0]].copy(),
        "gate": exits.gate.copy(),
        "counts": exits.counts[:2].copy(),
    }


def rebuilt_exits(stored: Mapping[str, np.ndarray]) -> Exits:
    """The exits with the given fields.

    Raises:
        InputError: The fields contradict each other.
    """
    exits = no_exits()
    lines, counts = stored["lines"], stored["counts"]
    if counts.shape != (2,) or counts.tolist() not in [
        [len(lines), gate] for gate in (NO_GATE, GATE, EXPECTED)
    ]:
        raise InputError("exits.counts", f"{len(lines)} and 0 to 2", str(counts.tolist()))
    if len(lines) > ROOM or lines.shape[1:] != (4,) or stored["gate"].shape != (5,):
        found = f"{lines.shape} and {stored['gate'].shape}"
        raise InputError("exits.lines", f"shapes (up to {ROOM}, 4) and (5,)", found)
    if not (np.isfinite(lines).all() and np.isfinite(stored["gate"]).all()):
        raise InputError("exits.lines", "finite numbers", "NaN or infinity")
    exits.lines[: len(lines)] = lines
    exits.gate[:], exits.counts[:2] = stored["gate"], counts
    return exits
