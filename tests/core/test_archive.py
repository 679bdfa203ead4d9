"""Files of arrays: what is in them comes back, and nothing else is taken."""

from __future__ import annotations

import io
import signal
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from albot_core.archive import HEADER, ArchiveFormat
from albot_core.errors import InputError
from tests.processes import running, wait_until

FORMAT = ArchiveFormat(name="test", version=1, kind="test file", largest=1 << 20)


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array)
    return stream.getvalue()


def _zip(path: Path, *members: tuple[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    header = (HEADER, b'{"format": "test", "version": 1}')
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in (header, *members):
            archive.writestr(name, content)
    return path


def test_what_was_written_comes_back(tmp_path: Path) -> None:
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b.c-d": np.array(7, np.int16)}
    FORMAT.write(tmp_path / "x", {"k": [1, None]}, arrays)
    header, back = FORMAT.read(tmp_path / "x")
    assert header == {"k": [1, None]}
    assert back.keys() == arrays.keys()
    for name, array in arrays.items():
        assert back[name].dtype == array.dtype
        np.testing.assert_array_equal(back[name], array)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("../up.npy", "members with plain names, found '../up.npy'"),
        ("/etc/passwd", "members with plain names"),
        ("a/b.npy", "members with plain names"),
        ("ä.npy", "members with plain names"),
        ("code.py", "only header.json and arrays NAME.npy, found code.py"),
        ("a.npz", "only header.json and arrays"),
    ],
)
def test_strange_members_are_refused(name: str, message: str, tmp_path: Path) -> None:
    path = _zip(tmp_path / "x", (name, _npy(np.zeros(1))))
    with pytest.raises(InputError, match=message):
        FORMAT.read(path)


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = _zip(tmp_path / "x", ("a.npy", bytes(1 << 21)))
    assert path.stat().st_size < 1 << 13
    with pytest.raises(InputError, match="members of 1,048,576 bytes in total at most"):
        FORMAT.read(path)
    many = [(f"a{k}.npy", b"") for k in range(10_001)]
    with pytest.raises(InputError, match="10,002 members"):
        FORMAT.read(_zip(tmp_path / "y", *many))


def test_a_member_that_lies_about_its_size_is_refused(tmp_path: Path) -> None:
    path = _zip(tmp_path / "x", ("a.npy", bytes(1 << 21)))
    content = path.read_bytes()
    # In both places where the size stands.
    path.write_bytes(content.replace((1 << 21).to_bytes(4, "little"), (64).to_bytes(4, "little")))
    with pytest.raises(InputError, match=r"an intact test file, found .*CRC"):
        FORMAT.read(path)


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "x"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)  # Nothing is on the disk.
    with pytest.raises(
        InputError, match="expected 1,048,576 bytes at most, found 1,099,511,627,776"
    ):
        FORMAT.read(path)


def test_a_member_stands_once(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate"):
        path = _zip(tmp_path / "x", ("a.npy", _npy(np.zeros(1))), ("a.npy", _npy(np.ones(1))))
    with pytest.raises(InputError, match=r"a\.npy once"):
        FORMAT.read(path)


@pytest.mark.parametrize("dtype", [object, "U3", "datetime64[s]", "complex64", [("a", "f4")]])
def test_only_numbers_are_taken(dtype: object, tmp_path: Path) -> None:
    path = _zip(tmp_path / "x", ("a.npy", _npy(np.zeros(2, dtype))))  # type: ignore[call-overload]
    with pytest.raises(InputError, match=r"a\.npy: expected an array of numbers"):
        FORMAT.read(path)


def test_other_formats_and_versions_are_refused(tmp_path: Path) -> None:
    other = ArchiveFormat(name="test", version=2, kind="test file", largest=99)
    other.write(tmp_path / "x", {}, {})
    with pytest.raises(InputError, match="version 1 of the format, found 2"):
        FORMAT.read(tmp_path / "x")


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is for POSIX")
def test_a_writer_that_is_killed_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "x"
    FORMAT.write(path, {"good": True}, {})
    program = (
        "import sys, numpy as np\n"
        "from pathlib import Path\n"
        "from albot_core.archive import ArchiveFormat\n"
        "noise = np.random.default_rng(0).random(10_000_000)\n"
        "form = ArchiveFormat(name='test', version=1, kind='', largest=1 << 30)\n"
        "form.write(Path(sys.argv[1]), {'good': False}, {'a': noise})\n"
    )
    with running([sys.executable, "-c", program, path], tmp_path) as process:
        wait_until(lambda: process.poll() is not None or len(list(tmp_path.iterdir())) > 1)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert FORMAT.read(path)[0] == {"good": True}


def test_what_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="1,048,576 bytes of arrays at most in a test file, found"):
        FORMAT.write(tmp_path / "x", {}, {"a": np.zeros((1 << 20) + 1, np.uint8)})
    assert not list(tmp_path.iterdir())
