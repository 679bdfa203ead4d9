"""Where compiled code finds the map and the last view of each of many robots.

Robots remember more or less, so that their maps cannot stand in one array. Each has arrays
of its own, which are exchanged for larger ones as its map grows; a kernel that leads many
robots takes a table with the addresses of them all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Int64
from numba import njit, types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from albot_core.albot1.memory import Memory
from albot_core.albot1.sight import Sight

CAPACITY, ROOM = 0, 1
"""Places in a robot's row of the table: surfaces its map has room for, surfaces its view has
room for; after them the addresses of its memory's arrays, then of its view's."""
_MEMORY = 2
_SIGHT = _MEMORY + len(Memory._fields)
PLACES = _SIGHT + len(Sight._fields)
"""Length of a row of the table."""


def places_of(memory: Memory, sight: Sight) -> Int64[np.ndarray, "places"]:
    """A robot's row of the table. It holds as long as the arrays live."""
    addresses = [array.ctypes.data for array in (*memory, *sight)]
    return np.array([len(memory.ids), len(sight.slots), *addresses], np.int64)


def _pointer(typing: Any, address: Any) -> Any:
    """A pointer out of an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.int64), generate


pointer: Any = intrinsic(_pointer)


@njit(cache=True, error_model="numpy")
def _numbers(address: int, count: int, columns: int) -> np.ndarray:
    return carray(pointer(address), (count, columns), np.float64)


@njit(cache=True, error_model="numpy")
def _edges(address: int, count: int) -> np.ndarray:
    return carray(pointer(address), (count, 2), np.int8)


@njit(cache=True, error_model="numpy")
def _integers(address: int, count: int) -> np.ndarray:
    return carray(pointer(address), (count,), np.int64)


@njit(cache=True, error_model="numpy", inline="always")
def memory_at(places: np.ndarray) -> Memory:
    """The memory whose arrays' addresses stand in a row of the table."""
    capacity, at = places[CAPACITY], _MEMORY
    return Memory(
        _numbers(places[at], capacity, 4),
        _edges(places[at + 1], capacity),
        _integers(places[at + 2], capacity),
        carray(pointer(places[at + 3]), (capacity,), np.int32),
        carray(pointer(places[at + 4]), (2 * capacity,), np.int32),
        carray(pointer(places[at + 5]), (2 * capacity, 2), np.int32),
        _integers(places[at + 6], 4),
    )


@njit(cache=True, error_model="numpy", inline="always")
def sight_at(places: np.ndarray) -> Sight:
    """The view whose arrays' addresses stand in a row of the table."""
    room, at = places[ROOM], _SIGHT
    return Sight(
        _numbers(places[at], room, 4),
        _edges(places[at + 1], room),
        carray(pointer(places[at + 2]), (room,), np.bool_),
        _integers(places[at + 3], room),
        _integers(places[at + 4], 1),
        carray(pointer(places[at + 5]), (3,), np.float64),
    )
