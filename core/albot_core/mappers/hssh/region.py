"""The region around the robot: the ground up to the gateways, and the gateways in their order.

It is the place's distinguishing region, of which the star is read off (Beeson et al. 2010,
section 5): the border is followed counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.gateways import FREE, UNKNOWN, GatewayConfig, Ground, Narrows
from albot_core.mappers.hssh.skeleton import COLUMNS, ROWS


@dataclass(frozen=True, kw_only=True, eq=False)
class Region:
    """The ground around the robot up to the gateways, and the gateways in their order."""

    gateways: Segments
    """The gateways around it, counter-clockwise, each with the region to its left (m)."""
    unknown: tuple[int, ...]
    """Where its border was not seen, and the robot may fit through: k for between gateway k and the
    one before."""
    inside: Bool[np.ndarray, "rows columns"]
    """Whether each cell belongs to it: the distinguishing region, where the robot is at the place.
    On the ground beyond a gateway it is under way along a path (the control region)."""
    peak: Float64[np.ndarray, "2"]
    """The middle of its most open ground (m)."""
    clearance: float
    """Distance from there to the nearest wall (m)."""

    @property
    def is_whole(self) -> bool:
        """Whether the region was seen to its border."""
        return not self.unknown

    @property
    def middles(self) -> Points:
        """The middles of the gateways (m)."""
        return np.asarray((self.gateways[:, :2] + self.gateways[:, 2:]) / 2)

    @property
    def widths(self) -> Float64[np.ndarray, "gateways"]:
        """The widths of the gateways (m)."""
        return np.asarray(np.hypot(*(self.gateways[:, 2:] - self.gateways[:, :2]).T))

    def is_narrow(self, config: GatewayConfig) -> bool:
        """Return whether it is hardly wider than its widest gateway, like a corridor."""
        widest = self.widths.max(initial=0.0)
        return bool(self.clearance * config.ratio <= 0.5 * widest)

    def is_path(self, config: GatewayConfig) -> bool:
        """Return whether it is a piece of a path: it leads from one gateway to the one ahead."""
        leads_on = continuations(self.gateways, config.straight) == (1, 0)
        return leads_on and self.is_narrow(config)


def region_around(
    ground: Ground, narrows: Narrows, robot: Float64[np.ndarray, "2"], narrowest: float = 0.5
) -> Region | None:
    """Return the region in which the robot is; None if it stands in a gateway or on unknown ground.

    Args:
        ground: The part of the local map.
        narrows: Its gateways.
        robot: The robot's position (m).
        narrowest: Smallest width of what the robot fits through (m).
    """
    rows, columns = ground.states.shape
    column, row = np.floor((robot - ground.corner) / ground.cell).astype(int).tolist()
    if not (0 <= row < rows and 0 <= column < columns):
        return None
    labels = _labels_of(ground.states)
    ends = np.floor((narrows.gateways.reshape(-1, 2, 2) - ground.corner) / ground.cell)
    cells = ends.astype(np.int64)
    draw_lines(labels, cells)
    if labels[row, column] != 1:
        return None
    low, best, sides = _fill(labels, narrows.clearance, row, column)
    chosen, unknown = surround(labels, _leading(labels, cells), low, sides, narrowest / ground.cell)
    lines = narrows.gateways[chosen]
    _turn_to_region(labels, lines, ground.corner, ground.cell)
    return Region(
        gateways=lines,
        unknown=tuple(sorted(set((unknown % max(len(chosen), 1)).tolist()))),
        inside=labels == _INSIDE,
        peak=ground.centres(np.array([best], np.int64))[0],
        clearance=float(narrows.clearance[best]) * ground.cell,
    )


_INSIDE, _UNSEEN = 2, 3


@kernel(arrays=True)
def _labels_of(states: np.ndarray) -> np.ndarray:
    """Return the label of each cell: 1 for free, 0 for walls, `_UNSEEN` for unknown ones."""
    labels = np.empty(states.shape, np.int32)
    for i in range(states.shape[0]):
        for j in range(states.shape[1]):
            is_unseen = states[i, j] == UNKNOWN
            labels[i, j] = _UNSEEN if is_unseen else states[i, j] == FREE
    return labels


@kernel()
def _turn_to_region(labels: np.ndarray, lines: np.ndarray, corner: np.ndarray, cell: float) -> None:
    """Turn the gateways that do not have the region to their left.

    Args:
        labels: `_INSIDE` for the region's cells (rows, columns).
        lines: The gateways, changed in place (gateways, 4) (m).
        corner: x, y of the outer corner of the first cell (m).
        cell: Side of a cell (m).
    """
    rows, columns = labels.shape
    for k in range(len(lines)):
        across, up = lines[k, 2] - lines[k, 0], lines[k, 3] - lines[k, 1]
        length = max(math.sqrt(across * across + up * up), 1e-9)
        balance = 0  # Cells of the region to the left less those to the right.
        for step in (-3.5, -2.5, -1.5, 1.5, 2.5, 3.5):
            x = 0.5 * (lines[k, 0] + lines[k, 2]) - step * cell * up / length
            y = 0.5 * (lines[k, 1] + lines[k, 3]) + step * cell * across / length
            j = min(max(math.floor((x - corner[0]) / cell), 0), columns - 1)
            i = min(max(math.floor((y - corner[1]) / cell), 0), rows - 1)
            if labels[i, j] == _INSIDE:
                balance += 1 if step > 0.0 else -1
        if balance < 0:
            for n in range(2):
                lines[k, n], lines[k, n + 2] = lines[k, n + 2], lines[k, n]


@kernel()
def draw_lines(labels: np.ndarray, ends: np.ndarray) -> None:
    """Draw gateways into labels of cells, as -1, -2 and so on, over free cells (1) only.

    Args:
        labels: 1 for free cells, 0 for others (rows, columns).
        ends: Column and row of the ends of each gateway (gateways, 2, 2).
    """
    for k in range(len(ends)):
        across, up = ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1]
        steps = max(abs(across), abs(up), 1)
        for n in range(steps + 1):
            column = ends[k, 0, 0] + round(across * n / steps)
            row = ends[k, 0, 1] + round(up * n / steps)
            if labels[int(row), int(column)] == 1:
                labels[int(row), int(column)] = -1 - k


@kernel(arrays=True)
def surround(
    labels: np.ndarray, leads: np.ndarray, low: tuple[int, int], most: int, narrowest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the gateways along the region's border, counter-clockwise.

    Args:
        labels: `_INSIDE` for the region's cells, 1 for other free ones, 0 for walls, 3 for unseen
            cells, -1 - k for gateway k.
        leads: Whether each gateway has other free ground behind.
        low: Row and column of the first cell of the region's lowest row.
        most: Number of sides of cells along all borders of the region.
        narrowest: Smallest distance between the ends of an unseen part of the border (cells).

    Returns:
        The gateways that lead on, from the south on; and for each unseen part of the border the
        number of gateways before it.
    """
    sides, count = _border(labels, low[0], low[1], most)
    order, found = np.empty(len(leads), np.int64), 0
    unknown, parts = np.empty(count, np.int64), 0
    is_listed = np.zeros(len(leads), np.bool_)
    # From a side that was seen, so that no unseen part is cut in two.
    start = 0
    while start < count and sides[start, 2] == _UNSEEN:
        start += 1
    begin = -1  # The first side of the present unseen part.
    for k in range(count + 1):
        side = (start + k) % count
        right = sides[side, 2]
        if right == _UNSEEN:
            begin = side if begin < 0 else begin
        elif begin >= 0:
            up, across = sides[side, 0] - sides[begin, 0], sides[side, 1] - sides[begin, 1]
            if math.sqrt(up * up + across * across) >= narrowest:
                unknown[parts] = found
                parts += 1
            begin = -1
        if right < 0 and leads[-1 - right] and not is_listed[-1 - right]:
            is_listed[-1 - right] = True
            order[found] = -1 - right
            found += 1
    if start == count:  # Nothing of the border was seen.
        unknown[0], parts = 0, 1
    return order[:found].copy(), unknown[:parts].copy()


