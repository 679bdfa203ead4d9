"""The type of all options and arguments that are paths."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click


class PathType(click.Path):
    """A `pathlib.Path`, as of `click.Path`; an empty one is refused.

    `Path("")` is the current folder, so an unset variable in `--out "$FOLDER"` would fill it.
    """

    def __init__(self, **checks: bool) -> None:
        super().__init__(path_type=Path, **checks)

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        """Return the path; fail for an empty one, or as `click.Path` does."""
        if not os.fspath(value):
            self.fail("expected a path, found ''.", param, ctx)
        return super().convert(value, param, ctx)
