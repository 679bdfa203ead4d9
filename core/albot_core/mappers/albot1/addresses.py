"""Table of the addresses at which compiled code finds each robot's map, last view and exits.

The robots' maps differ in size, so they cannot stand in one array. Each robot has arrays of its
own, which are replaced by larger ones as its map grows. A kernel that steps many robots takes a
table with the addresses of all their arrays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int64
from numba import types

from albot_core.kernels.compiled import array_at, kernel
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView, PerceptualMap
from albot_core.mappers.albot1.places.exits import MAX_EXITS, ExitMemory
from albot_core.mappers.albot1.trail.crumb_kernels import Crumbs
from albot_core.mappers.albot1.trail.path_tree import PathGraph

MAP_ROOM, VIEW_ROOM, CRUMB_ROOM, LINK_ROOM = 0, 1, 2, 3
"""Columns of the table: capacity of the robot's map (surfaces), of its view (surfaces), of its
breadcrumbs and of its links. The columns after them are the addresses of the arrays of the map, the
view, the exits, the breadcrumbs and the links."""
_MAP = 4
_VIEW = _MAP + len(PerceptualMap._fields)
_EXITS = _VIEW + len(LocatedView._fields)
_CRUMBS = _EXITS + len(ExitMemory._fields)
_GRAPH = _CRUMBS + len(Crumbs._fields)
COLUMNS = _GRAPH + len(PathGraph._fields)
"""Length of a row of the table."""


class MapperArrays(NamedTuple):
    """The arrays of one robot."""

    pm: PerceptualMap
    """The robot's map."""
    view: LocatedView
    """The robot's last view."""
    exits: ExitMemory
    """The exits that the robot has seen."""
    crumbs: Crumbs
    """The robot's breadcrumbs."""
    graph: PathGraph
    """The links between the breadcrumbs."""


def addresses_of(arrays: MapperArrays) -> Int64[np.ndarray, "columns"]:
    """Return a robot's row of the table. It is valid as long as the arrays live."""
    addresses = [array.ctypes.data for part in arrays for array in part]
    pm, view, _, crumbs, graph = arrays
    rooms = [len(pm.ids), len(view.slots), len(crumbs.places), len(graph.lengths)]
    return np.array([*rooms, *addresses], np.int64)


_numbers, _pairs, _lines = array_at(), array_at(2), array_at(4)
_integers, _integer_pairs = array_at(kind=types.int64), array_at(2, kind=types.int64)
_shorts, _short_pairs, _short_triples = (
    array_at(kind=types.int32),
    array_at(2, kind=types.int32),
    array_at(3, kind=types.int32),
)
_edge_pairs, _truths = array_at(2, kind=types.int8), array_at(kind=types.boolean)


@kernel()
def map_at(table: np.ndarray) -> PerceptualMap:
    """Return the map whose arrays' addresses stand in a row of the table."""
    capacity, at = table[MAP_ROOM], _MAP
    return PerceptualMap(
        _lines(table[at], capacity),
        _edge_pairs(table[at + 1], capacity),
        _integers(table[at + 2], capacity),
        _shorts(table[at + 3], capacity),
        _shorts(table[at + 4], capacity),
        _short_triples(table[at + 5], capacity),
        _shorts(table[at + 6], capacity),
        _shorts(table[at + 7], 2 * capacity),
        _short_pairs(table[at + 8], 2 * capacity),
        _integers(table[at + 9], 6),
    )


@kernel()
def view_at(table: np.ndarray) -> LocatedView:
    """Return the view whose arrays' addresses stand in a row of the table."""
    room, at = table[VIEW_ROOM], _VIEW
    return LocatedView(
        _lines(table[at], room),
        _edge_pairs(table[at + 1], room),
        _truths(table[at + 2], room),
        _integers(table[at + 3], room),
        _integers(table[at + 4], 1),
        _numbers(table[at + 5], 3),
    )


@kernel()
def exits_at(table: np.ndarray) -> ExitMemory:
    """Return the exits whose arrays' addresses stand in a row of the table."""
    return ExitMemory(
        _lines(table[_EXITS], MAX_EXITS),
        _numbers(table[_EXITS + 1], 5),
        _integers(table[_EXITS + 2], 3),
        _lines(table[_EXITS + 3], MAX_EXITS),
    )


@kernel()
def crumbs_at(table: np.ndarray) -> Crumbs:
    """Return the breadcrumbs whose arrays' addresses stand in a row of the table."""
    room, at = table[CRUMB_ROOM], _CRUMBS
    return Crumbs(
        _pairs(table[at], room),
        _integers(table[at + 1], room),
        _integers(table[at + 2], room),
        _integers(table[at + 3], room),
        _integers(table[at + 4], 3),
    )


@kernel()
def graph_at(table: np.ndarray) -> PathGraph:
    """Return the links of the breadcrumbs whose arrays' addresses stand in a row of the table."""
    points, links, at = table[CRUMB_ROOM], table[LINK_ROOM], _GRAPH
    return PathGraph(
        _integers(table[at], 2),
        _numbers(table[at + 1], points),
        _integers(table[at + 2], points),
        _integers(table[at + 3], points),
        _integer_pairs(table[at + 4], links),
        _numbers(table[at + 5], links),
        _integer_pairs(table[at + 6], links),
    )
