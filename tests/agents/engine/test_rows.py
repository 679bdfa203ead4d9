"""The folder of a run's rows: nothing is lost, whatever ends the process that writes it."""

from __future__ import annotations

import errno
import importlib.util
import json
import os
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import albot_env
from albot_agents.engine import rows as module
from albot_agents.engine.rows import (
    MANIFEST,
    TAIL,
    Manifest,
    RowsFolder,
    parts,
    plain_value,
    read_rows,
    value_of,
)
from albot_core.errors import InputError
from tests.processes import running

COLUMNS = {"name": "string", "seed": "uint64", "length": "double", "found": "json"}
HAS_ARROW = importlib.util.find_spec("pyarrow") is not None


def folder_of(path: Path, **plan: Any) -> RowsFolder:
    whole = {"seed": 3, **plan}
    manifest = Manifest(command="stress", words=["--seed", "3"], plan=whole, tasks=100_000)
    return RowsFolder(path=path, manifest=manifest, columns=COLUMNS)


def row(number: int) -> dict[str, Any]:
    return {
        "name": f"row {number}",
        "seed": 2**64 - 1 - number,
        "length": 0.1 * number if number % 2 else None,
        "found": [[number, "a", {"b": 0.1}]],
    }


@pytest.fixture(params=[True, False], ids=["parquet", "lines"])
def packs(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether pyarrow is there."""
    if not request.param:
        monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    elif not HAS_ARROW:
        pytest.skip("pyarrow is not installed")
    return bool(request.param)


def test_rows_come_back_to_the_bit(
    tmp_path: Path, packs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PART_ROWS", 4)
    path = tmp_path / "new" / "rows"
    order = [5, 3, 0, 9, 8, 7, 1, 2, 4, 6]
    with folder_of(path).opened(resume=False) as known:
        assert known == {}
        folder = folder_of(path)
    with folder.opened(resume=True):
        for number in order[:6]:
            folder.add(number, row(number))
        (part,) = parts(path)
        assert re.fullmatch(r"rows-00000(-[0-9a-f]{16}\.parquet|\.jsonl)", part.name)
        assert (part.suffix == ".parquet") is packs
        assert len((path / TAIL).read_text().splitlines()) == 2
    with folder.opened(resume=True) as known:
        assert list(known) == order[:6]
        for number in order[6:]:
            folder.add(number, row(number))
    assert (path / TAIL).read_bytes() == b""
    assert list(read_rows(path, COLUMNS)) == [{"number": number, **row(number)} for number in order]


def test_a_torn_line_is_a_task_that_was_not_done(tmp_path: Path, packs: bool) -> None:
    path = tmp_path / "rows"
    with folder_of(path).opened(resume=False):
        pass
    lines = [json.dumps({"number": n, **row(n)}) for n in range(3)]
    (path / TAIL).write_text("\n".join(lines)[:-5])
    folder = folder_of(path)
    with folder.opened(resume=True) as known:
        assert list(known) == [0, 1]
        folder.add(2, row(2))
    assert [found["number"] for found in read_rows(path, COLUMNS)] == [0, 1, 2]


def test_what_is_in_a_part_and_in_the_tail_counts_once(tmp_path: Path, packs: bool) -> None:
    """A process was killed between writing the part and emptying the tail."""
    path = tmp_path / "rows"
    folder = folder_of(path)
    with folder.opened(resume=False):
        folder.add(0, row(0))
        folder.add(1, row(1))
        content = (path / TAIL).read_bytes()
    (path / TAIL).write_bytes(content)
    with folder.opened(resume=True) as known:
        assert list(known) == [0, 1]


_WRITER = """
import os, sys, time
from pathlib import Path
from albot_agents.engine import rows
from tests.agents.engine.test_rows import folder_of, row
rows.PART_ROWS = 7
folder = folder_of(Path("rows"))
with folder.opened(resume=Path("rows").exists()) as known:
    for number in range(100000):
        if number not in known:
            folder.add(number, row(number))
            os.write(1, b"%d\\n" % number)  # It says so after it is kept.
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_no_row_is_lost_to_a_kill(tmp_path: Path) -> None:
    """At any moment, also while a part is written."""
    told: set[int] = set()
    rng = np.random.default_rng(5)
    for _ in range(3):
        with running([sys.executable, "-c", _WRITER], tmp_path) as process:
            assert process.stdout is not None
            for _ in range(int(rng.integers(20, 60))):
                told.add(int(process.stdout.readline()))
            os.killpg(process.pid, signal.SIGKILL)
            told |= {int(line) for line in process.stdout.read().splitlines()}
        known = {found["number"]: found for found in read_rows(tmp_path / "rows", COLUMNS)}
        assert known.keys() >= told
        assert all(found == {"number": n, **row(n)} for n, found in known.items())
        assert known.keys() == set(range(len(known)))


def test_others_are_refused_and_nothing_is_changed(tmp_path: Path) -> None:
    path = tmp_path / "rows"
    with folder_of(path).opened(resume=False):
        pass
    before = (path / MANIFEST).read_bytes()
    for folder, resume, found in (
        (folder_of(path), False, "a new or an empty folder .* found other files"),
        (folder_of(path, seed=4), True, "whose seed is 4, found 3"),
        (folder_of(path, steps=9), True, "whose steps is 9, found None"),
        (folder_of(tmp_path), True, "the folder of rows of `albot stress`, found no run.json"),
    ):
        with pytest.raises(InputError, match=found), folder.opened(resume=resume):
            pytest.fail("opened")
    with pytest.raises(InputError, match="rows of `albot evaluate`, found those of `albot stress`"):
        Manifest.read(path, "evaluate")
    with (
        folder_of(path).opened(resume=True),
        pytest.raises(InputError, match="no other process"),
        folder_of(path).opened(resume=True),
    ):
        pytest.fail("opened twice")
    assert (path / MANIFEST).read_bytes() == before
    manifest = json.loads(before)
    (path / MANIFEST).write_text(json.dumps(manifest | {"version": "0.0"}))
    with pytest.raises(InputError, match=f"{albot_env.__version__}, or a new folder, found"):
        Manifest.read(path, "stress")


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b'{"number": 1}\n', "line 1"),
        (b"[]\n", "line 1"),
        (b'{"number": -1, "name": "", "seed": 0, "length": 0.0, "found": []}\n', "-1"),
        (b"\xff\n", "line 1"),
        (
            b'{"number": 1, "name": "\xff", "seed": 0, "length": 0.0, "found": []}\n',
            "line 1: expected UTF-8 text, found the byte 0xff",
        ),
        (b'{"number": 1, "name": 3, "seed": 0, "length": 0.0, "found": []}\n', "line 1, name.* 3"),
        (b'{"number": 1, "name": "", "seed": 0, "length": "x", "found": []}\n', "length.* x"),
        (
            b'{"number": 1, "name": "", "seed": -1, "length": 0.0, "found": []}\n',
            "seed.*uint64",
        ),
        (b'{"number": true, "name": "", "seed": 0, "length": 0.0, "found": []}\n', "number.*true"),
        (
            b'{"number": 1, "name": "", "seed": 0, "length": 0.0}\n',
            "1, found: expected",
        ),
    ],
)
def test_a_damaged_tail_names_its_line(tmp_path: Path, content: bytes, found: str) -> None:
    path = tmp_path / "rows"
    with folder_of(path).opened(resume=False):
        pass
    (path / TAIL).write_bytes(content)
    with (
        pytest.raises(InputError, match=rf"rows\.jsonl.*{found}"),
        folder_of(path).opened(resume=True),
    ):
        pytest.fail("opened")


