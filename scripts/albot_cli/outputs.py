"""Whether results can be written where they are wanted: asked before the work that makes them."""

from __future__ import annotations

import tempfile
from pathlib import Path

from albot_core.errors import InputError


def check_folder(folder: Path) -> None:
    """Raise InputError where no folder can be made or nothing be written into it."""
    _check(folder, folder, "a folder to write to")


def check_file(path: Path) -> None:
    """Raise InputError where no file can be written."""
    if path.is_dir():
        raise InputError(path, "a file to write", "a folder")
    _check(path, path.parent, "a file to write")


def check_png(path: Path | None) -> None:
    """Raise InputError where a picture's file, if one is wanted, is named as another."""
    if path is not None and path.suffix.lower() != ".png":
        raise InputError("--png", "a name that ends in .png", str(path))


def _check(source: Path, folder: Path, expected: str) -> None:
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise InputError(source, expected, f"a file at {existing}")
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise InputError(source, expected, error.strerror or str(error)) from None
