"""The episodes of a training, one a line, as stable-baselines3's `load_results` reads them."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.files import write_text

FIGURES = ("is_success", "spl", "coverage", "distance_home")
"""What an episode's last info tells that is written down as well, where the task knows it."""
_COLUMNS = ("r", "l", "t", *FIGURES)
POINTS = 30
"""Points of a learning curve that is drawn of the training's own episodes."""
Row = Sequence[float | int | None]
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
        if not size:
            write_text(path, header)
            size = len(header.encode())
        self.size = size
        """Bytes of all episodes written so far."""
        self._write(b"")

    def add(self, rows: Sequence[Row]) -> None:
        """Write episodes down.

        Raises:
            InputError: There is no room left.
        """
        if rows:
            lines = "".join(f"{','.join(map(_cell, row))}\n" for row in rows).encode()
            self._write(lines)
            self.size += len(lines)

    @property
    def curve(self) -> dict[str, list[float]]:
        """The mean return of the episodes so far, in `POINTS` parts, and samples at their ends."""
        table = self._path.read_text().splitlines()[2:]
        if not table:
            return {}
        returns, steps = np.array([line.split(",")[:2] for line in table], float).T
        parts = np.array_split(np.arange(len(table)), min(POINTS, len(table)))
        return {
            "samples": [float(steps[: part[-1] + 1].sum()) for part in parts],
            "return": [float(returns[part].mean()) for part in parts],
        }

    def _write(self, lines: bytes) -> None:
        """Let lines follow what counts, and nothing else; all of them or none."""
        try:
            with self._path.open("r+b", buffering=0) as stream:
                if stream.seek(0, 2) < self.size:
                    found = str(stream.tell())
                    raise InputError(self._path, f"{self.size} bytes or more", found)
                stream.truncate(self.size)
                stream.seek(self.size)
                try:
                    _write_all(stream, lines)
                except OSError:
                    stream.truncate(self.size)
                    raise
        except OSError as error:
            raise InputError(self._path, "room to write", error.strerror or str(error)) from None


def _write_all(stream: io.FileIO, content: bytes) -> None:
    """Write everything: a disk that is nearly full takes a part first, and then says so."""
    while content:
        content = content[stream.write(content) :]


def _cell(value: float | int | None) -> str:
    return "" if value is None else f"{value:.7g}"
