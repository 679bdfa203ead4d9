"""Gateways: where the ground narrows between a place and what lies around it.

A gateway lies on the Voronoi skeleton where the distance to the nearest wall has a local minimum,
and runs from wall to wall (Beeson et al. 2010, section 5; Hossain 2014, section 2.3.3). In a
corridor the distance does not change, so its gateway lies where the corridor begins, seen from the
junction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int8, Int32, Int64

from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.hssh.skeleton import distances, sealed, skeleton_of
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, Range, check_fields

UNKNOWN, FREE, WALL = np.int8(0), np.int8(1), np.int8(2)
"""States of a cell of the local map."""
_SAME = 0.4
"""Distance of the middles of two gateways below which they are one (m)."""
_RATIO = Range("a number within (0, 1)", 0.0, 1.0, beyond=True)


@dataclass(frozen=True, kw_only=True)
class GatewayConfig:
    """What counts as a gateway. The paper's text gives no numbers; all of them are ours."""

    ratio: float = 0.9
    """Largest clearance of a gateway, as a share of that of the open ground next to it. The
    junction of two corridors of a width has 1.41 times the clearance of its arms, a T 1.25 times,
    and a corner 1.17 times."""
    narrowest: float = 0.5
    """Smallest width (m): the robot does not fit through a narrower one."""
    widest: float = 3.5
    """Largest width (m)."""
    flat: float = 0.1
    """Rise of the clearance above its minimum that still belongs to the gateway (m)."""
    arm: float = 1.0
    """Smallest length of known ground behind a gateway of which no other end is known (m)."""
    apart: float = 1.0
    """Distance along the skeleton below which the two gateways of one narrow are one (m)."""
    island: float = 1.5
    """Largest extent of what stands alone on free ground and is no wall: furniture (m). 0 makes
    gateways between furniture and walls, too."""
    straight: float = math.radians(45.0)
    """Largest angle between two gateways, and between each and the line from one to the other, at
    which they continue one another (rad)."""

    def __post_init__(self) -> None:
        check_fields(self, _RATIO, "ratio")
        check_fields(self, POSITIVE, "narrowest", "widest", "flat", "arm", "apart", "straight")
        check_fields(self, NOT_NEGATIVE, "island")


class Ground(NamedTuple):
    """A part of a local map."""

    states: Int8[np.ndarray, "rows columns"]
    """State of each cell; the outermost cells are not free."""
    corner: Float64[np.ndarray, "2"]
    """x, y of the outer corner of the first cell (m)."""
    cell: float
    """Side of a cell (m)."""

    def centres(self, cells: Int64[np.ndarray, "n 2"]) -> Points:
        """Return the centres of cells, given by row and column (m)."""
        return np.asarray(self.corner + (cells[:, ::-1] + 0.5) * self.cell)


@dataclass(frozen=True, kw_only=True, eq=False)
class Narrows:
    """The gateways on a part of a local map, and what they were found by."""

    gateways: Segments
    """The gateways from wall to wall (m)."""
    clearance: Float32[np.ndarray, "rows columns"]
    """Distance of each cell to the nearest wall or unknown cell (cells)."""
    skeleton: Int32[np.ndarray, "cells 2"]
    """Row and column of the cells of the skeleton."""


def find_gateways(ground: Ground, config: GatewayConfig) -> Narrows:
    """Find the gateways on a part of a local map."""
    free = ground.states == FREE
    if not free.any():
        empty = np.empty((0, 4)), np.zeros(free.shape, np.float32), np.empty((0, 2), np.int32)
        return Narrows(gateways=empty[0], clearance=empty[1], skeleton=empty[2])
    clearance = distances(sealed(free))
    skeleton = skeleton_of(clearance)
    lines = find_constrictions(
        ground.states,
        clearance,
        skeleton.cells,
        skeleton.ends,
        skeleton.nodes,
        config.ratio,
        (config.flat / ground.cell, config.arm / ground.cell, config.apart / ground.cell),
    )
    ends = ground.centres(lines.reshape(-1, 2)).reshape(-1, 4)
    widths = np.hypot(*(ends[:, 2:] - ends[:, :2]).T)
    # A wall's cell reaches half a cell into the gap at either end.
    fits = (widths >= config.narrowest) & (widths <= config.widest + ground.cell)
    kept: list[list[float]] = []
    for k in np.argsort(widths, kind="stable").tolist():
        line = ends[k].tolist()
        if fits[k] and not any(_is_same(line, other) for other in kept):
            kept.append(line)
    return Narrows(
        gateways=np.array(kept).reshape(-1, 4), clearance=clearance, skeleton=skeleton.cells
    )


