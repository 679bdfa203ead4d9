"""The folder of a run's rows: what was done, a row a task, written as it comes.

- `run.json`: the command, its plan, the version of albot-env.
- `rows-00000-DIGEST.parquet`, …: rows that are complete (`rows-00000.jsonl` without the extra
  `cluster`). The digest is the beginning of the content's SHA-256: pyarrow, which takes any amount
  of memory for a damaged file, never sees one.
- `rows.jsonl`: the newest rows, a line each.

A row is appended to `rows.jsonl` in one write as soon as its task has ended, so a process that is
killed loses none; at most the last line is torn, and that task is run again. When there are many,
they become a part, which appears as a whole. If the process is killed between that and the emptying
of `rows.jsonl`, rows are there twice, and count once.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import io
import json
import math
import os
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import albot_env
from albot_core.errors import InputError
from albot_core.files import (
    atomic_write,
    decode_text,
    is_left_over,
    make_folder,
    read_bytes,
    sole_writer,
    write_all,
    write_text,
)
from albot_core.json_document import parse_json, read_json
from albot_core.plain_data import Location, read_record
from albot_core.yaml_document import KeyPath, dotted

MANIFEST, TAIL = "run.json", "rows.jsonl"
NUMBER = "number"
"""The column with the number of the task, which every row has."""
PART_ROWS, PART_BYTES = 10_000, 32 << 20
"""Number of rows, and their size in `rows.jsonl` (bytes), at which they become a part."""
_SYNCED = 1.0
"""Longest time between two rows after which the disk is told to keep them (s)."""
_PART = re.compile(r"rows-\d{5}(\.jsonl|-([0-9a-f]{16})\.parquet)")
_LARGEST_LINE = 64 << 20
"""Largest size of a row (bytes)."""
_LARGEST_PART = PART_BYTES + _LARGEST_LINE
"""Largest size of a part (bytes)."""
_KINDS = {
    "command": str, "words": list[str], "plan": dict[str, Any], "tasks": int, "version": str,
}  # fmt: skip

_TYPES: Mapping[str, Any] = {
    "string": str | None, "int64": int | None, "uint64": int | None, "double": float | None,
    "json": Any,
}  # fmt: skip
"""What the values of each type of column are in JSON."""
_WHOLE = {"int64": range(-(2**63), 2**63), "uint64": range(2**64)}
"""The whole numbers of each type of column."""

Columns = Mapping[str, str]
"""Types of the columns by name, of `_TYPES`: as pyarrow names them, or `json` for what has parts.
"""
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What a run is."""

    command: str
    """Name of the subcommand."""
    words: Sequence[str]
    """Its arguments, without those that say how it is run."""
    plan: Mapping[str, Any]
    """What is run, as plain data, by which two runs are compared."""
    tasks: int
    """Number of tasks."""

    @classmethod
    def read(cls, folder: Path, command: str) -> Manifest:
        """Read what the run of a folder is.

        Args:
            folder: The folder.
            command: Name of the subcommand that reads it.

        Raises:
            InputError: It is no such folder, it is of another command, or of another version.
        """
        file = folder / MANIFEST
        if not file.is_file():
            raise InputError(folder, f"the folder of rows of `albot {command}`", f"no {MANIFEST}")
        found = read_record(_KINDS, read_json(file), Location(file))
        if found["command"] != command:
            expected = f"rows of `albot {command}`"
            raise InputError(file, expected, f"those of `albot {found['command']}`")
        version = found.pop("version")
        if version != albot_env.__version__:
            expected = f"rows of albot-env {albot_env.__version__}, or a new folder"
            raise InputError(file, expected, f"those of {version}", place="version")
        return cls(**found)


