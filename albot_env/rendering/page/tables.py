"""Tables in which a page holds what changes during an episode, so that any moment is found at once.

A page sees a map as shapes, drawn at a number of *versions*. A table is told the state at each
version and keeps little more than what is new. Coordinates are whole millimetres.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int32, UInt8

from albot_core.maps.layers import OccupancyGridLayer
from albot_env.recording.layers import occupancy_bytes

Arrays = dict[str, np.ndarray]
"""Arrays of whole or floating-point numbers, by name."""


def millimetres(metres: np.ndarray) -> Int32[np.ndarray, "..."]:
    """Return lengths in whole millimetres, as far as 32 bits can hold them."""
    limit = np.iinfo(np.int32).max
    return np.clip(np.rint(metres * 1000.0), -limit, limit).astype(np.int32)


class LifetimeTable:
    """Rows that appear at one version and vanish at a later one.

    A map mostly keeps what it has, so a row that stays costs nothing.

    Args:
        width: Numbers in a row.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self._living: dict[bytes, int] = {}
        self._rows: list[bytes] = []
        self._births: list[int] = []
        self._deaths: list[int] = []

    def update(self, version: int, rows: Int32[np.ndarray, "rows width"]) -> None:
        """Set the rows of a version; versions come in ascending order."""
        flat = np.ascontiguousarray(rows, np.int32).tobytes()
        size = 4 * self._width
        living: dict[bytes, int] = {}
        for begin in range(0, len(flat), size):
            row = flat[begin : begin + size]
            number = self._living.pop(row, None)
            if number is None and row not in living:
                number = len(self._rows)
                self._rows.append(row)
                self._births.append(version)
                self._deaths.append(-1)
            if number is not None:
                living[row] = number
        for number in self._living.values():
            self._deaths[number] = version
        self._living = living

    @property
    def arrays(self) -> Arrays:
        """Rows, and when they live.

        `rows`; the version at which each appears (`births`, ascending), and that at which it has
        vanished (`deaths`; -1 for never).
        """
        rows = np.frombuffer(b"".join(self._rows), np.int32).reshape(-1, self._width)
        births, deaths = (np.array(each, np.int32) for each in (self._births, self._deaths))
        return {"rows": rows, "births": births, "deaths": deaths}


class FrameTable:
    """Rows that are all new at each version.

    Args:
        width: Numbers in a row.
        dtype: Type of the numbers.
    """

    def __init__(self, width: int, dtype: type[np.integer] = np.int32) -> None:
        self._width, self._dtype = width, dtype
        self._frames: list[np.ndarray] = []
        self._versions: list[int] = []

    def update(self, version: int, rows: np.ndarray) -> None:
        """Set the rows of a version; versions come in ascending order."""
        self._frames.append(np.asarray(rows, self._dtype).reshape(-1, self._width))
        self._versions.append(version)

    @property
    def arrays(self) -> Arrays:
        """`rows` of all frames; `versions`; and where the rows of each frame end (`ends`)."""
        empty = np.empty((0, self._width), self._dtype)
        return {
            "rows": np.concatenate([empty, *self._frames]),
            "versions": np.array(self._versions, np.int32),
            "ends": np.cumsum([len(frame) for frame in self._frames], dtype=np.int32),
        }


class GridTable:
    """An occupancy grid: now and then whole, and in between the cells that change.

    It is kept whole where it has another place or size, and where the changes since the last whole
    grid come to more than the grid. So a reader never applies more changes than there are cells.
    """

    def __init__(self) -> None:
        self._last: UInt8[np.ndarray, "rows columns"] | None = None
        self._place: tuple[float, ...] = ()
        self._since = 0
        self._places: list[tuple[float, ...]] = []
        self._whole: list[tuple[int, int, int]] = []
        self._cells: list[np.ndarray] = []
        self._versions: list[int] = []
        self._changed: list[np.ndarray] = []
        self._values: list[np.ndarray] = []

    def update(self, version: int, grid: OccupancyGridLayer) -> None:
        """Set the grid of a version, its origin in the world frame."""
        cells = occupancy_bytes(grid)
        place = (*grid.origin.tolist(), grid.resolution)
        changed = None
        if self._last is not None and self._last.shape == cells.shape and place == self._place:
            changed = np.flatnonzero(self._last != cells)
            self._since += len(changed)
        if changed is None or self._since > cells.size:
            self._places.append(place)
            self._whole.append((version, *cells.shape))
            self._cells.append(cells.reshape(-1))
            self._since, changed = 0, np.empty(0, np.int64)
        self._versions.append(version)
        self._changed.append(changed.astype(np.int32))
        self._values.append(cells.reshape(-1)[changed])
        self._last, self._place = cells, place

    @property
    def arrays(self) -> Arrays:
        """The grids, their cells as `occupancy_bytes`.

        The whole ones (`whole`: version, rows, columns; `places`: x, y, heading, cell side;
        `cells` one after another) and the changes at each of the `versions`, which end at `ends`:
        the numbers of cells (`changed`) and their `values`.
        """
        return {
            "whole": np.array(self._whole, np.int32).reshape(-1, 3),
            "places": np.array(self._places, np.float64).reshape(-1, 4),
            "cells": np.concatenate([np.empty(0, np.uint8), *self._cells]),
            "versions": np.array(self._versions, np.int32),
            "ends": np.cumsum([len(each) for each in self._changed], dtype=np.int32),
            "changed": np.concatenate([np.empty(0, np.int32), *self._changed]),
            "values": np.concatenate([np.empty(0, np.uint8), *self._values]),
        }
