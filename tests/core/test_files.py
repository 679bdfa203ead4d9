"""Files are written whole or not at all, to where their path leads."""

from __future__ import annotations

import errno
import os
import signal
import socket
import stat
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from albot_core.errors import InputError
from albot_core.files import (
    atomic_write,
    is_left_over,
    make_folder,
    new_folder,
    scratch_folder,
    sole_writer,
    write_text,
)


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_replaced_and_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("old")
    path.chmod(0o640)
    write_text(path, "new")
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert _names(tmp_path) == ["a"]


@pytest.mark.parametrize("there", [True, False])
def test_a_symbolic_link_stays_and_its_target_is_written(tmp_path: Path, there: bool) -> None:
    (tmp_path / "far").mkdir()
    target, link = tmp_path / "far" / "target", tmp_path / "link"
    if there:
        target.write_text("old")
    link.symlink_to(Path("far") / "target")
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert _names(target.parent) == ["target"]


def test_a_pipe_gets_the_bytes(tmp_path: Path) -> None:
    path, found = tmp_path / "pipe", []
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: found.append(path.read_bytes()), daemon=True)
    reader.start()
    write_text(path, "new")
    reader.join(timeout=10)
    assert found == [b"new"]
    assert path.is_fifo()


def test_a_device_gets_the_bytes() -> None:
    ours, other = os.openpty()  # Among whose neighbours no file can be made, in no case.
    path = Path(os.ttyname(other))
    write_text(path, "new")
    assert os.read(ours, 99) == b"new"
    assert path.is_char_device()
    for end in (ours, other):
        os.close(end)


def _folder(path: Path) -> None:
    path.mkdir()


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)  # Its path could be too long.


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


@pytest.mark.parametrize(
    ("make", "found"),
    [(_folder, "found a folder"), (_socket, "found a socket"), (_loop, "symbolic link")],
)
def test_what_takes_no_bytes_is_refused(
    make: Callable[[Path], None], found: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    make(tmp_path / "a")
    with pytest.raises(InputError, match=rf"a: expected a file to write, .*{found}"):
        write_text(tmp_path / "a", "new")
    assert _names(tmp_path) == ["a"]


def test_a_disk_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "disk"
    path.touch()
    monkeypatch.setattr(stat, "S_ISBLK", lambda mode: stat.S_ISREG(mode))
    with pytest.raises(InputError, match="expected a file to write, found a disk"):
        write_text(path, "new")


@pytest.mark.parametrize("linked", [True, False])
def test_no_folder_is_made_unasked(tmp_path: Path, linked: bool) -> None:
    path = tmp_path / "gone" / "a"
    if linked:
        path = tmp_path / "link"
        path.symlink_to(Path("gone") / "a")
    with pytest.raises(InputError, match=r"expected an existing folder .*gone, found none"):
        write_text(path, "new")
    assert not (tmp_path / "gone").exists()


def test_a_folder_is_made_with_those_above_it(tmp_path: Path) -> None:
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "a" / "file").touch()
    for path, found in (("file", "a file"), ("file/c", "Not a directory")):
        with pytest.raises(InputError, match=f"expected a folder to write to, found {found}"):
            make_folder(tmp_path / "a" / path)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_the_old_file_and_nothing_else(tmp_path: Path, number: int) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "a"
    path.write_text("old")
    before = signal.signal(number, stop)
    try:
        with pytest.raises(KeyboardInterrupt), atomic_write(path) as stream:
            stream.write(b"new")
            signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt), scratch_folder() as scratch:
            (scratch / "b").touch()
            signal.raise_signal(number)
    finally:
        signal.signal(number, before)
    assert path.read_text() == "old"
    assert _names(tmp_path) == ["a"]
    assert not scratch.exists()


def test_a_new_folder_goes_with_what_failed_in_it(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "new"):
        write_text(tmp_path / "new" / "a", "a")
        raise KeyboardInterrupt
    assert _names(tmp_path) == []
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "new" / "b" / "c"):
        (tmp_path / "new" / "other").touch()  # Somebody else's.
        raise KeyboardInterrupt
    assert _names(tmp_path / "new") == ["other"]
    (tmp_path / "new" / "other").unlink()
    (tmp_path / "new").rmdir()
    with new_folder(tmp_path / "old"):
        write_text(tmp_path / "old" / "a", "a")
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "old"):
        raise KeyboardInterrupt
    assert _names(tmp_path / "old") == ["a"]


def test_a_temporary_file_is_told_from_others(tmp_path: Path) -> None:
    with atomic_write(tmp_path / ".my.v2.json"):
        (left,) = tmp_path.iterdir()
        assert is_left_over(left, (".json",))
        assert not is_left_over(left, (".yml", ".jsonl"))
    for name in (".my.v2.json", "a.json.abcdefgh", ".a.json.swp", ".a.b.c", ".abcdefgh"):
        assert not is_left_over(Path(name), (".json",))


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such locks")
def test_one_writer_at_a_time_and_all_where_there_are_no_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fcntl

    file = tmp_path / "file"
    with pytest.raises(InputError, match="file not found"), sole_writer(file, tmp_path):
        pytest.fail("entered")
    file.write_text("kept")
    with (
        sole_writer(file, tmp_path),
        pytest.raises(InputError, match="expected a folder that no other process writes into"),
        sole_writer(file, tmp_path),
    ):
        pytest.fail("entered twice")
    with ExitStack() as first:
        first.enter_context(sole_writer(file, tmp_path))
        threading.Timer(0.3, first.pop_all().close).start()
        with sole_writer(file, tmp_path, patience=30.0):
            pass
    assert file.read_text() == "kept"

    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with sole_writer(file, tmp_path), sole_writer(file, tmp_path):
        pass