@dataclass(kw_only=True)
class RowsFolder:
    """The folder of a run's rows.

    Use `opened`, in whose block rows can be added.
    """

    path: Path
    """The folder."""
    manifest: Manifest
    """What is run."""
    columns: Columns
    """The columns beside `NUMBER`."""
    _tail: io.FileIO | None = field(default=None, init=False)
    _waiting: list[Row] = field(default_factory=list, init=False)
    _bytes: int = field(default=0, init=False)
    _synced: float = field(default=0.0, init=False)

    @contextmanager
    def opened(self, *, resume: bool) -> Iterator[dict[int, Row]]:
        """Begin the folder, or go on with it; yield the rows that it has, by number.

        No other process writes into the folder meanwhile. At the end all rows become parts, however
        the block ends.

        Args:
            resume: Whether the folder is there already.

        Raises:
            InputError: A new folder is not empty, the run of the folder is another, a file is
                damaged, or another process writes into it.
            OSError: The disk is full.
        """
        if resume:
            self._check_same(Manifest.read(self.path, self.manifest.command))
        else:
            self._begin()
        with sole_writer(self.path / MANIFEST, self.path):
            rows = {row[NUMBER]: row for row in read_rows(self.path, self.columns)}
            if max(rows, default=0) >= self.manifest.tasks:
                expected = f"rows of tasks below {self.manifest.tasks:,}"
                raise InputError(self.path, expected, f"one of task {max(rows):,}")
            with (self.path / TAIL).open("ab", buffering=0) as self._tail:
                self._keep_whole_lines()
                try:
                    yield rows
                finally:
                    self._write_part()

    def _begin(self) -> None:
        make_folder(self.path)
        for path in self.path.iterdir():
            if not is_left_over(path, (MANIFEST,)):
                raise InputError(self.path, "a new or an empty folder (or --resume)", "other files")
        for left in self.path.iterdir():  # By a process that was killed right here.
            left.unlink(missing_ok=True)
        manifest = {name: getattr(self.manifest, name) for name in ("command", "plan", "tasks")}
        manifest |= {"words": list(self.manifest.words), "version": albot_env.__version__}
        write_text(self.path / MANIFEST, json.dumps(manifest, indent=1) + "\n")

    def _check_same(self, found: Manifest) -> None:
        """Raise InputError if the folder's run is another than that which is to go on."""
        wanted = json.loads(json.dumps(dict(self.manifest.plan)))
        for name in {**wanted, **found.plan}:
            if wanted.get(name) != found.plan.get(name):
                expected = f"the rows of this run, whose {name} is {wanted.get(name)}"
                raise InputError(self.path / MANIFEST, expected, str(found.plan.get(name)))
        if found.tasks != self.manifest.tasks:
            expected = f"the rows of {self.manifest.tasks:,} tasks"
            raise InputError(self.path / MANIFEST, expected, f"{found.tasks:,}", place="tasks")

    def add(self, number: int, row: Mapping[str, Any]) -> None:
        """Keep the row of a task that has ended.

        Args:
            number: Number of the task.
            row: A value of each column; None where there is none.

        Raises:
            OSError: The disk is full.
        """
        assert self._tail is not None, "rows are added to an opened folder"
        assert row.keys() == self.columns.keys()
        whole = {NUMBER: number, **row}
        line = json.dumps(whole, allow_nan=False).encode() + b"\n"
        with self._named():
            self._append(line)  # From here on, it outlives this process.
            if time.monotonic() - self._synced > _SYNCED:
                os.fsync(self._tail.fileno())
                self._synced = time.monotonic()
        self._waiting.append(whole)
        self._bytes += len(line)
        if len(self._waiting) >= PART_ROWS or self._bytes >= PART_BYTES:
            self._write_part()

    def _append(self, line: bytes) -> None:
        """Append a line to `rows.jsonl`, or nothing if the disk is full."""
        assert self._tail is not None
        try:
            write_all(self._tail, line)
        except OSError:
            self._tail.truncate(self._bytes)
            raise

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Name the file in errors of a full disk."""
        try:
            yield
        except OSError as error:
            error.filename = error.filename or str(self.path / TAIL)
            raise

    def _keep_whole_lines(self) -> None:
        """Take what `rows.jsonl` has as the next part's, without a last line that is torn."""
        assert self._tail is not None
        content = (self.path / TAIL).read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if len(whole) < len(content):
            self._tail.truncate(len(whole))
        self._waiting = list(_read_lines(self.path / TAIL, self.columns, torn=True))
        self._bytes = len(whole)

    def _write_part(self) -> None:
        """Let the rows of `rows.jsonl` become a part."""
        assert self._tail is not None
        if not self._waiting:
            return
        number = len(parts(self.path))
        if importlib.util.find_spec("pyarrow") is None:
            with self._named():
                content = (self.path / TAIL).read_bytes()
            with atomic_write(self.path / f"rows-{number:05}.jsonl") as stream:
                stream.write(content)
        else:
            content = _parquet(self._waiting, self.columns)
            name = f"rows-{number:05}-{_digest(content)}.parquet"
            with atomic_write(self.path / name) as stream:
                stream.write(content)
        self._tail.truncate(0)
        self._waiting, self._bytes = [], 0


def parts(folder: Path) -> list[Path]:
    """Return the files of the parts of a folder, in order."""
    return sorted(path for path in folder.iterdir() if _PART.fullmatch(path.name))


def read_rows(folder: Path, columns: Columns) -> Iterator[Row]:
    """Yield the rows of a folder, part by part; the memory is that of a part.

    Args:
        folder: The folder.
        columns: The columns beside `NUMBER`.

    Raises:
        InputError: A file is damaged, or is Parquet and the extra `cluster` is missing.
    """
    for path in parts(folder):
        if path.suffix == ".parquet":
            yield from _read_parquet(path, columns)
        else:
            yield from _read_lines(path, columns)
    if (folder / TAIL).exists():
        yield from _read_lines(folder / TAIL, columns, torn=True)


