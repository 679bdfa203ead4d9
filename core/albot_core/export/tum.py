"""Trajectories in the TUM format, one pose per line: `stamp x y z qx qy qz qw`.

Units are seconds and metres; the heading is a quaternion about z. Lines that begin with `#` are
comments. https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from albot_core.errors import InputError
from albot_core.evaluation.moments import time_order
from albot_core.evaluation.trajectory import Trajectory
from albot_core.files import write_text
from albot_core.logs.text import LogText

FIELDS = "stamp x y z qx qy qz qw"
"""The fields of a line."""
_EXPECTED = f"eight finite numbers, {FIELDS}"


def write_tum(trajectory: Trajectory, path: Path) -> None:
    """Write a trajectory, atomically.

    Stamps and positions read back exactly, headings up to rounding.
    """
    lines = [f"# {FIELDS}"]
    for stamp, (x, y, heading) in zip(trajectory.stamps, trajectory.poses, strict=True):
        numbers = (stamp, x, y, 0.0, 0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2))
        lines.append(" ".join(_shortest(number) for number in numbers))
    write_text(path, "\n".join(lines) + "\n")


def read_tum(text: LogText) -> Trajectory:
    """Read a trajectory; only the rotation about z is used.

    Lines may be in any order; they are sorted by stamp, unless the way denies it (`time_order`).

    Raises:
        InputError: A line is not eight finite numbers, its quaternion does not have length 1,
            or there is no line.
    """
    rows = []
    for number, line in enumerate(text.lines, start=1):
        text.number = number
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) != 8:
            raise text.error(_EXPECTED, f"{len(words)} fields")
        stamp, x, y, _, qx, qy, qz, qw = text.numbers(words, "a field")
        if not np.isclose(np.hypot(np.hypot(qx, qy), np.hypot(qz, qw)), 1.0, atol=0.01):
            raise text.error("a quaternion of length 1", " ".join(words[4:]))
        turn = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        rows.append((stamp, x, y, turn))
    if not rows:
        raise InputError(text.source, f"at least one line, {FIELDS}", "none")
    table = np.array(rows)
    table = table[time_order(table[:, 0], table[:, 1:], lines_have_order=False)]
    return Trajectory(stamps=table[:, 0], poses=table[:, 1:])


def _shortest(number: float) -> str:
    """Return a number as text with the fewest digits that read back exactly; -0 becomes 0."""
    text = repr(float(number) + 0.0)
    return text.removesuffix(".0")
