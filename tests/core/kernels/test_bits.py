"""Bits in compiled code against Python's and numpy's own."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from albot_core.kernels.bits import float32_bits, float32_from_bits, lowest_bit, popcount
from albot_core.kernels.compiled import kernel


@kernel()
def _counted(bits: int) -> tuple[int, int]:
    return lowest_bit(bits), popcount(bits)


@kernel()
def _bits(number: np.float32) -> np.int32:
    return float32_bits(number)


@kernel()
def _number(bits: np.int32) -> np.float32:
    return float32_from_bits(bits)


@given(st.integers(1, 2**63 - 1))
def test_the_lowest_bit_and_how_many_there_are(bits: int) -> None:
    assert _counted(bits) == ((bits & -bits).bit_length() - 1, bits.bit_count())


@given(st.floats(width=32, allow_nan=False))
def test_a_number_is_taken_for_its_bits_and_back(number: float) -> None:
    bits = int(np.float32(number).view(np.int32))
    assert _bits(np.float32(number)) == bits
    assert _number(np.int32(bits)) == number
