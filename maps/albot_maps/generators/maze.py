"""Mazes: square cells with a path between any two, and a chosen number of loops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from albot_core.errors import InputError
from albot_maps.generators.parameters import Parameters, count, metres, switch
from albot_maps.generators.plan import WALL, Box, Corner, Plan, Sampler

_LOOPS = 3
"""Number of loops by default."""
_Cell = tuple[int, int]
"""Column and row."""
_Gate = tuple[_Cell, _Cell]
"""Two neighbours, the left or lower one first."""


@dataclass(frozen=True, kw_only=True)
class MazeParameters(Parameters):
    """A maze."""

    kind: ClassVar[str] = "maze"

    columns: int = count(8, 2, 60)
    """Number of columns of cells."""
    rows: int = count(6, 2, 60)
    """Number of rows of cells."""
    passage_width: float = metres(1.2, 0.75, 5)
    """Width of a passage (m)."""
    loops: int | None = count(None, 0, 1000, usual=_LOOPS)
    """Number of openings beyond those needed to reach every cell; at most (columns - 1) (rows - 1),
    or with symmetry (columns - 2) (rows - 1). By default the largest possible number up to 3."""
    symmetry: bool = switch(False)
    """Whether the right half mirrors the left one; then `columns` and `loops` must be even."""


def draw_maze(parameters: MazeParameters, sampler: Sampler, source: str) -> tuple[Plan, Corner]:
    """Return a maze and its start, in a corner cell. Every cell is a room.

    Raises:
        InputError: There are too many loops, or a symmetric maze has odd `columns` or `loops`.
    """
    columns, rows = parameters.columns, parameters.rows
    loops = _loops(parameters, source)
    if parameters.symmetry:
        half = _draw_gates(sampler, columns // 2, rows, loops // 2)
        middle = sampler.integer(0, rows - 1)
        gates = [*half, ((columns // 2 - 1, middle), (columns // 2, middle))]
        gates += [_mirrored(gate, columns) for gate in half]
    else:
        gates = _draw_gates(sampler, columns, rows, loops)
    width = round(100 * parameters.passage_width)
    plan = Plan()
    for cell in _cells(columns, rows):
        plan.add_room(_name(cell), _square(cell, width))
    for one, other in sorted(gates):
        first, second = _square(one, width), _square(other, width)
        along_x = one[0] == other[0]
        opening = (
            Box(first.x1, first.y2, first.x2, second.y1)
            if along_x
            else Box(first.x2, first.y1, second.x1, first.y2)
        )
        plan.add_door(opening, (_name(one), _name(other)), along_x=along_x)
    return plan, _square((0, 0), width).middle


def _loops(parameters: MazeParameters, source: str) -> int:
    """Return the number of loops, the default one if none is given."""
    columns, rows, loops = parameters.columns, parameters.rows, parameters.loops
    if parameters.symmetry:
        for name, value in (("columns", columns), ("loops", loops or 0)):
            if value % 2:
                raise InputError(source, "an even number with symmetry", str(value), place=name)
        columns //= 2
    # The grid's pairs of neighbours minus the openings of a spanning tree.
    most = (columns - 1) * (rows - 1) * (2 if parameters.symmetry else 1)
    if loops is None:
        return min(most, 2 if parameters.symmetry else _LOOPS)
    if loops > most:
        expected = f"at most {most} in {parameters.columns} x {rows} cells"
        raise InputError(source, expected, str(loops), place="loops")
    return loops


def _draw_gates(sampler: Sampler, columns: int, rows: int, loops: int) -> list[_Gate]:
    """Return the openings: a spanning tree by a random depth-first walk, then random loops."""
    here = (sampler.integer(0, columns - 1), sampler.integer(0, rows - 1))
    visited, way = {here}, [here]
    gates: list[_Gate] = []
    while way:
        fresh = [cell for cell in _neighbours(way[-1], columns, rows) if cell not in visited]
        if not fresh:
            way.pop()
            continue
        there = sampler.pick(fresh)
        gates.append(_gate(way[-1], there))
        visited.add(there)
        way.append(there)
    opened = set(gates)
    shut = [
        (cell, other)
        for cell in _cells(columns, rows)
        for other in _neighbours(cell, columns, rows)
        if cell < other and (cell, other) not in opened
    ]
    return gates + sampler.shuffled(shut)[:loops]


def _cells(columns: int, rows: int) -> Iterator[_Cell]:
    return ((column, row) for column in range(columns) for row in range(rows))


def _neighbours(cell: _Cell, columns: int, rows: int) -> list[_Cell]:
    column, row = cell
    beside = ((column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1))
    return [(c, r) for c, r in beside if 0 <= c < columns and 0 <= r < rows]


def _gate(one: _Cell, other: _Cell) -> _Gate:
    return (one, other) if one < other else (other, one)


def _mirrored(gate: _Gate, columns: int) -> _Gate:
    one, other = ((columns - 1 - column, row) for column, row in gate)
    return _gate(one, other)


def _square(cell: _Cell, width: int) -> Box:
    left, low = cell[0] * (width + WALL), cell[1] * (width + WALL)
    return Box(left, low, left + width, low + width)


def _name(cell: _Cell) -> str:
    return f"cell {cell[0] + 1}-{cell[1] + 1}"
