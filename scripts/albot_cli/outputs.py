"""Output files: check that they can be written before the work, and write all or none."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import click

from albot_core.errors import InputError
from albot_core.files import atomic_write, exists, is_stream, new_folder, scratch_folder
from albot_core.interrupts import interrupts_deferred

FORCE = click.option("--force", is_flag=True, help="Overwrite existing files.")
"""The option of every command that writes files named by the user."""
JSON = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object, and show no progress."
)
"""The option of every command whose results a program may read."""


def check_folder(folder: Path, names: Iterable[str] = (), *, force: bool = False) -> None:
    """Raise InputError if a folder cannot be made or written into, or one of the files exists.

    Args:
        folder: The folder; those above it need not exist either.
        names: Names of the files to be written into it.
        force: Whether these files may exist.
    """
    above = next(each for each in (folder, *folder.parents) if exists(each) or each.is_symlink())
    if above.is_symlink() and not above.exists():
        raise InputError(folder, "a folder to write to", "a link that leads nowhere")
    _check_writable(folder, above, "a folder to write to")
    for name in names if folder.exists() else ():
        check_file(folder / name, force=force)


def check_file(path: Path, *, force: bool = False) -> None:
    """Raise InputError if a file cannot be written or exists.

    Args:
        path: The file.
        force: Whether the file may exist.
    """
    if is_stream(path):
        return
    if path.exists() and not force:
        raise InputError(path, "no existing file, or --force to overwrite it", "one")
    _check_writable(path, path.resolve().parent, "a file to write")


def check_png(path: Path | None, *, force: bool = False) -> None:
    """Raise InputError if a picture's name does not end in .png, or as `check_file` does.

    Args:
        path: The picture; None for no picture.
        force: Whether the file may exist.
    """
    if path is None:
        return
    check_suffix(path, ".png", option="--png")
    check_file(path, force=force)


def check_suffix(path: Path, suffix: str, *, option: str) -> None:
    """Raise InputError if a file's name does not end in a suffix, in small or capital letters.

    Args:
        path: The file.
        suffix: The suffix, in small letters.
        option: The option that names the file.
    """
    if path.suffix.lower() != suffix:
        raise InputError(option, f"a name that ends in {suffix}", str(path))


@contextmanager
def filled_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder; at the end, move all of its files into `folder`, or none.

    If none can be moved, `folder` is not made either.
    """
    with scratch_folder() as scratch:
        yield scratch
        with interrupts_deferred(), new_folder(folder), ExitStack() as files:
            for path in sorted(scratch.iterdir()):
                target = folder / path.name
                stream = files.enter_context(atomic_write(target))
                stream.write(path.read_bytes())
                # A full disk raises here, before anything is replaced. Not all files are open at a
                # time: there may be more than a process can have.
                if not is_stream(target):
                    stream.close()


def _check_writable(source: Path, folder: Path, expected: str) -> None:
    if not folder.is_dir():
        raise InputError(source, expected, f"a file at {folder}")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(source, expected, error.strerror or str(error)) from None
