"""Arrays of compiled code that nobody counts the holders of."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import types
from numba.core.errors import TypingError

from albot_core.kernels.compiled import (
    array_at,
    digest,
    kernel,
    kernel_stamp,
    load_element,
    scratch,
)
from tests.core import interrupted

_grid, _few = scratch(2, 3), scratch(4, kind=types.int8)
_table, _truths = array_at(3), array_at(kind=types.boolean)


@kernel()
def _fill(rounds: int, sums: np.ndarray) -> None:
    for k in range(rounds):
        grid, few = _grid(), _few()
        for row in range(grid.shape[0]):
            for column in range(grid.shape[1]):
                grid[row, column] = 10.0 * row + column + k
        for place in range(few.shape[0]):
            few[place] = place - 2
        sums[0] += grid.sum()
        sums[1] += few.sum()


@kernel()
def _inner(rounds: int) -> float:
    mine = _grid()
    mine[0, 0] = rounds
    return _inner(rounds - 1) + mine[0, 0] if rounds > 0 else 0.0


@kernel()
def _double(address: int, rows: int, truths: int) -> int:
    table, flags = _table(address, rows), _truths(truths, rows)
    count = 0
    for row in range(table.shape[0]):
        for column in range(table.shape[1]):
            table[row, column] *= 2.0
        count += flags[row]
    return count


@kernel()
def _pick(numbers: np.ndarray, places: np.ndarray, picked: np.ndarray) -> None:
    for k in range(places.shape[0]):
        picked[k] = load_element(numbers, places[k])


@kernel()
def _allocate(count: int) -> int:
    return np.zeros(count).shape[0]


def test_scratch_numbers_have_their_shape_and_kind() -> None:
    sums = np.zeros(2)
    _fill(3, sums)
    assert sums.tolist() == [3 * (0 + 1 + 2 + 10 + 11 + 12) + 6 * (0 + 1 + 2), 3 * (-2 - 1 + 0 + 1)]


def test_each_call_has_scratch_numbers_of_its_own() -> None:
    assert _inner(5) == 1 + 2 + 3 + 4 + 5


def test_an_array_is_found_at_its_address() -> None:
    table, flags = np.arange(12.0).reshape(4, 3), np.array([True, False, True, True])
    doubled = 2 * table
    assert _double(table.ctypes.data, 4, flags.ctypes.data) == 3
    np.testing.assert_array_equal(table, doubled)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64, np.uint8])
def test_elements_are_those_at_their_places(kind: type) -> None:
    rng = np.random.default_rng(0)
    numbers, places = rng.integers(0, 200, 50).astype(kind), rng.integers(0, 50, 999)
    picked = np.empty(999, kind)
    _pick(numbers, places, picked)
    np.testing.assert_array_equal(picked, numbers[places])


def test_compiled_code_is_kept_until_any_kernel_changes(tmp_path: Path) -> None:
    stamped: Any = _fill
    assert kernel_stamp() in stamped._cache._cache_file._version
    package = tmp_path / "package"
    (package / "parts").mkdir(parents=True)
    caller, called, constant, plain = (
        package / name for name in ("caller.py", "parts/called.py", "constant.py", "plain.py")
    )
    marked = "from albot_core.kernels.compiled import kernel\n"
    caller.write_text(marked + "from package.constant import ONE\n", encoding="utf-8")
    called.write_text(marked, encoding="utf-8")
    for path in (constant, plain):
        path.write_text("ONE = 1\n", encoding="utf-8")
    digests = [digest([package])]
    plain.write_text("ONE = 2\n", encoding="utf-8")
    assert digest([package]) == digests[0]
    constant.write_text("ONE = 2\n", encoding="utf-8")  # Compiled into its user's code.
    digests.append(digest([package]))
    called.write_text(marked + "TWO = 2\n", encoding="utf-8")
    digests.append(digest([package]))
    called.unlink()
    digests.append(digest([package]))
    assert len(set(digests)) == len(digests)


def test_what_was_kept_for_other_kernels_is_not_opened(tmp_path: Path) -> None:
    """It may name types that are gone since, with which it could not be read at all."""
    (tmp_path / "adding.py").write_text(
        "from albot_core.kernels import compiled\n"
        "compiled.kernel_stamp = lambda: __import__('sys').argv[1]\n"
        "@compiled.kernel()\n"
        "def double(thing):\n"
        "    return 2.0 * thing.x\n",
        encoding="utf-8",
    )

    def doubled(stamp: str, kind: str) -> str:
        thing = f"from typing import NamedTuple\nclass {kind}(NamedTuple):\n    x: float\n"
        (tmp_path / "things.py").write_text(thing, encoding="utf-8")
        code = f"import adding, things; print(adding.double(things.{kind}(1.5)))"
        command = [sys.executable, "-c", code, stamp]
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
        environment["PYTHONPATH"] = os.pathsep.join((str(tmp_path), *sys.path))
        # Python would take the bytecode of a file that was as long, and written in the same second.
        environment["PYTHONDONTWRITEBYTECODE"] = "1"
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        return run.stdout.strip() or run.stderr

    assert doubled("first", "Old") == "3.0"
    assert list((tmp_path / "kept").rglob("*.nbi"))
    assert doubled("second", "New") == "3.0"


def test_a_kernel_that_makes_arrays_must_say_so() -> None:
    with pytest.raises(TypingError, match="Only accept returning of array"):
        _allocate(3)


def test_a_signal_is_raised_where_the_call_returned() -> None:
    words = [sys.executable, "-m", interrupted.__name__]
    root = Path(__file__).parents[3]
    told = subprocess.run(words, cwd=root, check=True, capture_output=True, text=True)
    assert told.stdout == f"{interrupted.ROUNDS}\n"
