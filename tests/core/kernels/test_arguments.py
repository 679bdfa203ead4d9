"""Kernel arguments: compiled code gets back what was packed, and sees what changes in it."""

from __future__ import annotations

import gc
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit, typeof

from albot_core.kernels.arguments import ArgumentsCache, KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel


class Pair(NamedTuple):
    numbers: np.ndarray
    factor: float


@njit
def added_up(arguments: KernelArguments) -> float:
    pair, flags, count = unpack(arguments)
    total = 0.0
    for k in range(count):
        if flags[k]:
            total += pair.factor * pair.numbers[k, 1]
    return total


def test_what_is_packed_comes_out_and_changes_are_seen() -> None:
    numbers = np.arange(6.0).reshape(3, 2)
    arguments = KernelArguments((Pair(numbers, 2.0), np.array([True, False, True]), 3))
    assert added_up(arguments) == 2.0 * (1 + 5)
    numbers[2, 1] = 7.0
    assert added_up(arguments) == 2.0 * (1 + 7)


def _read_only(numbers: np.ndarray) -> np.ndarray:
    numbers.flags.writeable = False
    return numbers


@pytest.mark.parametrize("again", range(2))  # The second time the type is known.
@pytest.mark.parametrize(
    "content",
    [
        np.zeros(3), np.zeros(3, np.float32), np.zeros((3, 2)), np.zeros((3, 2), order="F"),
        np.zeros((4, 4))[::2, ::2], np.zeros((1, 1)), np.zeros(()), _read_only(np.zeros(3)),
        np.zeros(3, np.bool_), 1, 1 << 63, -5, True, 1.0, np.float32(1), np.int8(1), np.bool_(1),
        Pair(np.zeros(1), 1.0), (np.zeros(1), 1.0), (1, 2), (1, 2.0), (), ((), ()),
    ],
)  # fmt: skip
def test_the_type_is_that_which_numba_finds(content: object, again: int) -> None:
    contents = content, np.zeros(2)
    assert KernelArguments(contents).kind.contents == typeof(contents)


def test_kernel_arguments_keep_their_arrays() -> None:
    arguments = KernelArguments((Pair(np.full((1000, 2), 3.0), 1.0), np.full(1000, True), 1000))
    gc.collect()
    others = [np.full((1000, 2), -1.0) for _ in range(20)]
    for _ in range(3):
        assert added_up(arguments) == 3000.0
    assert len(others) == 20


def test_a_cache_packs_anew_only_for_other_parts() -> None:
    packed = []

    def arrange(numbers: np.ndarray) -> tuple[Pair, np.ndarray, int]:
        packed.append(numbers)
        return Pair(numbers, 1.0), np.ones(1, np.bool_), 1

    cache = ArgumentsCache(arrange)
    first, second = np.full((1, 2), 1.0), np.full((1, 2), 2.0)
    assert cache.arguments(first) is cache.arguments(first)
    assert added_up(cache.arguments(first)) == 1.0
    assert added_up(cache.arguments(second)) == 2.0
    assert len(packed) == 2


@KernelDispatcher
@kernel(nogil=True)
def add_to(rows: np.ndarray, arguments: KernelArguments, more: float) -> float:
    """Add to some of the numbers; what they are together then."""
    pair = unpack(arguments)[0]
    total = 0.0
    for i in rows:
        pair.numbers[i] += more
        total += pair.numbers[i]
    return total


class Bare(NamedTuple):
    numbers: np.ndarray


def test_a_dispatcher_runs_what_arguments_of_each_type_need() -> None:
    """It is compiled for both, and looks again when the other comes."""
    rows = np.array([0, 2])
    pairs = [
        KernelArguments((Pair(np.zeros(3), 1.0),)),
        KernelArguments((Bare(np.zeros(3, np.float32)),)),
    ]
    for round_ in range(1, 4):
        for arguments in pairs:
            assert add_to(rows, arguments, 1.5) == 3.0 * round_
    assert add_to(rows, KernelArguments((Pair(np.ones(3), 1.0),)), 0.0) == 2.0


def test_a_dispatcher_looks_for_machine_code_only_where_the_type_changes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Looking for it takes longer than many a kernel."""
    find, found = add_to._find, []
    monkeypatch.setattr(add_to, "_find", lambda *given: (found.append(1), find(*given))[1])
    pair, bare = KernelArguments((Pair(np.zeros(3), 1.0),)), KernelArguments((Bare(np.zeros(3)),))
    looked = []
    for arguments in (pair, pair, bare, bare, pair):
        before = len(found)
        add_to(np.array([0]), arguments, 0.0)
        looked.append(len(found) > before)
    assert looked[1:] == [False, True, False, True]


def test_a_dispatcher_lets_threads_in_at_once() -> None:
    kinds = [KernelArguments((Pair(np.zeros(4), 1.0),)), KernelArguments((Bare(np.zeros(4)),))] * 4
    rows = np.arange(4)
    with ThreadPoolExecutor(8) as pool:
        totals = pool.map(
            lambda arguments: [add_to(rows, arguments, 0.0) for _ in range(500)], kinds
        )
    assert all(total == 0.0 for many in totals for total in many)