def test_a_folder_that_a_killed_process_had_just_begun_is_begun_again(tmp_path: Path) -> None:
    (tmp_path / ".run.json.ab12_x9z").touch()
    with folder_of(tmp_path).opened(resume=False) as rows:
        assert rows == {}
    assert not list(tmp_path.glob(".*"))


def test_a_row_of_a_task_that_is_none_is_refused(tmp_path: Path, packs: bool) -> None:
    path = tmp_path / "rows"
    with folder_of(path).opened(resume=False):
        pass
    content = json.dumps({"number": 100_000, **row(1)}) + "\n"
    (path / TAIL).write_text(content)
    expected = "rows: expected rows of tasks below 100,000, found one of task 100,000"
    with pytest.raises(InputError, match=expected), folder_of(path).opened(resume=True):
        pytest.fail("opened")
    assert (path / TAIL).read_text() == content


@pytest.mark.skipif(not HAS_ARROW, reason="pyarrow is not installed")
def test_a_damaged_part_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rows"
    folder = folder_of(path)
    with folder.opened(resume=False):
        folder.add(0, row(0))
    (part,) = parts(path)
    whole = part.read_bytes()
    part.write_bytes(whole[:-10])
    with pytest.raises(InputError, match=r"parquet: expected a Parquet file with the digest of"):
        list(read_rows(path, COLUMNS))
    part.write_bytes(whole)
    with pytest.raises(InputError, match="expected the columns number, other, found number, name"):
        list(read_rows(path, {"other": "int64"}))
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="the package pyarrow of the extra `cluster`, found none"):
        list(read_rows(path, COLUMNS))


