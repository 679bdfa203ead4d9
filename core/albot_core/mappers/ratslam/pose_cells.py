"""The pose cells: a competitive attractor network over (x', y', θ') (sections 3.2 and 3.3).

Only active cells are stored, and an iteration touches only them and their neighbours. So it takes
as long in a large network as in a small one. The paper does not give the weights of an iteration.
Here they are Gaussians along each axis: excitation, then a wider inhibition of the excited cells,
then the same inhibition of all cells.

The competition draws a packet to the nearest cell. On a lattice that stands still, small shifts
would be lost, and a packet would turn to the directions of the axes. So the lattice moves with the
largest packet: the packet's centre stays at a cell, and the lattice keeps the fraction of a cell by
which it moved. Activity that moves otherwise is shared among neighbouring cells. Positions that
others see, and the cells that views are linked to, are those of the fixed cells.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.pose_kernels import rotate
from albot_core.geometry.types import Pose
from albot_core.kernels.compiled import kernel
from albot_core.mappers.ratslam.config import PoseCellConfig
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored

REACH = 2
"""Distance over which a cell excites and inhibits others, along each axis (cells)."""
_LEAST = 1e-9
"""Activity below this share of the total counts as none."""
_WINDOW = 3
"""Number of cells to either side of the most active one that make up the packet."""


class Scratch(NamedTuple):
    """Scratch arrays of an iteration; they are zeros before and after it."""

    first: np.ndarray
    second: np.ndarray
    third: np.ndarray
    """`first`, `second` and `third`: activity of all cells."""
    cells: np.ndarray
    """(2, n) int64: the cells that are active in `first` and in `second`."""


class Packet(NamedTuple):
    """The largest packet of activity."""

    x: float
    y: float
    heading: float
    """Heading of the centre. The centre is in cells: [0, columns), [0, rows), [0, headings)."""
    share: float
    """The packet's share of all activity."""


@cache
def _scratch(cells: int) -> Scratch:
    """Return the scratch arrays that all networks of a size share; one iterates at a time."""
    first, second, third = np.zeros((3, cells))
    return Scratch(first, second, third, np.zeros((2, cells), np.int64))


