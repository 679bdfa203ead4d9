"""The episodes of a training, one a line, as stable-baselines3's `load_results` reads them."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path

from albot_core.errors import InputError

FIGURES = ("is_success", "spl", "coverage", "distance_home")
"""What an episode's last info tells that is written down as well, where the task knows it."""
_COLUMNS = ("r", "l", "t", *FIGURES)
Row = Sequence[float | None]
"""Return, steps, seconds since the training began, and the figures; None for unknown."""


class MonitorFile:
    """Takes episodes down. Whole lines are written at once, and none is ever left half-written.

    Args:
        path: The file, which is made where there is none.
        task: Id of the environment.
        size: Bytes of the file that count; what follows (of samples that no checkpoint holds)
            is cut off. 0 for a new file.

    Raises:
        InputError: The file cannot be written, or is shorter.
    """

    def __init__(self, path: Path, task: str, size: int = 0) -> None:
        self._path = path
        header = f"#{json.dumps({'t_start': time.time(), 'env_id': task})}\n{','.join(_COLUMNS)}\n"
        try:
            if not size:
                path.write_text(header, encoding="utf-8")
                size = len(header.encode())
            self._stream = path.open("r+b", buffering=0)
            if self._stream.seek(0, 2) < size:
                raise InputError(path, f"{size} bytes or more", str(self._stream.tell()))
            self._stream.truncate(size)
            self._stream.seek(size)
        except OSError as error:
            raise InputError(path, "a file to write", error.strerror or str(error)) from None
        self.size = size
        """Bytes of all episodes written so far."""

    def add(self, rows: Sequence[Row]) -> None:
        """Write episodes down.

        Raises:
            InputError: There is no room left.
        """
        if not rows:
            return
        lines = "".join(f"{','.join(map(_cell, row))}\n" for row in rows).encode()
        try:
            written = self._stream.write(lines)
            if written != len(lines):
                written += self._stream.write(lines[written:])
        except OSError as error:
            self._stream.truncate(self.size)
            raise InputError(self._path, "room to write", error.strerror or str(error)) from None
        self.size += written

    def close(self) -> None:
        """Close the file."""
        self._stream.close()


def _cell(value: float | None) -> str:
    if value is None:
        return ""
    return f"{float(value):.6g}" if not isinstance(value, int) else str(int(value))