def test_a_full_disk_keeps_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rows"
    folder = folder_of(path)
    with folder.opened(resume=False):
        folder.add(0, row(0))

    @contextmanager
    def full(target: Path) -> Iterator[Any]:
        raise OSError(errno.ENOSPC, "No space left on device", str(target))
        yield

    monkeypatch.setattr(module, "atomic_write", full)
    with pytest.raises(OSError, match="No space left"), folder.opened(resume=True):
        folder.add(1, row(1))
    assert {found["number"] for found in read_rows(path, COLUMNS)} == {0, 1}


ARRAYS = st.one_of(
    st.integers(-5, 5).map(np.int64),
    st.floats(allow_nan=True).map(np.float64),
    st.booleans().map(np.bool_),
    st.lists(st.floats(width=32), max_size=4).map(lambda rows: np.array(rows, np.float32)),
    st.just(np.zeros((0, 2))),
    st.just(np.array(["a", "bcd"])),
)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | ARRAYS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)


@given(VALUES)
def test_values_come_back_to_the_bit(value: Any) -> None:
    text = json.dumps(plain_value(value), allow_nan=False)
    assert same(value_of(json.loads(text)), value)


def same(one: Any, other: Any) -> bool:
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray | np.generic):
        return (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    return repr(one) == repr(other)


@pytest.mark.parametrize("plain", [{"a": 1}, {"array": "", "dtype": "O", "shape": []}])
def test_no_other_data_becomes_a_value(plain: Any) -> None:
    with pytest.raises(ValueError):
        value_of(plain)
    with pytest.raises(TypeError):
        plain_value(object())


@pytest.mark.skipif(sys.platform == "win32", reason="there are no limits of files")
def test_a_disk_that_is_full_in_the_middle_of_a_row_is_named_and_loses_no_other(
    tmp_path: Path, packs: bool
) -> None:
    import resource

    folder, size = folder_of(tmp_path / "rows"), 1000
    before, most = resource.getrlimit(resource.RLIMIT_FSIZE), 0
    with folder.opened(resume=False):
        pass
    with (
        pytest.raises(OSError, match=r"rows\.jsonl") as caught,
        folder.opened(resume=True),
    ):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            for number in range(100):
                folder.add(number, row(number))
                most = number
        finally:
            kept = (folder.path / TAIL).read_bytes()
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.errno == errno.EFBIG
    assert kept.endswith(b"\n")
    assert 0 < len(kept) <= size
    assert len(kept.splitlines()) == most + 1
    with folder.opened(resume=True) as known:
        assert list(known) == list(range(most + 1))
