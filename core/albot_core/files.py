"""Read compressed files, and write files atomically."""

from __future__ import annotations

import codecs
import gzip
import io
import lzma
import os
import re
import shutil
import stat
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from albot_core.errors import InputError, MissingFileError
from albot_core.interrupts import interrupts_deferred

_PACKED = {b"\x1f\x8b": ".gz", b"\xfd7zXZ\x00": ".xz"}
"""First bytes and name suffix of compressed files."""
_PIECE = 4096
"""Number of unpacked bytes read at a time."""
LARGEST = 128 << 20
"""Default limit of a file's unpacked size (bytes); no robot's log is larger. A file of a few
kilobytes can unpack to more than fits in memory."""


def _open_plain(path: Path) -> io.BufferedIOBase:
    return path.open("rb")


def _open_gzip(path: Path) -> io.BufferedIOBase:
    return gzip.GzipFile(path, "rb")


def _open_xz(path: Path) -> io.BufferedIOBase:
    return lzma.LZMAFile(path, "rb")


_OPENERS: dict[str, Callable[[Path], io.BufferedIOBase]] = {".gz": _open_gzip, ".xz": _open_xz}


def exists(path: Path) -> bool:
    """Return whether a file or folder exists; false for a name that the system does not allow."""
    try:
        return path.exists()
    except OSError:
        return False


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Read a file; unpack it if its name ends in `.gz` or `.xz`.

    Args:
        path: The file.
        largest: Largest size of the file, packed and unpacked (bytes).

    Raises:
        InputError: The file is missing, unreadable or too large, or the compressed data is
            damaged.
    """
    content, damage = read_beginning(path, largest)
    if damage is not None:
        raise damage
    return content


def read_beginning(path: Path, largest: int = LARGEST) -> tuple[bytes, InputError | None]:
    """Read a file like `read_bytes`; return the content up to a damage, and the error or None.

    Raises:
        InputError: The file is missing, unreadable or too large.
    """
    pieces: list[bytes] = []
    damage = None
    try:
        for piece in _pieces(path, largest):  # Pieces before the damage are kept.
            pieces.append(piece)  # noqa: PERF402
    except InputError:
        raise
    except FileNotFoundError:
        raise MissingFileError(path) from None
    except IsADirectoryError:
        raise InputError(path, "a file", "a folder") from None
    except (EOFError, lzma.LZMAError, gzip.BadGzipFile, zlib.error) as error:
        damage = InputError(path, f"intact {path.suffix[1:]} data", str(error))
    except OSError as error:
        raise InputError(path, "a readable file", error.strerror or str(error)) from None
    except ValueError as error:  # A name with a zero byte, which no system allows.
        raise InputError(path, "a file that exists", str(error)) from None
    for start, suffix in _PACKED.items():
        if path.suffix not in _OPENERS and pieces and pieces[0].startswith(start):
            packed = suffix.removeprefix(".")
            expected = f"a name that ends in {suffix}, because the content is {packed} data"
            raise InputError(path, expected)
    return b"".join(pieces), damage


def _pieces(path: Path, largest: int) -> Iterator[bytes]:
    """Yield the unpacked content of a file in pieces."""
    expected = f"{largest:,} bytes at most"
    if (size := path.stat().st_size) > largest:
        raise InputError(path, expected, f"{size:,}")
    size = 0
    with _OPENERS.get(path.suffix, _open_plain)(path) as stream:
        while piece := stream.read(_PIECE):
            size += len(piece)
            if size > largest:
                raise InputError(path, expected, "more, decompressed")
            yield piece


_WIDE = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
"""First bytes of text in other encodings; UTF-32's begin as UTF-16's do."""
_MARK = "\ufeff"
_TEMPORARY = re.compile(r"\.(.+)\.[a-z0-9_]{8}", re.DOTALL)
"""Name of a temporary file of `atomic_write`, and the one of the file that it is to replace."""


def read_text(path: Path, largest: int = LARGEST, errors: str = "strict") -> str:
    """Read a text file, as `read_bytes` and `decode_text`. All readers of text use it.

    Raises:
        InputError: As `read_bytes` and `decode_text`.
    """
    return decode_text(read_bytes(path, largest), path, errors)


def decode_text(content: bytes, source: object, errors: str = "strict") -> str:
    """Return UTF-8 text without byte order marks, each line ended by a line feed alone.

    Editors on Windows put a byte order mark at the beginning; where files were joined, at the
    beginning of other lines, too.

    Args:
        content: The text's bytes.
        source: Where it is from, for errors.
        errors: "strict", or "replace" to read bytes that are not UTF-8 as U+FFFD.

    Raises:
        InputError: The text is marked as UTF-16 or UTF-32, or (strict) is not UTF-8.
    """
    expected = "UTF-8 text"
    for mark, encoding in _WIDE.items():
        if content.startswith(mark):
            raise InputError(source, expected, f"{encoding} text; convert it to UTF-8")
    try:
        text = content.decode("utf-8", errors)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        found = f"the byte {content[error.start]:#04x}"
        raise InputError(source, expected, found, place=f"line {line}") from None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.removeprefix(_MARK).replace(f"\n{_MARK}", "\n")


def is_stream(path: Path) -> bool:
    """Return whether `path` is a pipe or a device rather than a file.

    Raises:
        InputError: `path` cannot be written: it is a folder, a disk or a socket, or its folder
            does not exist.
    """
    expected = "a file to write"
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        parent = Path(os.path.realpath(path)).parent
        if not parent.is_dir():
            raise InputError(path, f"an existing folder {parent}", "none") from None
        return False
    except OSError as error:
        raise InputError(path, expected, error.strerror or str(error)) from None
    if stat.S_ISDIR(mode):
        raise InputError(path, expected, "a folder")
    if stat.S_ISBLK(mode) or stat.S_ISSOCK(mode):
        raise InputError(path, expected, "a disk" if stat.S_ISBLK(mode) else "a socket")
    return not stat.S_ISREG(mode)


@contextmanager
def atomic_write(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file beside `path` that replaces it when the block ends without an error.

    A reader sees the old file or the complete new one, never a part. If `path` is a symbolic link,
    the file that it points to is replaced. A pipe or a device gets all bytes at the end. When the
    block raises or is interrupted, the temporary file is removed.

    Raises:
        InputError: The file cannot be written; see `is_stream`.
        OSError: The disk is full; the error names `path`.
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
                error.filename = str(path)  # Not the temporary file.
        raise


def is_left_over(path: Path, suffixes: tuple[str, ...]) -> bool:
    """Return whether a name is that of a temporary file of `atomic_write` for a name so ending."""
    found = _TEMPORARY.fullmatch(path.name)
    return found is not None and found[1].endswith(suffixes)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a temporary folder that is removed after the block, even if it is interrupted."""
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
    """Make a folder, and those above it, where they do not exist.

    Raises:
        InputError: The folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        found = "a file" if folder.exists() else error.strerror or str(error)
        raise InputError(folder, "a folder to write to", found) from None


@contextmanager
def new_folder(folder: Path) -> Iterator[None]:
    """Make a folder as `make_folder` does; if the block raises, remove what was made.

    All in a new folder is removed with it; the new folders above it only if nothing else is in
    them.

    Raises:
        InputError: As `make_folder`.
    """
    made = _made(folder)
    try:
        yield
    except BaseException:
        _remove_made(folder, made)
        raise


def _made(folder: Path) -> list[Path]:
    """Make a folder and those above it; return those that are new, the folder first."""
    with interrupts_deferred():
        new = [each for each in (folder, *folder.parents) if not exists(each)]
        for each in reversed(new[1:]):
            make_folder(each)
        try:
            folder.mkdir()
        except OSError:  # It is there, or another process has just made it, whose it is then.
            make_folder(folder)
            return []
    return new


def _remove_made(folder: Path, made: list[Path]) -> None:
    """Remove a folder with all in it, if it was made, and the new ones above it if empty."""
    if made:
        with interrupts_deferred(), suppress(OSError):
            shutil.rmtree(folder, ignore_errors=True)
            for each in made[1:]:
                each.rmdir()


@contextmanager
def own_folder(folder: Path) -> Iterator[Callable[[], None]]:
    """Make a folder if need be, and let no other process write into it during the block.

    If the block raises, a folder that is new is removed with all in it, unless it is kept. Where
    folders cannot be locked (Windows, NFS), another process may write into it all the same.

    Yields:
        Call it once what the folder holds is worth keeping, whatever comes.

    Raises:
        InputError: The folder cannot be made, or another process writes into it.
    """
    made, kept = _made(folder), False

    def keep() -> None:
        nonlocal kept
        kept = True

    with sole_writer(folder, folder):  # Who is refused removes nothing.
        if not folder.is_dir():
            raise InputError(folder, "a folder to write to", "one that was just removed")
        try:
            yield keep
        except BaseException:
            if not kept:
                _remove_made(folder, made)
            raise


@contextmanager
def sole_writer(file: Path, folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Let no other process enter such a block with the same file during the block.

    Windows and some file systems have no such locks; there it does nothing.

    Args:
        file: A file of the folder, which is there and is never replaced; or the folder itself.
        folder: The folder that the process writes into, for the error.
        patience: Longest time to wait for another process to leave the block (s).

    Raises:
        InputError: Another process is in the block, or the file is missing.
    """
    if file.is_dir() and (sys.platform == "win32" or not os.access(file, os.R_OK)):
        yield  # A folder is locked as one that is read, which is not possible here.
        return
    try:
        # NFS locks only what may be written, which a folder is not.
        opened = os.open(file, os.O_RDONLY if file.is_dir() else os.O_RDWR)
    except FileNotFoundError:
        raise MissingFileError(file) from None
    try:
        until = time.monotonic() + patience
        while not _lock(opened):
            if time.monotonic() >= until:
                expected = "a folder that no other process writes into"
                raise InputError(folder, expected, "one that does")
            time.sleep(0.1)
        yield
    finally:
        os.close(opened)


def _lock(opened: int) -> bool:
    """Lock a file until it is closed, at the latest with the process; return whether it is ours."""
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # The file system has no locks.
            return True
    return True


@contextmanager
def _refused_as_input(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(path, "a file to write", error.strerror or str(error)) from None


def _permissions(target: Path) -> int:
    """Return the permissions of the existing file, or those of a new file."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask


def write_all(stream: io.FileIO, content: bytes) -> None:
    """Write all content to an unbuffered file.

    On a nearly full disk, `write` first writes a part, then raises.

    Raises:
        OSError: The disk is full; a part may have been written.
    """
    while content:
        content = content[stream.write(content) :]


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text to `path`, atomically; raises as `atomic_write`."""
    with atomic_write(path) as stream:
        stream.write(text.encode())
