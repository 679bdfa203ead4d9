"""Unpacking of compressed data within a limit, whatever size the data claims to have."""

from __future__ import annotations

import bz2
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import lz4.frame
import zstandard

from albot_core.errors import InputError
from albot_core.files import LARGEST

_PIECE = 1 << 20


def _open_zstd(stream: Any) -> Any:
    return zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)


_OPENERS: dict[str, Callable[[io.BufferedIOBase], Any]] = {
    "": lambda stream: stream,
    "none": lambda stream: stream,
    "bz2": bz2.BZ2File,
    "lz4": lz4.frame.LZ4FrameFile,
    "zstd": _open_zstd,
}
UNPACK_ERRORS = (zstandard.ZstdError, EOFError, OSError, RuntimeError)
"""What the libraries raise for damaged data."""


def _pieces(
    packed: io.BufferedIOBase, compression: str, source: Path, largest: int
) -> Iterator[bytes]:
    if compression not in _OPENERS:
        known = ", ".join(name for name in _OPENERS if name)
        raise InputError(source, f"a compression of {known}", repr(compression))
    size = 0
    stream = _OPENERS[compression](packed)
    while piece := stream.read(_PIECE):
        size += len(piece)
        if size > largest:
            found = f"{compression} data that unpacks to more"
            raise InputError(source, f"{largest:,} bytes at most in a part of a bag", found)
        yield piece


def unpack(data: bytes, compression: str, source: Path, largest: int = LARGEST) -> bytes:
    """Return unpacked data.

    Args:
        data: The data.
        compression: "none" or "", "bz2", "lz4" or "zstd".
        source: The file, for errors.
        largest: Largest unpacked size (bytes).

    Raises:
        InputError: The compression is unknown, or the data unpacks to too much.
        UNPACK_ERRORS: It is damaged.
    """
    return b"".join(_pieces(io.BytesIO(data), compression, source, largest))


def unpack_file(path: Path, compression: str, target: Path, largest: int) -> None:
    """Unpack a file into another one; arguments and errors as of `unpack`."""
    with path.open("rb") as packed, target.open("wb") as stream:
        for piece in _pieces(packed, compression, path, largest):
            stream.write(piece)
