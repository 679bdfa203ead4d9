"""The event of crossing an exit, one that is seen or one that is known. Compiled."""

from __future__ import annotations

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.albot1.exits import EXPECTED, GATE, NO_GATE, Exits, nearest_exit
from albot_core.mappers.albot1.gaps import beyond, crosses

THROUGH = 0.3
"""A robot has crossed an exit once it is this far beyond its line (m)."""

FAR = 1.0
"""It has crossed one that it does not see once it is this far beyond its line (m)…"""
WIDE = 3.0
"""…unless it has gone so far aside before (m)."""
ASIDE = 1.2
"""An exit expected so near to one that is seen (m) is that one: the map may have drifted."""


@kernel()
def _is_seen(exits: Exits, line: np.ndarray) -> bool:
    """Whether an exit is remembered about where one is expected."""
    _, away = nearest_exit(exits, 0.5 * (line[0] + line[2]), 0.5 * (line[1] + line[3]))
    return bool(away < ASIDE)


@kernel()
def _is_gate(exits: Exits, line: np.ndarray) -> bool:
    """Whether the robot stands in this exit."""
    same = exits.counts[1] != NO_GATE
    for i in range(4):
        same = same and exits.gate[i] == line[i]
    return bool(same)


@kernel()
def _is_aside(gate: np.ndarray, x: float, y: float) -> bool:
    """Whether a point is WIDE aside of an exit's middle."""
    dx, dy = gate[2] - gate[0], gate[3] - gate[1]
    along = dx * (x - 0.5 * (gate[0] + gate[2])) + dy * (y - 0.5 * (gate[1] + gate[3]))
    return bool(abs(along) > WIDE * np.sqrt(dx * dx + dy * dy))


@kernel()
def _pass(exits: Exits, ax: float, ay: float, x: float, y: float, what: int) -> None:
    """Note as the gate the exit nearest to (x, y), if any, that was passed on the way there.

    Of the exits remembered, where `what` is GATE; if EXPECTED, of those expected and not seen,
    but for the gate itself: who goes back through that has crossed nothing.
    """
    lines, count = exits.lines, exits.counts[0]
    if what == EXPECTED:
        lines, count = exits.expected, exits.counts[2]
    nearest = np.inf
    for k in range(count):
        line = lines[k]
        is_candidate = what == GATE or not (_is_gate(exits, line) or _is_seen(exits, line))
        if is_candidate and crosses(line, ax, ay, x, y):
            dx, dy = 0.5 * (line[0] + line[2]) - x, 0.5 * (line[1] + line[3]) - y
            if dx * dx + dy * dy < nearest:
                nearest = dx * dx + dy * dy
                for i in range(4):
                    exits.gate[i] = line[i]
                side = beyond(line[0], line[1], line[2], line[3], ax, ay)
                exits.gate[4] = 1.0 if side > 0.0 else -1.0
                exits.counts[1] = what


@kernel()
def cross_exit(exits: Exits, ax: float, ay: float, pose: np.ndarray) -> bool:
    """Whether on the way from (ax, ay) to `pose` the robot got through an exit.

    Its line is then in `exits.gate`. A robot that has passed the line is through only when
    it is THROUGH beyond it, so that one that dithers in a doorway does not cross it often.
    It also gets through known exits that it does not see, where they are expected: aslant, or
    with something beside it, a doorway may not look like one. Then it must come FAR beyond,
    and not WIDE aside first, as it would where the line lies in a corridor by error; and pass no
    other, least of all one that it sees, for it may be that one.
    """
    x, y, gate, counts = pose[0], pose[1], exits.gate, exits.counts
    if counts[1] != GATE:
        _pass(exits, ax, ay, x, y, GATE)
    if counts[1] != GATE:
        _pass(exits, ax, ay, x, y, EXPECTED)
    if counts[1] == EXPECTED and _is_aside(gate, x, y):
        counts[1] = NO_GATE
    if counts[1] == NO_GATE:
        return False
    through = -gate[4] * beyond(gate[0], gate[1], gate[2], gate[3], x, y)
    if abs(through) < (THROUGH if counts[1] == GATE else FAR):
        return False
    counts[1] = NO_GATE
    return bool(through > 0.0)
