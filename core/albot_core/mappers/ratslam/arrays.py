"""Tables of rows that grow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_FIRST = 64
"""Initial capacity (rows)."""


class Table:
    """Columns of equal length, each an array whose first axis is the row.

    Args:
        columns: Dtype and shape of a row, of each column.
    """

    def __init__(self, **columns: tuple[Any, tuple[int, ...]]) -> None:
        self._columns = columns
        self.clear()

    def clear(self) -> None:
        """Remove all rows."""
        self.count = 0
        self._arrays = {
            name: np.zeros((_FIRST, *shape), kind) for name, (kind, shape) in self._columns.items()
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

    def state(self, prefix: str) -> dict[str, np.ndarray]:
        """Return all rows, as arrays by name (copies)."""
        return {f"{prefix}.{name}": self.rows(name).copy() for name in self._columns}

    def restore(self, prefix: str, state: Mapping[str, np.ndarray]) -> None:
        """Restore the rows that `state` returned."""
        self.clear()
        count = len(state[f"{prefix}.{next(iter(self._columns))}"])
        self.reserve(count)
        self.count = count
        for name in self._columns:
            self._arrays[name][:count] = state[f"{prefix}.{name}"]