@kernel(arrays=True)
def find_constrictions(
    states: np.ndarray,
    clearance: np.ndarray,
    cells: np.ndarray,
    ends: np.ndarray,
    nodes: np.ndarray,
    ratio: float,
    lengths: tuple[float, float, float],
) -> np.ndarray:
    """Return the gateways' walls: row and column of either end (gateways, 4).

    Args:
        states: State of each cell (rows, columns).
        clearance: Distance of each cell to the nearest wall (cells).
        cells: The skeleton's cells, as `ends` and `nodes` a field of `Skeleton`.
        ends: Ends of the branches.
        nodes: Degrees of the branches' nodes.
        ratio: `GatewayConfig.ratio`.
        lengths: `flat`, `arm` and `apart` of `GatewayConfig` (cells).
    """
    heights = np.empty(len(cells))
    along = np.zeros(len(cells))
    for k in range(len(cells)):
        # From the centre of the cell to the edge of the wall's cell, not to its centre.
        heights[k] = clearance[cells[k, 0], cells[k, 1]] - 0.5
        if k > 0:
            up, across = cells[k, 0] - cells[k - 1, 0], cells[k, 1] - cells[k - 1, 1]
            along[k] = along[k - 1] + math.sqrt(up * up + across * across)
    lines, count = np.empty((len(cells) + 2, 4), np.int64), 0
    chosen, turns = np.empty(len(cells) + 2, np.int64), np.empty((len(cells) + 2, 2), np.int64)
    start = 0
    for branch in range(len(ends)):
        stop = ends[branch]
        tips = nodes[branch, 0] == 1, nodes[branch, 1] == 1
        found = constrictions(
            heights[start:stop], along[start:stop], tips, ratio, lengths, turns, chosen
        )
        for k in range(found):
            row, column = cells[start + chosen[k]]
            line = line_across(states, clearance, row, column)
            if line[0] >= 0:
                lines[count, 0], lines[count, 1], lines[count, 2], lines[count, 3] = line
                count += 1
        start = stop
    return lines[:count].copy()


@kernel()
def constrictions(
    heights: np.ndarray,
    along: np.ndarray,
    tips: tuple[bool, bool],
    ratio: float,
    lengths: tuple[float, float, float],
    turns: np.ndarray,
    chosen: np.ndarray,
) -> int:
    """Find the cells of a branch of the skeleton at which it has gateways; return their number.

    A narrow between two open pieces of ground that is shorter than `apart` is one gateway, in its
    middle. A longer one is a path, with a gateway at either end.

    Args:
        heights: Clearance of each cell.
        along: Distance of each cell along the branches.
        tips: Whether the branch ends at its first and last cell, in no other one.
        ratio: `GatewayConfig.ratio`.
        lengths: `flat`, `arm` and `apart` of `GatewayConfig`, in the unit of the heights.
        turns: Scratch buffer (cells + 1, 2).
        chosen: Output: the cells (cells + 1,).
    """
    flat, arm, apart = lengths
    start, stop = 0, len(heights)
    # Towards a tip the clearance falls once more, as the ground ends.
    while tips[0] and start + 1 < stop and heights[start + 1] > heights[start]:
        start += 1
    while tips[1] and stop - 1 > start and heights[stop - 2] > heights[stop - 1]:
        stop -= 1
    count, found = turning_points(heights, start, stop, ratio, turns), 0
    for k in range(count):
        if turns[k, 1] == 0:
            continue
        first, last = _extent(heights, turns, k, count, flat)
        if 0 < k < count - 1 and along[last] - along[first] < apart:
            chosen[found] = (first + last) // 2
            found += 1
            continue
        # Of ground that ends without a maximum at least so much must be known behind a gateway.
        before = apart if k < count - 1 else along[len(along) - 1] - along[first]
        behind = apart if k > 0 else along[last] - along[0]
        if k > 0 and before >= (arm if tips[1] and k == count - 1 else 0.5 * arm):
            chosen[found] = first
            found += 1
        if k < count - 1 and behind >= (arm if tips[0] and k == 0 else 0.5 * arm):
            chosen[found] = last
            found += 1
    return found


