"""A mapper's whole memory as one file.

The file is a zip archive: `header.json` with the format's name and version and the mapper's
name, and `NAME.npy` for every array of the mapper's state, numbers only. The same state
gives the same bytes.
"""

from __future__ import annotations

import io
import json
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.files import read_bytes, replacing
from albot_core.mapper import Mapper
from albot_core.registry import MAPPERS, make_mapper

FORMAT = "albot-map"
VERSION = 3

_HEADER = "header.json"
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""The date of every member: the earliest that a zip archive knows."""

_TORN = (
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
"""What zipfile and numpy raise where bytes are lost or changed."""


def save_map(mapper: Mapper, path: Path) -> None:
    """Write all that `mapper` remembers to `path`, whole or not at all."""
    header = {"format": FORMAT, "version": VERSION, "mapper": mapper.name}
    with replacing(path) as stream, zipfile.ZipFile(stream, "w") as archive:
        _add(archive, _HEADER, json.dumps(header, sort_keys=True).encode())
        for name, array in sorted(mapper.state().items()):
            content = io.BytesIO()
            np.lib.format.write_array(content, np.asarray(array, order="C"), (1, 0), False)
            _add(archive, f"{name}.npy", content.getvalue())


def load_map(path: Path) -> Mapper:
    """The mapper that was saved to `path`; its run continues as if never stopped.

    Raises:
        InputError: The file is missing or torn, is no map, is of another version, or holds
            what its mapper's memory does not.
    """
    content = read_bytes(path)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except _TORN as error:
        raise InputError(path, "a whole map file", _one_line(error)) from None
    mapper = make_mapper(_mapper_name(path, members.pop(_HEADER, None)))
    state = {
        name.removesuffix(".npy"): _array(path, name, member) for name, member in members.items()
    }
    _check_state(path, mapper, state)
    mapper.restore(state)
    return mapper


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    member = zipfile.ZipInfo(name, date_time=_EPOCH)
    member.external_attr = 0o644 << 16
    archive.writestr(member, content, zipfile.ZIP_DEFLATED, compresslevel=6)


def _mapper_name(path: Path, content: bytes | None) -> str:
    """The mapper named in the header, once it is known to be a header that we can read."""
    try:
        header = json.loads(content or b"")
    except ValueError:
        header = None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError(path, f"a header of format {FORMAT!r}", "none", place=_HEADER)
    if header.get("version") != VERSION:
        found = repr(header.get("version"))
        raise InputError(path, f"version {VERSION} of the format", found, place=_HEADER)
    name = header.get("mapper")
    if not isinstance(name, str) or name not in MAPPERS:
        found = repr(name)
        raise InputError(path, f"a mapper, one of {', '.join(MAPPERS)}", found, place=_HEADER)
    return name


def _array(path: Path, name: str, content: bytes) -> np.ndarray:
    """The array of numbers in a member, which must be of just the size that it declares."""
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    except _TORN as error:
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


def _check_state(path: Path, mapper: Mapper, state: dict[str, np.ndarray]) -> None:
    """Raise InputError unless the arrays are of the names and kinds that the mapper keeps."""
    kept = mapper.state()
    for name in sorted(kept.keys() | state.keys()):
        if name not in state:
            raise InputError(path, f"the array {name}", "none", place=f"{name}.npy")
        if name not in kept:
            raise InputError(path, f"only arrays of {mapper.name}", name, place=f"{name}.npy")
        mine, theirs = kept[name], state[name]
        if (mine.dtype, mine.ndim) != (theirs.dtype, theirs.ndim):
            raise InputError(
                path,
                f"{mine.ndim} dimensions of {mine.dtype}",
                f"{theirs.ndim} of {theirs.dtype}",
                place=f"{name}.npy",
            )
