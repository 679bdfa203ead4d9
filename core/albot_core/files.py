"""Reading compressed text and writing files whole or not at all."""

from __future__ import annotations

import gzip
import io
import lzma
import os
import tempfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from albot_core.errors import InputError

_PACKED = {b"\x1f\x8b": ".gz", b"\xfd7zXZ\x00": ".xz"}
"""How files begin that are packed, and how their names end."""
_PIECE = 4096
"""How many unpacked bytes are asked for at a time."""


def _open_plain(path: Path) -> io.BufferedIOBase:
    return path.open("rb")


def _open_gzip(path: Path) -> io.BufferedIOBase:
    return gzip.GzipFile(path, "rb")


def _open_xz(path: Path) -> io.BufferedIOBase:
    return lzma.LZMAFile(path, "rb")


_OPENERS: dict[str, Callable[[Path], io.BufferedIOBase]] = {".gz": _open_gzip, ".xz": _open_xz}


def read_bytes(path: Path) -> bytes:
    """The content of a file, unpacked where its name ends in `.gz` or `.xz`.

    Raises:
        InputError: The file is missing, unreadable, or its compression is torn.
    """
    content, torn = read_beginning(path)
    if torn is not None:
        raise torn
    return content


def read_beginning(path: Path) -> tuple[bytes, InputError | None]:
    """What `read_bytes` returns, or as much of it as unpacks and the error that ends it.

    Raises:
        InputError: The file is missing or unreadable.
    """
    opener = _OPENERS.get(path.suffix, _open_plain)
    pieces: list[bytes] = []
    torn = None
    try:
        with opener(path) as stream:
            # Small pieces, so that what precedes a tear is kept.
            while piece := stream.read(_PIECE):
                pieces.append(piece)
    except FileNotFoundError:
        raise InputError(path, "a file that exists", "none") from None
    except IsADirectoryError:
        raise InputError(path, "a file", "a folder") from None
    except (EOFError, lzma.LZMAError, gzip.BadGzipFile, zlib.error) as error:
        torn = InputError(path, f"whole {path.suffix[1:]} data", str(error))
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or str(error)) from None
    for start, suffix in _PACKED.items():
        if path.suffix not in _OPENERS and pieces and pieces[0].startswith(start):
            raise InputError(path, f"a name that ends in {suffix}, as what is in it is packed so")
    return b"".join(pieces), torn


@contextmanager
def replacing(path: Path, mode: str = "wb") -> Iterator[IO[bytes]]:
    """Open a temporary neighbour of `path` that takes its place when the block ends well.

    A reader sees the old file or the whole new one, never a part. Missing parent
    folders are made. When the block raises, nothing is left behind.

    Raises:
        InputError: Nothing can be written there.
    """
    if path.is_dir():
        raise InputError(path, "a file to write", "a folder")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise InputError(path, "a file to write", error.strerror or str(error)) from None
    try:
        with os.fdopen(handle, mode) as stream:
            yield stream
        umask = os.umask(0)
        os.umask(umask)
        Path(name).chmod(0o666 & ~umask)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text to `path`, whole or not at all."""
    with replacing(path) as stream:
        stream.write(text.encode())
