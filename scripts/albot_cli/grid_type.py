"""The type of options that are the tiles of a mosaic."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import click

MOST = 10
"""Most columns, and most rows."""


class Grid(NamedTuple):
    """The tiles of a mosaic."""

    columns: int
    rows: int


class GridType(click.ParamType):  # type: ignore[type-arg]  # Generic in late versions only.
    """Columns and rows, as `3x2`."""

    name = "columns x rows"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the grid; fail for anything but two numbers from 1 to `MOST`."""
        if isinstance(value, Grid):
            return value
        found = re.fullmatch(r"(\d{1,4})[x×](\d{1,4})", str(value).strip().lower(), re.ASCII)
        if found is None:
            self.fail(f"expected COLUMNSxROWS, as 3x3, found {value!r}.", param, ctx)
        grid = Grid(int(found[1]), int(found[2]))
        if not all(1 <= number <= MOST for number in grid):
            self.fail(f"expected from 1x1 to {MOST}x{MOST} tiles, found {value!r}.", param, ctx)
        return grid