@cache
def _weights(config: PoseCellConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of excitation and of inhibition along an axis; each sums to 1."""
    away = np.arange(-REACH, REACH + 1)
    both = [np.exp(-0.5 * (away / width) ** 2) for width in (config.excitation, config.inhibition)]
    return both[0] / both[0].sum(), both[1] / both[1].sum()


class PoseCells(Stored):
    """A network of pose cells.

    Args:
        config: Size and weights of the network.
    """

    SCHEMA = Schema(
        Field("active_cells", "active", int, at="cells", least=0, below="cells", once=True),
        Field("activity", "active", at="activity", least=0),
        Field("packet", "4", at="packet", least=0, most="sides"),
        Field("lattice", "3", at="lattice", least=-0.5, most=0.5),
    )

    def __init__(self, config: PoseCellConfig) -> None:
        self.config = config
        self.shape = config.columns, config.rows, config.headings
        """Number of cells along x', y' and θ'."""
        self._scratch_size = math.prod(self.shape)
        self.reset()

    def reset(self) -> None:
        """Restart with one packet in the middle, with heading 0."""
        columns, rows, _ = self.shape
        self.seed(Packet(columns // 2, rows // 2, 0.0, 1.0))

    def seed(self, packet: Packet) -> None:
        """Restart with all activity in a cell at a packet's centre."""
        cell = cell_at(packet.x, packet.y, packet.heading, self.shape)
        self.lattice: Place = (_part(packet.x), _part(packet.y), _part(packet.heading))
        """Position of the lattice's cells relative to the fixed cells of the same numbers (cells,
        within half a cell)."""
        self.cells: Int64[np.ndarray, "active"] = np.array((cell,))
        """Numbers of the active cells of the lattice: (θ' rows + y') columns + x'."""
        self.activity: Float64[np.ndarray, "active"] = np.ones(1)
        """Activity of each active cell; the sum is 1."""
        self.packet = packet
        """The largest packet."""

    def iterate(
        self,
        motion: tuple[float, float, float],
        injected: Float64[np.ndarray, "some 3"],
        amounts: Float64[np.ndarray, "some"],
    ) -> bool:
        """Inject activity, let cells compete, and shift all activity with the robot.

        Args:
            motion: The robot's pose in its frame at the last iteration (m, m, rad).
            injected: Positions (x', y', θ') at which activity is injected (cells).
            amounts: Activity injected at each, as a share of all activity.

        Returns:
            Whether any activity is left. If not, the network is seeded at the last packet.
        """
        config, scratch = self.config, _scratch(self._scratch_size)
        excitation, inhibition = _weights(config)
        shift = motion[0] / config.cell, motion[1] / config.cell, motion[2] / config.cell_turn
        count, *places = iterate(
            self.cells,
            self.activity,
            injected,
            amounts,
            self.shape,
            (excitation, inhibition, config.global_inhibition),
            shift,
            (self.lattice, self.packet[:3]),
            scratch,
        )
        if not count:
            self.seed(self.packet)
            return False
        self.cells = scratch.cells[0, :count].copy()
        self.activity = scratch.first[self.cells]
        self.lattice = places[0], places[1], places[2]
        self.packet = Packet(
            *find_packet(self.cells, self.activity, self.shape, self.lattice, scratch.first)
        )
        return True

    def top(
        self, share: float, motion: tuple[float, float, float]
    ) -> tuple[Int64[np.ndarray, "some"], Float64[np.ndarray, "some"]]:
        """Return the fixed cells with at least this share of the top activity, and their activity.

        Args:
            share: Share of the top activity.
            motion: A motion by which all activity is moved before (m, m, rad).
        """
        scratch = _scratch(self._scratch_size)
        places = self._moved(self._axes(self.cells) + np.array(self.lattice), motion)
        count = read_out(places, self.activity, self.shape, scratch)
        cells = scratch.cells[0, :count].copy()
        activity = scratch.first[cells]
        scratch.first[cells] = 0.0
        is_top = activity >= share * activity.max()
        return cells[is_top], activity[is_top]

    def shares(self) -> tuple[float, float]:
        """Return the shares of all activity of the largest packet and of the next one."""
        rest, found = self.activity.copy(), []
        for _ in range(2):
            is_near = self._is_near(self.cells[np.argmax(rest)])
            found.append(min(float(rest[is_near].sum()), 1.0))
            rest[is_near] = 0.0
        return found[0], found[1]

    def _is_near(self, cell: int) -> Bool[np.ndarray, "active"]:
        """Return which active cells are in the window of a packet round a cell."""
        columns, rows, headings = self.shape
        is_near = np.ones(len(self.cells), np.bool_)
        for stride, length in ((1, columns), (columns, rows), (columns * rows, headings)):
            apart = np.abs(self.cells // stride % length - cell // stride % length)
            is_near &= np.minimum(apart, length - apart) <= _WINDOW
        return is_near

    def _sizes(self) -> dict[str, Any]:
        return {"cells": math.prod(self.shape), "sides": np.array((*self.shape, math.inf))}

    def moved(
        self, cells: Int64[np.ndarray, "some"], motion: tuple[float, float, float]
    ) -> Float64[np.ndarray, "some 3"]:
        """Return the positions that a robot reaches from fixed cells by a motion (m, m, rad)."""
        return self._moved(self._axes(cells), motion)

    def _axes(self, cells: Int64[np.ndarray, "some"]) -> Float64[np.ndarray, "some 3"]:
        """Return the positions x', y', θ' of cells, given by their numbers."""
        columns, rows, _ = self.shape
        axes = cells % columns, cells // columns % rows, cells // (columns * rows)
        return np.stack(axes, axis=1).astype(np.float64)

    def _moved(
        self, places: Float64[np.ndarray, "some 3"], motion: tuple[float, float, float]
    ) -> Float64[np.ndarray, "some 3"]:
        """Return the positions that a robot reaches from others by a motion (m, m, rad)."""
        config = self.config
        angles = places[:, 2] * config.cell_turn
        cos, sin = np.cos(angles) / config.cell, np.sin(angles) / config.cell
        x, y = cos * motion[0] - sin * motion[1], sin * motion[0] + cos * motion[1]
        turn = np.full(len(places), motion[2] / config.cell_turn)
        return np.asarray(places + np.stack((x, y, turn), axis=1))

    def offset(self, x: float, y: float, heading: float) -> Pose:
        """Return the packet's centre seen from a pose in cells, the shortest way (m, m, rad)."""
        columns, rows, headings = self.shape
        config, packet = self.config, self.packet
        east = config.cell * _shortest(packet.x - x, columns)
        north = config.cell * _shortest(packet.y - y, rows)
        angle = heading * config.cell_turn
        cos, sin = math.cos(angle), math.sin(angle)
        turn = config.cell_turn * _shortest(packet.heading - heading, headings)
        return np.array((cos * east + sin * north, cos * north - sin * east, turn))


def _shortest(difference: float, cells: int) -> float:
    """Return a difference along an axis that wraps round, within half the axis to either side."""
    return (difference + cells / 2) % cells - cells / 2


Shape = tuple[int, int, int]
Place = tuple[float, float, float]
"""x', y' and θ' (cells)."""


@kernel()
def cell_at(x: float, y: float, heading: float, shape: Shape) -> int:
    """Return the number of the cell nearest to a position in cells."""
    columns, rows, headings = shape
    column = np.int64(math.floor(x + 0.5)) % columns
    row = np.int64(math.floor(y + 0.5)) % rows
    layer = np.int64(math.floor(heading + 0.5)) % headings
    return int((layer * rows + row) * columns + column)


@kernel()
def iterate(
    cells: np.ndarray,
    activity: np.ndarray,
    injected: np.ndarray,
    amounts: np.ndarray,
    shape: Shape,
    weights: tuple[np.ndarray, np.ndarray, float],
    shift: tuple[float, float, float],
    places: tuple[Place, Place],
    scratch: Scratch,
) -> tuple[int, float, float, float]:
    """Run one iteration; return the number of cells that are active after it, and the lattice.

    These cells are in the first row of `scratch.cells`, their activity in `scratch.first`. The
    caller must clear `scratch.first` (as `find_packet` does). If no cell is active, all is cleared.
    `places` holds the positions of the lattice and of the packet's centre.
    """
    first, third = scratch.first, scratch.third
    here, there = scratch.cells[0], scratch.cells[1]
    lattice, centre = places
    count = 0
    for k in range(cells.shape[0]):
        count = _add(first, here, count, cells[k], activity[k])
    for k in range(injected.shape[0]):
        if amounts[k] > 0.0:
            x, y = injected[k, 0] - lattice[0], injected[k, 1] - lattice[1]
            place = x, y, injected[k, 2] - lattice[2]
            count = _share(first, here, count, place, amounts[k], shape)
    count = _compete(shape, weights, scratch, count)
    if count == 0:
        return 0, lattice[0], lattice[1], lattice[2]
    return _shift(third, first, here, there, count, shape, shift, lattice, centre)


@kernel()
def read_out(places: np.ndarray, activity: np.ndarray, shape: Shape, scratch: Scratch) -> int:
    """Share activity at positions among the fixed cells; return the number of cells reached.

    These cells are in the first row of `scratch.cells`, their activity in `scratch.first`.
    """
    count = 0
    for k in range(places.shape[0]):
        place = places[k, 0], places[k, 1], places[k, 2]
        count = _share(scratch.first, scratch.cells[0], count, place, activity[k], shape)
    return count


@kernel()
def _compete(
    shape: Shape, weights: tuple[np.ndarray, np.ndarray, float], scratch: Scratch, count: int
) -> int:
    """Apply excitation and inhibition; return the number of cells that are active after it.

    The first row of `scratch.cells` lists the active cells. Their activity is in `scratch.first`
    before the call, and in `scratch.third` after it.
    """
    columns, rows, headings = shape
    first, second, third, lists = scratch
    excitation, inhibition, lost = weights
    here, there = lists[0], lists[1]
    # Excitation along x', y' and θ', from one array into the other.
    count = _spread(first, second, here, there, count, excitation, 1, columns)
    count = _spread(second, first, there, here, count, excitation, columns, rows)
    count = _spread(first, second, here, there, count, excitation, columns * rows, headings)
    # Local inhibition of the excited activity, which `third` keeps.
    for k in range(count):
        third[there[k]] = second[there[k]]
    count = _spread(second, first, there, here, count, inhibition, 1, columns)
    count = _spread(first, second, here, there, count, inhibition, columns, rows)
    count = _spread(second, first, there, here, count, inhibition, columns * rows, headings)
    total, kept = 0.0, 0
    for k in range(count):
        cell = here[k]
        left = third[cell] - first[cell]
        first[cell] = third[cell] = 0.0
        if left > 0.0:
            third[cell] = left
            total += left
            here[kept] = cell
            kept += 1
    # Normalise, apply global inhibition, then normalise again.
    before, total, count = total, 0.0, 0
    for k in range(kept):
        cell = here[k]
        left = third[cell] / before - lost
        third[cell] = 0.0
        if left > _LEAST:
            third[cell] = left
            total += left
            here[count] = cell
            count += 1
    for k in range(count):
        third[here[k]] /= total
    return count


@kernel()
def _add(target: np.ndarray, reached: np.ndarray, count: int, cell: int, amount: float) -> int:
    """Add activity to a cell, and list it if it had none; return the length of the list."""
    if amount == 0.0:  # A product that underflowed: the cell would be listed again and again.
        return count
    if target[cell] == 0.0:
        reached[count] = cell
        count += 1
    target[cell] += amount
    return count


@kernel()
def _spread(
    source: np.ndarray,
    target: np.ndarray,
    cells: np.ndarray,
    reached: np.ndarray,
    count: int,
    weights: np.ndarray,
    stride: int,
    length: int,
) -> int:
    """Spread activity along one axis by weights and clear the source; return the number reached."""
    found = 0
    for k in range(count):
        cell = cells[k]
        amount = source[cell]
        source[cell] = 0.0
        at = cell // stride % length
        base = cell - at * stride
        for j in range(2 * REACH + 1):
            place = at + j - REACH
            if place < 0:
                place += length
            elif place >= length:
                place -= length
            found = _add(target, reached, found, base + place * stride, weights[j] * amount)
    return found


@kernel()
def _share(
    target: np.ndarray, reached: np.ndarray, count: int, place: Place, amount: float, shape: Shape
) -> int:
    """Share activity at a position among its eight neighbours; return the length of the list."""
    columns, rows, headings = shape
    east, north = _wrapped(place[0], columns), _wrapped(place[1], rows)
    turn = _wrapped(place[2], headings)
    x, y, layer = np.int64(east), np.int64(north), np.int64(turn)
    part_x, part_y, part_turn = east - x, north - y, turn - layer
    for j in range(8):
        share = part_x if j & 1 else 1.0 - part_x
        share *= part_y if j & 2 else 1.0 - part_y
        share *= part_turn if j & 4 else 1.0 - part_turn
        if share > _LEAST:
            to = ((layer + (j >> 2)) % headings * rows + (y + (j >> 1 & 1)) % rows) * columns
            count = _add(target, reached, count, int(to + (x + (j & 1)) % columns), share * amount)
    return count


@kernel()
def _shift(
    source: np.ndarray,
    target: np.ndarray,
    cells: np.ndarray,
    reached: np.ndarray,
    count: int,
    shape: Shape,
    shift: tuple[float, float, float],
    lattice: Place,
    centre: Place,
) -> tuple[int, float, float, float]:
    """Move all activity with the robot (path integration).

    The activity of each heading moves in its own direction. The lattice moves so that the packet,
    whose centre was at `centre`, is at a cell. `source` is cleared; `cells` lists the active cells
    afterwards.

    Returns:
        The number of active cells, and the position of the lattice.
    """
    columns, rows, headings = shape
    # The packet moves in all its headings at once, and their mean is shorter than the motion. So
    # all moves are longer by as much.
    middle = centre[2] - lattice[2]
    forward, total = 0.0, 0.0
    for k in range(count):
        away = cells[k] // (columns * rows) - middle
        away = (away + headings / 2) % headings - headings / 2
        if abs(away) <= _WINDOW + 0.5:
            forward += source[cells[k]] * math.cos(2.0 * math.pi * away / headings)
            total += source[cells[k]]
    stretch = total / forward if forward > 0.0 else 1.0
    shift_x, shift_y = stretch * shift[0], stretch * shift[1]
    # How far the lattice moves, and how far each layer does beyond that.
    angle = 2.0 * math.pi * centre[2] / headings
    east, north = rotate(math.cos(angle), math.sin(angle), shift_x, shift_y)
    moved_x = _part(east + centre[0]) - lattice[0]
    moved_y = _part(north + centre[1]) - lattice[1]
    moved_turn = _part(shift[2] + centre[2]) - lattice[2]
    turn = shift[2] - moved_turn
    found, layer = 0, -1
    for k in range(count):
        cell = cells[k]
        amount = source[cell]
        source[cell] = 0.0
        if cell // (columns * rows) != layer:
            layer = cell // (columns * rows)
            angle = 2.0 * math.pi * (layer + lattice[2]) / headings
            east, north = rotate(math.cos(angle), math.sin(angle), shift_x, shift_y)
            east, north = east - moved_x, north - moved_y
        place = cell % columns + east, cell // columns % rows + north, layer + turn
        found = _share(target, reached, found, place, amount, shape)
    for k in range(found):
        cells[k] = reached[k]
    return found, lattice[0] + moved_x, lattice[1] + moved_y, lattice[2] + moved_turn


@kernel()
def _part(place: float) -> float:
    """Return how far a position is from the nearest cell, within [-1/2, 1/2)."""
    return place - math.floor(place + 0.5)


@kernel()
def find_packet(
    cells: np.ndarray, activity: np.ndarray, shape: Shape, lattice: Place, dense: np.ndarray
) -> tuple[float, float, float, float]:
    """Return the centre of the packet round the most active cell (fixed cells), and its share.

    The packet may lie across the wrap. `dense` holds the activity of all cells, and is cleared.
    """
    columns, rows, headings = shape
    peak = cells[np.argmax(activity)]
    x, y, layer = peak % columns, peak // columns % rows, peak // (columns * rows)
    share = east = north = turn = 0.0
    for i in range(-_WINDOW, _WINDOW + 1):
        for j in range(-_WINDOW, _WINDOW + 1):
            for k in range(-_WINDOW, _WINDOW + 1):
                at = ((layer + k) % headings * rows + (y + j) % rows) * columns + (x + i) % columns
                amount = dense[at]
                share += amount
                east += amount * i
                north += amount * j
                turn += amount * k
    for k in range(cells.shape[0]):
        dense[cells[k]] = 0.0
    return (
        _wrapped(x + east / share + lattice[0], columns),
        _wrapped(y + north / share + lattice[1], rows),
        _wrapped(layer + turn / share + lattice[2], headings),
        share,
    )


@kernel()
def _wrapped(place: float, length: int) -> float:
    """Return a position along an axis that wraps round, within [0, length)."""
    place %= float(length)
    return place if place < length else 0.0
