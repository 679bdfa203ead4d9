"""Arrays of compiled code that nobody counts the holders of; how long its calls may be."""

from __future__ import annotations

import ast
import subprocess
import sys

import numpy as np
import pytest
from numba import types
from numba.core.errors import TypingError

from albot_core.kernels.compiled import (
    array_at,
    kernel,
    load_element,
    scratch,
)
from tests.conftest import ROOT
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


def test_a_kernel_that_makes_arrays_must_say_so() -> None:
    with pytest.raises(TypingError, match="Only accept returning of array"):
        _allocate(3)


def test_a_signal_is_raised_where_the_call_returned() -> None:
    words = [sys.executable, "-m", interrupted.__name__]
    done = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True)
    assert done.stdout == f"{interrupted.ROUNDS}\n"


def test_no_kernel_takes_more_than_twelve_arguments() -> None:
    """What always goes together is one NamedTuple."""
    kernels = {}
    for name in ("core", "maps", "albot_env", "agents"):
        for path in (ROOT / name).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef):
                    decorators = map(ast.unparse, node.decorator_list)
                    if any(text.startswith("kernel(") for text in decorators):
                        kernels[f"{path.relative_to(ROOT)}, {node.name}"] = len(node.args.args)
    assert len(kernels) > 300
    assert not {name: count for name, count in kernels.items() if count > 12}