def _read_lines(path: Path, columns: Columns, *, torn: bool = False) -> Iterator[Row]:
    """Yield the rows of JSON lines; `torn` allows that the last line is not complete."""
    content = read_bytes(path, _LARGEST_PART)
    if torn:
        content = content[: content.rfind(b"\n") + 1]
    lines = decode_text(content, path).split("\n")
    if lines.pop():
        raise InputError(path, "lines that end with a line feed", "a torn one")
    kinds = {NUMBER: int, **{name: _TYPES[kind] for name, kind in columns.items()}}
    for number, line in enumerate(lines, start=1):
        where = _line_location(path, number)
        row = read_record(kinds, parse_json(line, path, f"line {number}"), where)
        for name, kind in columns.items():
            if kind in _WHOLE and row[name] is not None and row[name] not in _WHOLE[kind]:
                raise where.at(name).error(f"a whole number of {kind}", str(row[name]))
        yield _checked(row, where)


def _line_location(path: Path, number: int) -> Location:
    def place(at: KeyPath) -> str:
        return f"line {number}, {dotted(at)}" if at else f"line {number}"

    return Location(path, place=place)


def _read_parquet(path: Path, columns: Columns) -> Iterator[Row]:
    _require_pyarrow(path)
    import pyarrow
    from pyarrow import parquet

    where, content = Location(path), read_bytes(path, _LARGEST_PART)
    named = _PART.fullmatch(path.name)
    if named is None or named[2] != _digest(content):
        raise InputError(path, "a Parquet file with the digest of its name", _digest(content))
    try:
        with parquet.ParquetFile(pyarrow.BufferReader(content)) as file:
            if file.schema_arrow != _schema(columns):
                found = ", ".join(file.schema_arrow.names)
                raise InputError(path, f"the columns {', '.join((NUMBER, *columns))}", found)
            for batch in file.iter_batches():
                for row in batch.to_pylist():
                    for name, kind in columns.items():
                        if kind == "json" and row[name] is not None:
                            row[name] = parse_json(row[name], path, name)
                    yield _checked(row, where)
    except (pyarrow.ArrowException, OSError) as error:
        said = str(error).partition("\n")[0]
        raise InputError(path, "a Parquet file of rows", said) from None


def _checked(row: Row, where: Location) -> Row:
    if row[NUMBER] is None or row[NUMBER] < 0:
        raise where.at(NUMBER).error("the number of a task", str(row[NUMBER]))
    return row


def _require_pyarrow(path: Path) -> None:
    if importlib.util.find_spec("pyarrow") is None:
        raise InputError(path, "the package pyarrow of the extra `cluster`", "none")


def _schema(columns: Columns) -> Any:
    import pyarrow

    named = {name: "string" if kind == "json" else kind for name, kind in columns.items()}
    fields = [(name, pyarrow.type_for_alias(kind)) for name, kind in named.items()]
    return pyarrow.schema([(NUMBER, pyarrow.int64()), *fields])


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _parquet(rows: Sequence[Row], columns: Columns) -> bytes:
    """Return rows as the content of a Parquet file."""
    import pyarrow
    from pyarrow import parquet

    texts = [name for name, kind in columns.items() if kind == "json"]
    plain = [
        {**row, **{n: None if row[n] is None else json.dumps(row[n]) for n in texts}}
        for row in rows
    ]
    table = pyarrow.Table.from_pylist(plain, schema=_schema(columns))
    stream = pyarrow.BufferOutputStream()
    parquet.write_table(table, stream, compression="zstd")
    content: bytes = stream.getvalue().to_pybytes()
    return content


def files_digest(names: Iterable[str]) -> Mapping[str, str]:
    """Return the SHA-256 of each name that is a file, so that a changed one is noticed."""
    found = {}
    for name in names:
        path = Path(name)
        if path.is_file():
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def plain_value(value: Any) -> Any:
    """Return a value of an info as JSON can hold it, to the last bit; `value_of` is the inverse.

    Args:
        value: A number, a text, an array, or sequences and mappings of these.

    Raises:
        TypeError: It is something else.
    """
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        if array.dtype.kind not in "biufU":
            raise TypeError(f"an array of {array.dtype}")
        packed = base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()
        return {"array": packed, "dtype": array.dtype.str, "shape": list(array.shape)}
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": repr(value)}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Mapping):
        return {"mapping": {str(name): plain_value(each) for name, each in value.items()}}
    if isinstance(value, list | tuple):
        return [plain_value(each) for each in value]
    raise TypeError(f"a {type(value).__name__}")


def value_of(plain: Any) -> Any:
    """Return the value that `plain_value` has written; a single NumPy number as such.

    Raises:
        ValueError: It is not such data.
    """
    if isinstance(plain, list):
        return [value_of(each) for each in plain]
    if not isinstance(plain, dict):
        return plain
    if plain.keys() == {"float"}:
        return float(plain["float"])
    if plain.keys() == {"mapping"}:
        return {name: value_of(each) for name, each in plain["mapping"].items()}
    if plain.keys() != {"array", "dtype", "shape"}:
        raise ValueError(f"a mapping with {', '.join(plain)}")
    dtype = np.dtype(plain["dtype"])
    if dtype.kind not in "biufU":
        raise ValueError(f"an array of {dtype}")
    array = np.frombuffer(base64.b64decode(plain["array"]), dtype).reshape(plain["shape"])
    return array[()] if array.ndim == 0 else array.copy()
