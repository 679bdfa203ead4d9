"""Files of arrays: a zip archive of numeric arrays and one JSON header, without executable code.

An archive holds `header.json`, with the format's name and version and further data of its
writer, and `NAME.npy` for every array. The same content gives the same bytes. Reading accepts
nothing else: no pickled object, and no member that unpacks to more than it declares.
"""

from __future__ import annotations

import io
import json
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from albot_core.errors import InputError
from albot_core.files import atomic_write, read_bytes
from albot_core.json_document import parse_json
from albot_core.yaml_document import format_value

HEADER = "header.json"
"""The member with the header."""

_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every member: the earliest that a zip archive can store."""
_PLAIN = re.compile(r"[A-Za-z0-9_.-]{1,200}")
"""Allowed names of members: no folders, no paths."""
_MOST_MEMBERS = 10_000

CORRUPT = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    OSError,
    KeyError,
    ValueError,
    NotImplementedError,
    RuntimeError,
    SyntaxError,
    TypeError,
    tokenize.TokenError,
)
"""What zipfile and numpy raise for truncated or corrupt files."""


@dataclass(frozen=True, kw_only=True)
class ArchiveFormat:
    """The format of a kind of file."""

    name: str
    """Value of `format` in the header."""
    version: int
    """Value of `version` in the header; other versions are not read."""
    kind: str
    """Name of such a file in error messages."""
    largest: int
    """Largest unpacked size of a file (bytes); it is checked before unpacking."""

    def write(
        self, path: Path, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]
    ) -> None:
        """Write a file atomically.

        Args:
            path: The file.
            header: Content of the header besides format and version, as plain data.
            arrays: Numeric arrays by name.

        Raises:
            InputError: The file cannot be written, or could not be read for its size.
            OSError: The disk is full.
        """
        size = sum(array.nbytes for array in arrays.values())
        if size > self.largest:
            expected = f"{self.largest:,} bytes of arrays at most in a {self.kind}"
            raise InputError(path, expected, f"{size:,}")
        head = {"format": self.name, "version": self.version, **header}
        with atomic_write(path) as stream, zipfile.ZipFile(stream, "w") as archive:
            _add(archive, HEADER, json.dumps(head, sort_keys=True, allow_nan=False).encode())
            for name, array in sorted(arrays.items()):
                content = io.BytesIO()
                np.lib.format.write_array(content, np.asarray(array, order="C"), (1, 0), False)
                _add(archive, f"{name}.npy", content.getvalue())

    def read(self, path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Read a file; return the header, without format and version, and the arrays by name.

        Raises:
            InputError: The file is missing, truncated or too large, has another format or version,
                or holds anything but JSON and numeric arrays.
        """
        header, arrays = _unpacked(path, self.kind, self.largest)
        return self._header(path, header), arrays

    def _header(self, path: Path, content: bytes | None) -> dict[str, Any]:
        """Parse the header and check format and version."""
        header = None if content is None else parse_json(content, path, HEADER)
        if not isinstance(header, dict) or header.get("format") != self.name:
            other = header.get("format") if isinstance(header, dict) else None
            found = "none" if other is None else format_value(other)
            raise InputError(path, f"a header of format {self.name}", found, place=HEADER)
        if header.get("version") != self.version:
            found = repr(header.get("version"))
            raise InputError(path, f"version {self.version} of the format", found, place=HEADER)
        return {key: header[key] for key in header.keys() - {"format", "version"}}


def read_arrays(path: Path, kind: str, largest: int) -> dict[str, np.ndarray]:
    """Read the arrays in a file written by `numpy.savez`, by name.

    Args:
        path: The file.
        kind: Name of such a file in error messages.
        largest: Largest unpacked size (bytes).

    Raises:
        InputError: The file is missing, truncated or too large, or holds anything but numeric
            arrays.
    """
    header, arrays = _unpacked(path, kind, largest)
    if header is not None:
        raise InputError(path, "only arrays NAME.npy", HEADER)
    return arrays


def _unpacked(path: Path, kind: str, largest: int) -> tuple[bytes | None, dict[str, np.ndarray]]:
    """Return the header, None if there is none, and the arrays by name."""
    header, arrays = None, {}
    try:
        with zipfile.ZipFile(io.BytesIO(read_bytes(path, largest))) as archive:
            _check_members(path, archive.infolist(), largest)
            for name in archive.namelist():
                if name == HEADER:
                    header = archive.read(name)
                elif name.endswith(".npy"):
                    arrays[name.removesuffix(".npy")] = _array(path, name, archive.read(name))
                else:
                    raise InputError(path, f"only {HEADER} and arrays NAME.npy", name)
    except InputError:
        raise
    except CORRUPT as error:
        raise InputError(path, f"an intact {kind}", _one_line(error)) from None
    return header, arrays


def _check_members(path: Path, members: list[zipfile.ZipInfo], largest: int) -> None:
    """Raise InputError, before unpacking, for too many or too large members, or invalid names."""
    names = [member.filename for member in members]
    size = sum(member.file_size for member in members)
    if len(members) > _MOST_MEMBERS or size > largest:
        found = f"{len(members):,} members of {size:,} bytes"
        raise InputError(path, f"members of {largest:,} bytes in total at most", found)
    for name in names:
        if _PLAIN.fullmatch(name) is None:
            found = ascii(name)[:80]
            raise InputError(path, "members with plain names", found)
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(path, f"the member {twice} once", "a duplicate")


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    member = zipfile.ZipInfo(name, date_time=_EPOCH)
    member.external_attr = 0o644 << 16
    archive.writestr(member, content, zipfile.ZIP_DEFLATED, compresslevel=6)


def _array(path: Path, name: str, content: bytes) -> np.ndarray:
    """Return the numeric array in a member, which must have exactly the size that it declares."""
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    except CORRUPT as error:
        raise InputError(path, "an array", _one_line(error), place=name) from None
    if version != (1, 0):
        raise InputError(path, "npy version 1.0", ".".join(map(str, version)), place=name)
    if dtype.kind not in "biuf":
        raise InputError(path, "an array of numbers", str(dtype), place=name)
    rest = content[stream.tell() :]
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize
    if len(rest) != size or fortran:
        found = f"{len(rest)}" + (" in columns" if fortran else "")
        raise InputError(path, f"{size} bytes in rows", found, place=name)
    return np.frombuffer(rest, dtype).reshape(shape).copy()


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
