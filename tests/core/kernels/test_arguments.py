"""Parcels: compiled code gets back what was packed, and sees what changes in it."""

from __future__ import annotations

import gc
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numba import njit

from albot_core.kernels.arguments import Entry, Packer, Parcel, opened
from albot_core.kernels.compiled import kernel


class Pair(NamedTuple):
    numbers: np.ndarray
    factor: float


@njit
def added_up(parcel: Parcel) -> float:
    pair, flags, count = opened(parcel)
    total = 0.0
    for k in range(count):
        if flags[k]:
            total += pair.factor * pair.numbers[k, 1]
    return total


def test_what_is_packed_comes_out_and_changes_are_seen() -> None:
    numbers = np.arange(6.0).reshape(3, 2)
    parcel = Parcel((Pair(numbers, 2.0), np.array([True, False, True]), 3))
    assert added_up(parcel) == 2.0 * (1 + 5)
    numbers[2, 1] = 7.0
    assert added_up(parcel) == 2.0 * (1 + 7)


def test_a_parcel_keeps_its_arrays() -> None:
    parcel = Parcel((Pair(np.full((1000, 2), 3.0), 1.0), np.full(1000, True), 1000))
    gc.collect()
    others = [np.full((1000, 2), -1.0) for _ in range(20)]
    for _ in range(3):
        assert added_up(parcel) == 3000.0
    assert len(others) == 20


def test_a_packer_packs_anew_only_for_other_parts() -> None:
    packed = []

    def arrange(numbers: np.ndarray) -> tuple[Pair, np.ndarray, int]:
        packed.append(numbers)
        return Pair(numbers, 1.0), np.ones(1, np.bool_), 1

    packer = Packer(arrange)
    first, second = np.full((1, 2), 1.0), np.full((1, 2), 2.0)
    assert packer.parcel(first) is packer.parcel(first)
    assert added_up(packer.parcel(first)) == 1.0
    assert added_up(packer.parcel(second)) == 2.0
    assert len(packed) == 2


@Entry
@kernel(nogil=True)
def add_to(rows: np.ndarray, parcel: Parcel, more: float) -> float:
    """Add to some of the numbers; what they are together then."""
    pair = opened(parcel)[0]
    total = 0.0
    for i in rows:
        pair.numbers[i] += more
        total += pair.numbers[i]
    return total


class Bare(NamedTuple):
    numbers: np.ndarray


def test_an_entry_runs_what_parcels_of_each_type_need() -> None:
    """It is compiled for both, and looks again when another comes."""
    rows = np.array([0, 2])
    pairs = [Parcel((Pair(np.zeros(3), 1.0),)), Parcel((Bare(np.zeros(3, np.float32)),))]
    for round_ in range(1, 4):
        for parcel in pairs:
            assert add_to(rows, parcel, 1.5) == 3.0 * round_
    assert add_to(rows, Parcel((Pair(np.ones(3), 1.0),)), 0.0) == 2.0


def test_an_entry_lets_threads_in_at_once() -> None:
    kinds = [Parcel((Pair(np.zeros(4), 1.0),)), Parcel((Bare(np.zeros(4)),))] * 4
    rows = np.arange(4)
    with ThreadPoolExecutor(8) as pool:
        totals = pool.map(lambda parcel: [add_to(rows, parcel, 0.0) for _ in range(500)], kinds)
    assert all(total == 0.0 for many in totals for total in many)
