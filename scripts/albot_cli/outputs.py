"""Output files: check that they can be written before the work, and write all or none."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.drawing.figure import PRINT_DPI, SUFFIXES, check_figure_name, save_figure
from albot_core.errors import InputError
from albot_core.files import (
    atomic_write,
    exists,
    is_stream,
    new_folder,
    own_folder,
    scratch_folder,
)
from albot_core.interrupts import interrupts_deferred

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORCE = click.option("--force", is_flag=True, help="Overwrite existing files.")
"""The option of every command that writes files named by the user."""
JSON = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object, and show no progress."
)
"""The option of every command whose results a program may read."""
_OTHER_FILES = ("png", "record", "out", "video")
"""Options that name other files that a command writes."""
_DPIS = (50, 600)
"""Fewest and most dots an inch of a figure."""
_Command = TypeVar("_Command", bound=Callable[..., Any])


def check_folder(
    folder: Path,
    names: Iterable[str] = (),
    *,
    force: bool = False,
    figure: FigureFile | None = None,
) -> None:
    """Raise InputError if a folder cannot be made or written into, or one of the files exists.

    Args:
        folder: The folder; those above it need not exist either.
        names: Names of the files to be written into it.
        force: Whether these files may exist.
        figure: A figure that is to be none of these files.
    """
    if figure is not None:
        figure.check_apart(folder / name for name in names)
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


@dataclass(frozen=True)
class FigureFile:
    """A figure for a paper, as `--figure` and `--dpi` ask for it."""

    path: Path
    dpi: int

    def named(self, name: str) -> FigureFile:
        """Return the file of one of several figures: `FILE-NAME` with the same ending."""
        return replace(self, path=self.path.with_stem(f"{self.path.stem}-{name}"))

    def check_apart(self, files: Iterable[Path]) -> None:
        """Raise InputError if it is one of the files that the command reads or writes besides."""
        for path in files:
            if path.resolve() == self.path.resolve():
                expected = "a file other than those that the command reads or writes besides"
                raise InputError("--figure", expected, str(self.path))

    def save(self, figure: Figure) -> Path:
        """Save a figure there; return its path."""
        save_figure(figure, self.path, self.dpi)
        return self.path


def save_both(drawn: Figure, png: Path | None, figure: FigureFile | None) -> dict[str, str]:
    """Save a picture as the files asked for; return their paths by `png` and `figure`."""
    files = {}
    if png is not None:
        save_figure(drawn, png)
        files["png"] = str(png)
    if figure is not None:
        files["figure"] = str(figure.save(drawn))
    return files


def figure_options(shows: str) -> Callable[[_Command], _Command]:
    """Return the decorator that adds `--figure` and `--dpi` to a command.

    The command gets `figure`, a `FigureFile` or None, once the file's name and place are right.
    It needs `--force`, and writes the figure to no other option's file.

    Args:
        shows: What the figure shows, for the help.
    """
    endings = ", ".join(SUFFIXES)

    def decorate(command: _Command) -> _Command:
        @wraps(command)
        def checked(*arguments: Any, figure: Path | None, dpi: int | None, **options: Any) -> Any:
            others = {name: file for name, file in options.items() if name in _OTHER_FILES}
            found = _figure_file(figure, dpi, others, options["force"])
            return command(*arguments, figure=found, **options)

        add = click.option(
            "--dpi",
            type=CountType(*_DPIS),
            help=f"Dots an inch of the --figure.  [default: {PRINT_DPI}]",
        )
        add_figure = click.option(
            "--figure",
            metavar="FILE",
            type=PathType(dir_okay=False),
            help=f"Draw {shows} for a paper: {endings}.",
        )
        return cast(_Command, add_figure(add(checked)))

    return decorate


def _figure_file(
    path: Path | None, dpi: int | None, others: dict[str, Path | None], force: bool
) -> FigureFile | None:
    if path is None:
        if dpi is not None:
            raise InputError("--dpi", "--figure FILE, whose dots it counts", "none")
        return None
    check_figure_name(path, "--figure")
    for name, other in others.items():
        if other is not None and other.resolve() == path.resolve():
            raise InputError("--figure", f"a file other than that of --{name}", str(path))
    check_file(path, force=force)
    return FigureFile(path, dpi or PRINT_DPI)


@contextmanager
def own_folders(*folders: Path | None) -> Iterator[Callable[[Path | None], None]]:
    """As `own_folder` for each of several folders, of which some may be the same.

    Args:
        folders: The folders; None for none.

    Yields:
        Call it with one of them once what that holds is worth keeping.

    Raises:
        InputError: A folder cannot be made, or another process writes into it.
    """
    named = {each.resolve(): each for each in folders if each is not None}
    with ExitStack() as stack:
        keeps = {real: stack.enter_context(own_folder(each)) for real, each in named.items()}

        def keep(folder: Path | None) -> None:
            if folder is not None:
                keeps[folder.resolve()]()

        yield keep


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
