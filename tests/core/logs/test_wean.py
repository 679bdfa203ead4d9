"""The map of Wean Hall: the faces of its walls, in metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.logs.wean import read_wean_map

HEADER = "robot_specifications->resolution 10\n\nglobal_map[0]: 4 5\n"
# A free row, a wall three cells thick, and what nobody knows.
ROWS = ["1 1 1 1 1", "0 0.1 0.2 0 0", "0 0 0 0 0", "-1 -1 -1 0.7 -1"]


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_only_the_face_that_free_cells_touch_is_there(tmp_path: Path) -> None:
    faces = read_wean_map(write(tmp_path / "map.dat", HEADER + "\n".join(ROWS)))
    assert np.allclose(faces, [[0.15, 0.05 + 0.1 * column] for column in range(5)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello", "lines robot_specifications->resolution"),
        (HEADER + "\n".join(ROWS[:3]), "4 rows of 5 cells"),
        (HEADER + "\n".join([*ROWS[:3], "1 x 1 1 1"]), "numbers, the same count in every row"),
        (HEADER + "\n".join([*ROWS[:3], "1 1"]), "numbers, the same count in every row"),
        (HEADER.replace("10", "0") + "\n".join(ROWS), "cells"),
    ],
)
def test_what_is_no_such_map_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path / "map.dat", text)
    with pytest.raises(InputError, match=message):
        read_wean_map(path)


def test_the_real_map_holds_corridors_two_to_three_metres_wide(data: Path) -> None:
    faces = read_wean_map(data / "logs" / "wean_map.dat.gz")
    assert 3000 < len(faces) < 8000
    # Across the long corridor, 20 m from its western end.
    across = np.sort(faces[np.abs(faces[:, 0] - 20.05) < 0.01, 1])
    assert across[0] < 41 < across[-1]
    assert 1.8 < np.diff(across).max() < 3.0
