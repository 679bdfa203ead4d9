"""Tables of rows that grow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.stored import Stored

_FIRST = 64
"""Initial capacity (rows)."""


class Table(Stored):
    """Columns of equal length, each an array whose first axis is the row.

    Args:
        name: Prefix of the columns' names in the state, and the name of their length.
        columns: The columns, with the shape of a row.
    """

    def __init__(self, name: str, *columns: Field) -> None:
        self._name, self._columns = name, columns
        self.SCHEMA = Schema(
            *(
                replace(each, name=f"{name}.{each.name}", shape=f"{name} {each.shape}", at=None)
                for each in columns
            )
        )
        self.clear()

    def clear(self) -> None:
        """Remove all rows."""
        self.count = 0
        self._arrays = {
            column.name: np.zeros((_FIRST, *map(int, column.shape.split())), column.dtype)
            for column in self._columns
        }

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column with its spare rows, for compiled code to read and write."""
        return self._arrays[name]

    def rows(self, name: str) -> np.ndarray:
        """Return a column's rows (a view)."""
        return self._arrays[name][: self.count]

    def append(self, **values: Any) -> int:
        """Append a row; return its number."""
        self.reserve(1)
        for name, value in values.items():
            self._arrays[name][self.count] = value
        self.count += 1
        return self.count - 1

    def reserve(self, more: int) -> None:
        """Make room for `more` rows."""
        needed = self.count + more
        for name, array in self._arrays.items():
            if needed > len(array):
                larger = np.zeros((2 * needed, *array.shape[1:]), array.dtype)
                larger[: self.count] = array[: self.count]
                self._arrays[name] = larger

    def _stored(self) -> dict[str, np.ndarray]:
        return {f"{self._name}.{column.name}": self.rows(column.name) for column in self._columns}

    def _restored(self, state: Arrays) -> None:
        self.clear()
        count = len(state[f"{self._name}.{self._columns[0].name}"])
        self.reserve(count)
        self.count = count
        for name, array in self._arrays.items():
            array[:count] = state[f"{self._name}.{name}"]
