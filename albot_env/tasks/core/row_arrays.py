"""Rows of batched state arrays by name: what one robot takes into its episode's state, and back."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

Arrays = Mapping[str, np.ndarray]


def copied_rows(table: str, arrays: Any, row: int, names: Collection[str] = ()) -> Arrays:
    """Return copies of one row of each array of a NamedTuple, as `table.name`.

    Args:
        table: Name of the NamedTuple in the result.
        arrays: The NamedTuple; its arrays have one row per robot.
        row: The row.
        names: The fields to copy; by default all.
    """
    return {
        f"{table}.{name}": np.array(getattr(arrays, name)[row]) for name in names or arrays._fields
    }


def put_rows(table: str, arrays: Any, row: int, values: Arrays) -> None:
    """Write back what `copied_rows` returned, or rows that were cut to the part in use.

    Where an array has room for more than a row holds, the rest becomes zero.
    """
    for key, value in values.items():
        group, _, name = key.partition(".")
        if group == table:
            fill_row(getattr(arrays, name), row, value)


def fill_row(array: np.ndarray, row: int, value: np.ndarray) -> None:
    """Write a value into a row that is at least as large; the rest of the row becomes zero."""
    if array[row].shape == value.shape:
        array[row] = value
        return
    own = array[row]
    own[...] = np.zeros((), array.dtype)
    own[tuple(slice(length) for length in value.shape)] = value