@kernel()
def _extent(
    heights: np.ndarray, turns: np.ndarray, k: int, count: int, flat: float
) -> tuple[int, int]:
    """Return the first and last cell of a minimum, as far as the clearance stays near it."""
    first = last = turns[k, 0]
    least = heights[first] + flat
    if k > 0:  # From the maximum before.
        first = turns[k - 1, 0]
        while heights[first] > least:
            first += 1
    if k + 1 < count:
        last = turns[k + 1, 0]
        while heights[last] > least:
            last -= 1
    return first, last


@kernel()
def turning_points(
    heights: np.ndarray, start: int, stop: int, ratio: float, turns: np.ndarray
) -> int:
    """Find the maxima and minima in turn; return their number.

    A minimum counts if it is at most `ratio` times the maximum next to it.

    Args:
        heights: The numbers.
        start: The first one that counts.
        stop: The end of those that count.
        ratio: The largest ratio.
        turns: Output: the place of each, and 1 for a minimum, 0 for a maximum (n, 2).
    """
    low = high = start
    count, falls = 0, -1  # -1 until it is known.
    for k in range(start, stop):
        if heights[k] > heights[high]:
            high = k
        if heights[k] < heights[low]:
            low = k
        if falls != 1 and heights[k] <= ratio * heights[high]:
            turns[count, 0], turns[count, 1] = high, 0
            count, falls, low = count + 1, 1, k
        elif falls != 0 and heights[low] <= ratio * heights[k]:
            turns[count, 0], turns[count, 1] = low, 1
            count, falls, high = count + 1, 0, k
    if falls >= 0:
        turns[count, 0], turns[count, 1] = (low, 1) if falls == 1 else (high, 0)
        count += 1
    return count


def _is_same(one: list[float], other: list[float]) -> bool:
    """Return whether two gateways are one: their middles are near."""
    x, y = one[0] + one[2] - other[0] - other[2], one[1] + one[3] - other[1] - other[3]
    return 0.5 * math.hypot(x, y) < _SAME


@kernel()
def line_across(
    states: np.ndarray, clearance: np.ndarray, row: int, column: int
) -> tuple[int, int, int, int]:
    """Return the two wall cells between which a cell of the skeleton lies.

    They are row and column of the nearest wall, and of the nearest on the other side of the cell
    (more than 120° apart). Unless both are walls that were seen, all are -1.
    """
    reach = int(2.0 * clearance[row, column]) + 3
    i1, j1 = _nearest_wall(states, row, column, reach, (0, 0))
    if i1 < 0:
        return -1, -1, -1, -1
    i2, j2 = _nearest_wall(states, row, column, reach, (i1 - row, j1 - column))
    if i2 < 0 or not _is_seen(states, i1, j1) or not _is_seen(states, i2, j2):
        return -1, -1, -1, -1
    return i1, j1, i2, j2


@kernel()
def _nearest_wall(
    states: np.ndarray, row: int, column: int, reach: int, opposite: tuple[int, int]
) -> tuple[int, int]:
    """Return row and column of the nearest cell that is not free; -1 if there is none.

    Args:
        states: State of each cell (rows, columns).
        row: The row of the cell from which it is nearest.
        column: Its column.
        reach: Largest difference of rows and columns.
        opposite: Rows and columns to a wall from which it must lie more than 120° apart; 0, 0 for
            none.
    """
    rows, columns = states.shape
    up, across = opposite
    half = 0.5 * math.sqrt(up * up + across * across)
    is_any = up == across == 0
    nearest, found, at = 2 * reach * reach + 1, -1, -1
    for i in range(max(row - reach, 0), min(row + reach + 1, rows)):
        if (i - row) * (i - row) >= nearest:
            continue
        for j in range(max(column - reach, 0), min(column + reach + 1, columns)):
            away = (i - row) * (i - row) + (j - column) * (j - column)
            if states[i, j] == FREE or away >= nearest:
                continue
            if is_any or (i - row) * up + (j - column) * across < -half * math.sqrt(away):
                nearest, found, at = away, i, j
    return found, at


@kernel()
def _is_seen(states: np.ndarray, row: int, column: int) -> bool:
    """Return whether a wall was seen at a cell or next to it."""
    rows, columns = states.shape
    for i in range(max(row - 1, 0), min(row + 2, rows)):
        for j in range(max(column - 1, 0), min(column + 2, columns)):
            if states[i, j] == WALL:
                return True
    return False