@kernel(arrays=True)
def _border(labels: np.ndarray, row: int, column: int, most: int) -> tuple[np.ndarray, int]:
    """Return the sides of cells along the region's border, and their number.

    Each is row and column of the cell, and the label to its right. The region lies to the left. The
    southern side of its lowest cell, in `row` and `column`, comes first, eastwards. There are at
    most `most`.
    """
    sides = np.empty((most, 3), np.int64)
    # `turn` counts quarter turns from the east.
    i, j, turn, count = row, column, 0, 0
    while count < len(sides):
        sides[count, 0], sides[count, 1] = i, j
        sides[count, 2] = labels[i + _UP[turn - 1], j + _ACROSS[turn - 1]]
        count += 1
        a, b = i + _UP[turn], j + _ACROSS[turn]
        c, d = a + _UP[turn - 1], b + _ACROSS[turn - 1]
        if labels[a, b] != _INSIDE:
            turn = (turn + 1) % 4
        elif labels[c, d] == _INSIDE:
            i, j, turn = c, d, (turn - 1) % 4
        else:
            i, j = a, b
        if i == row and j == column and turn == 0:
            break
    return sides, count


@kernel(arrays=True)
def _fill(
    labels: np.ndarray, clearance: np.ndarray, row: int, column: int
) -> tuple[tuple[int, int], tuple[int, int], int]:
    """Mark the region around a cell.

    Args:
        labels: 1 for free cells, 0 for walls, 3 for unseen cells, -1 - k for gateway k; the region
            becomes `_INSIDE`.
        clearance: Distance of each cell to the nearest wall (cells).
        row: The cell's row.
        column: Its column.

    Returns:
        Row and column of the first cell of its lowest row, and of its cell with the largest
        clearance; and the number of sides of cells along its borders.
    """
    columns = labels.shape[1]
    flat, open_by = labels.reshape(-1), clearance.reshape(-1)
    stack, size, sides = np.empty(labels.size, np.int32), 1, 0
    low = best = row * columns + column
    flat[low] = _INSIDE
    stack[0] = low
    while size:
        size -= 1
        cell = stack[size]
        low = min(low, cell)
        here = open_by[cell]
        if here > open_by[best] or (here == open_by[best] and cell < best):
            best = cell
        for step in (1, columns, -1, -columns):
            beside = cell + step
            if flat[beside] == 1:
                flat[beside] = _INSIDE
                stack[size] = beside
                size += 1
            elif flat[beside] != _INSIDE:
                sides += 1
    return (low // columns, low % columns), (best // columns, best % columns), sides


@kernel(arrays=True)
def _leading(labels: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return whether each gateway has free ground beside it that is not the region's.

    One with the region on both sides separates nothing, one with nothing behind leads nowhere.

    Args:
        labels: -1 - k for the cells of gateway k, 1 for free ground (rows, columns).
        ends: Column and row of the ends of each gateway (gateways, 2, 2).
    """
    leads = np.zeros(len(ends), np.bool_)
    for k in range(len(ends)):
        left, right = min(ends[k, 0, 0], ends[k, 1, 0]), max(ends[k, 0, 0], ends[k, 1, 0])
        low, high = min(ends[k, 0, 1], ends[k, 1, 1]), max(ends[k, 0, 1], ends[k, 1, 1])
        for i in range(low, high + 1):
            for j in range(left, right + 1):
                if labels[i, j] == -1 - k:
                    for n in range(8):
                        leads[k] |= labels[i + ROWS[n], j + COLUMNS[n]] == 1
    return leads


_UP = np.array((0, 1, 0, -1))
_ACROSS = np.array((1, 0, -1, 0))
"""The neighbours of a cell by its sides, counter-clockwise from the east."""


def continuations(gateways: Segments, straight: float) -> tuple[int, ...]:
    """Return for each gateway the one that continues its path; -1 if its path ends here.

    Two gateways continue one another if each lies ahead of the other (within `straight`) and they
    lead in opposite directions; where there are several, the straightest pair comes first.

    Args:
        gateways: The gateways of a place, each with the place to its left (m).
        straight: The largest angle (rad).
    """
    count = len(gateways)
    along = gateways[:, 2:] - gateways[:, :2]
    outward = np.arctan2(-along[:, 0], along[:, 1])
    middles = (gateways[:, :2] + gateways[:, 2:]) / 2
    pairs = []
    for i in range(count):
        for j in range(i + 1, count):
            x, y = (middles[j] - middles[i]).tolist()
            ahead = math.atan2(y, x)
            bends = (
                outward[i] - ahead - math.pi,
                outward[j] - ahead,
                outward[i] - outward[j] - math.pi,
            )
            bend = max(abs(math.remainder(each, 2 * math.pi)) for each in bends)
            if bend <= straight:
                pairs.append((bend, i, j))
    found = [-1] * count
    for _, i, j in sorted(pairs):
        if found[i] < 0 and found[j] < 0:
            found[i], found[j] = j, i
    return tuple(found)
