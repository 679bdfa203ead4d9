"""Reading compressed text and writing files whole or not at all."""

from __future__ import annotations

import gzip
import io
import lzma
import os
import shutil
import stat
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from albot_core.errors import InputError, MissingFileError
from albot_core.interrupts import interrupts_deferred

_PACKED = {b"\x1f\x8b": ".gz", b"\xfd7zXZ\x00": ".xz"}
"""How files begin that are packed, and how their names end."""
_PIECE = 4096
"""How many unpacked bytes are asked for at a time."""
LARGEST = 128 << 20
"""Bytes to which a file may unpack whose format sets no bound of its own: no robot's log is larger.
A few kilobytes can unpack to more than any memory holds."""


def _open_plain(path: Path) -> io.BufferedIOBase:
    return path.open("rb")


def _open_gzip(path: Path) -> io.BufferedIOBase:
    return gzip.GzipFile(path, "rb")


def _open_xz(path: Path) -> io.BufferedIOBase:
    return lzma.LZMAFile(path, "rb")


_OPENERS: dict[str, Callable[[Path], io.BufferedIOBase]] = {".gz": _open_gzip, ".xz": _open_xz}


def exists(path: Path) -> bool:
    """Whether something is there; nothing is under a name that the system does not take."""
    try:
        return path.exists()
    except OSError:
        return False


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """The content of a file, unpacked where its name ends in `.gz` or `.xz`.

    Args:
        path: The file.
        largest: How many bytes it may hold or unpack to.

    Raises:
        InputError: The file is missing, unreadable or too large, or its compression is torn.
    """
    content, torn = read_beginning(path, largest)
    if torn is not None:
        raise torn
    return content


def read_beginning(path: Path, largest: int = LARGEST) -> tuple[bytes, InputError | None]:
    """What `read_bytes` returns, or as much of it as unpacks and the error that ends it.

    Raises:
        InputError: The file is missing, unreadable or too large.
    """
    pieces: list[bytes] = []
    torn = None
    try:
        for piece in _pieces(path, largest):  # What precedes a tear is kept.
            pieces.append(piece)  # noqa: PERF402
    except InputError:
        raise
    except FileNotFoundError:
        raise MissingFileError(path) from None
    except IsADirectoryError:
        raise InputError(path, "a file", "a folder") from None
    except (EOFError, lzma.LZMAError, gzip.BadGzipFile, zlib.error) as error:
        torn = InputError(path, f"whole {path.suffix[1:]} data", str(error))
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or str(error)) from None
    except ValueError as error:  # A name that no system has: one with a zero byte in it.
        raise InputError(path, "a file that exists", str(error)) from None
    for start, suffix in _PACKED.items():
        if path.suffix not in _OPENERS and pieces and pieces[0].startswith(start):
            raise InputError(path, f"a name that ends in {suffix}, as what is in it is packed so")
    return b"".join(pieces), torn


def _pieces(path: Path, largest: int) -> Iterator[bytes]:
    """The content of a file, unpacked, piece by piece."""
    expected = f"{largest:,} bytes at most"
    if (size := path.stat().st_size) > largest:
        raise InputError(path, expected, f"{size:,}")
    size = 0
    with _OPENERS.get(path.suffix, _open_plain)(path) as stream:
        while piece := stream.read(_PIECE):
            size += len(piece)
            if size > largest:
                raise InputError(path, expected, "more, unpacked")
            yield piece


def is_stream(path: Path) -> bool:
    """Whether what is written to `path` goes to a pipe or a device, not into a file.

    Raises:
        InputError: Nothing can be written there: it is a folder or something else that takes
            no bytes, or the folder that it would stand in does not exist.
    """
    expected = "a file to write"
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        parent = Path(os.path.realpath(path)).parent
        if not parent.is_dir():
            raise InputError(path, f"a folder {parent} to write to", "none") from None
        return False
    except OSError as error:
        raise InputError(path, expected, error.strerror or str(error)) from None
    if stat.S_ISDIR(mode):
        raise InputError(path, expected, "a folder")
    if stat.S_ISBLK(mode) or stat.S_ISSOCK(mode):
        raise InputError(path, expected, "a disk" if stat.S_ISBLK(mode) else "a socket")
    return not stat.S_ISREG(mode)


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary neighbour of `path` that takes its place when the block ends well.

    A reader sees the old file or the whole new one, never a part. Where `path` is a symbolic
    link, that is true of the file it points to. A pipe or a device gets all bytes at the end.
    When the block raises, or is interrupted, nothing is left behind.

    Raises:
        InputError: Nothing can be written there, see `is_stream`.
        OSError: There is no room left; it names `path`.
    """
    if is_stream(path):
        content = io.BytesIO()
        yield content
        with _refused_as_input(path), path.open("wb") as stream:
            stream.write(content.getvalue())
        return
    target = Path(os.path.realpath(path))
    beside: Path | None = None
    try:
        with _refused_as_input(path), interrupts_deferred():
            handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
            beside = Path(name)
        with os.fdopen(handle, "wb") as stream:
            yield stream
        with interrupts_deferred():
            beside.chmod(_permissions(target))
            beside.replace(target)
    except BaseException as error:
        if beside is not None:
            beside.unlink(missing_ok=True)
            if isinstance(error, OSError) and error.filename in (None, str(beside)):
                error.filename = str(path)  # What was to be written, not the neighbour.
        raise


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder of our own for the time of the block, gone after it, interrupted or not."""
    folder: Path | None = None
    try:
        with interrupts_deferred():
            folder = Path(tempfile.mkdtemp(prefix="albot-"))
        yield folder
    finally:
        if folder is not None:
            with interrupts_deferred():
                shutil.rmtree(folder)


def make_folder(folder: Path) -> None:
    """Make a folder where there is none; the one that it stands in has to exist.

    Raises:
        InputError: It cannot be made.
    """
    try:
        folder.mkdir(exist_ok=True)
    except FileNotFoundError:
        raise InputError(folder, f"a folder {folder.parent} to make it in", "none") from None
    except OSError as error:
        found = "a file" if folder.exists() else error.strerror or str(error)
        raise InputError(folder, "a folder to write to", found) from None


@contextmanager
def _refused_as_input(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(path, "a file to write", error.strerror or str(error)) from None


def _permissions(target: Path) -> int:
    """Those of the file that is there; those of a new file where there is none."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text to `path`, whole or not at all."""
    with replacing(path) as stream:
        stream.write(text.encode())