@kernel()
def crossed(lines: np.ndarray, x: float, y: float, beyond: float) -> int:
    """Return the gateway that a robot has left a place through; -1 for none.

    Args:
        lines: The gateways, each with the place to its left (gateways, 4) (m).
        x: The robot's x (m).
        y: Its y (m).
        beyond: Distance to a gateway's right at which it has left, up to 2 m (m).
    """
    best, nearest = -1, 2.0
    for k in range(len(lines)):
        across, up = lines[k, 2] - lines[k, 0], lines[k, 3] - lines[k, 1]
        length = math.sqrt(across * across + up * up)
        right, to = x - lines[k, 0], y - lines[k, 1]
        ahead = (right * up - to * across) / length
        along = (right * across + to * up) / length
        if beyond < ahead < nearest and -_ASIDE <= along <= length + _ASIDE:
            best, nearest = k, ahead
    return best


_ASIDE = 0.3
"""Distance beyond the ends of a gateway at which the robot still passes through it (m)."""


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
    draw_lines(labels, ends.astype(np.int64))
    if labels[row, column] != 1:
        return None
    chosen, unknown = surround(labels, row, column, narrowest / ground.cell)
    best = _most_open(labels, narrows.clearance)
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
def _most_open(labels: np.ndarray, clearance: np.ndarray) -> tuple[int, int]:
    """Return row and column of the region's cell with the largest clearance.

    Args:
        labels: `_INSIDE` for the region's cells (rows, columns).
        clearance: Distance of each cell to the nearest wall (cells).
    """
    most, row, column = np.float32(-1.0), 0, 0
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            if clearance[i, j] > most and labels[i, j] == _INSIDE:
                most, row, column = clearance[i, j], i, j
    return row, column


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
    labels: np.ndarray, row: int, column: int, narrowest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mark the region around a cell; return the gateways along its border, counter-clockwise.

    Args:
        labels: 1 for free cells, 0 for walls, 3 for unseen cells, -1 - k for gateway k; the region
            becomes `_INSIDE`.
        row: The cell's row.
        column: Its column.
        narrowest: Smallest distance between the ends of an unseen part of the border (cells).

    Returns:
        The gateways with other free ground behind, from the south on; and for each unseen part of
        the border the number of gateways before it.
    """
    low_row, low_column, most = _fill(labels, row, column)
    sides, count = _border(labels, low_row, low_column, most)
    leads = _leading(labels)
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
def _fill(labels: np.ndarray, row: int, column: int) -> tuple[int, int, int]:
    """Mark the region around a cell.

    Returns:
        Row and column of the first cell of its lowest row, and the number of sides of cells along
        its borders.
    """
    stack = np.empty((labels.size, 2), np.int32)
    labels[row, column] = _INSIDE
    stack[0, 0], stack[0, 1] = row, column
    size, low_row, low_column, sides = 1, row, column, 0
    while size:
        size -= 1
        i, j = stack[size, 0], stack[size, 1]
        if i < low_row or (i == low_row and j < low_column):
            low_row, low_column = i, j
        for n in range(0, 8, 2):
            a, b = i + _ROWS[n], j + _COLUMNS[n]
            if labels[a, b] == 1:
                labels[a, b] = _INSIDE
                stack[size, 0], stack[size, 1] = a, b
                size += 1
            elif labels[a, b] != _INSIDE:
                sides += 1
    return low_row, low_column, sides


@kernel(arrays=True)
def _leading(labels: np.ndarray) -> np.ndarray:
    """Return whether each gateway has free ground beside it that is not the region's.

    One with the region on both sides separates nothing, one with nothing behind leads nowhere.
    """
    rows, columns = labels.shape
    leads = np.zeros(max(-labels.min(), 0), np.bool_)
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            if labels[i, j] < 0:
                for n in range(8):
                    leads[-1 - labels[i, j]] |= labels[i + _ROWS[n], j + _COLUMNS[n]] == 1
    return leads


_ROWS = np.array((0, 1, 1, 1, 0, -1, -1, -1))
_COLUMNS = np.array((1, 1, 0, -1, -1, -1, 0, 1))
_UP = np.array((0, 1, 0, -1))
_ACROSS = np.array((1, 0, -1, 0))
"""The neighbours of a cell, all and by sides, counter-clockwise from the east."""


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
