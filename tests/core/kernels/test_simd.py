"""Vectors in compiled code against the same arithmetic in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba.core.errors import TypingError

from albot_core.kernels.compiled import kernel
from albot_core.kernels.simd import (
    LANES,
    LANES32,
    FloatTable,
    FloatVector,
    UInt64Table,
    UInt64Vector,
    first_bits,
    float32_predicate,
    float64_predicate,
    mixed_predicate,
    padded_length,
    uint64_predicate,
)

NUMBERS = st.floats(-1e6, 1e6) | st.just(np.nan)
TABLES = arrays(np.float64, (4, 2 * LANES), elements=NUMBERS)


@float64_predicate
def _compared(table: FloatTable, limit: FloatVector) -> FloatVector:
    a, b = table[0], table[1]
    return (a < b) & (a <= limit) | (b > a * 2.0) & (b >= limit)


@float64_predicate
def _reckoned(table: FloatTable, x: FloatVector, y: FloatVector) -> FloatVector:
    a, b = table[0], table[1]
    table[2] = (a * x + b - y).abs().sqrt() / (b.abs() + 1.0)
    table[3] = a.minimum(b) - a.maximum(b).where(x, a > 0.0)
    return a > b


@kernel()
def _ask(table: np.ndarray, first: int, limit: float) -> int:
    return _compared(table, first, (limit,))


@kernel()
def _work(table: np.ndarray, first: int, x: float, y: float) -> int:
    return _reckoned(table, first, (x, y))


def _bits(truths: np.ndarray) -> int:
    return int(sum(1 << k for k in np.flatnonzero(truths).tolist()))


@given(TABLES, st.integers(0, LANES), st.floats(-1e3, 1e3))
def test_questions_are_answered_lane_by_lane(table: np.ndarray, first: int, limit: float) -> None:
    a, b = table[:2, first : first + LANES]
    expected = (a < b) & (a <= limit) | (b > a * 2.0) & (b >= limit)
    assert _ask(table, first, limit) == _bits(expected)


@given(TABLES, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_what_is_reckoned_is_to_the_bit_what_numpy_reckons(
    table: np.ndarray, x: float, y: float
) -> None:
    before = table.copy()
    a, b = before[:2, LANES:]
    bits = _work(table, LANES, x, y)
    assert bits == _bits(a > b)
    np.testing.assert_array_equal(
        table[2, LANES:], np.sqrt(np.abs(a * x + b - y)) / (np.abs(b) + 1.0)
    )
    # Of a NaN and a number the second is neither less nor greater: it is taken.
    least, most = np.where(a < b, a, b), np.where(a > b, a, b)
    np.testing.assert_array_equal(table[3, LANES:], least - np.where(a > 0.0, most, x))
    np.testing.assert_array_equal(table[:, :LANES], before[:, :LANES])


@float32_predicate
def _raised(table: FloatTable, slope: FloatVector, offset: FloatVector) -> FloatVector:
    table[1] = (table[0] * slope + offset).maximum(table[1])
    return table[0] >= 0.0


@kernel()
def _raise(table: np.ndarray, slope: np.float32, offset: np.float32) -> int:
    return _raised(table, LANES32, (slope, offset))


@given(arrays(np.float32, (2, 2 * LANES32), elements=st.floats(-100, 100, width=32)))
def test_sixteen_columns_of_less_exact_numbers_are_asked_alike(table: np.ndarray) -> None:
    before, slope, offset = table.copy(), np.float32(1.7), np.float32(-0.3)
    assert _raise(table, slope, offset) == _bits(before[0, LANES32:] >= 0.0)
    line = before[0, LANES32:] * slope + offset
    np.testing.assert_array_equal(table[1, LANES32:], np.maximum(line, before[1, LANES32:]))
    np.testing.assert_array_equal(table[:, :LANES32], before[:, :LANES32])


def test_rows_are_long_enough_and_bits_those_of_the_first_columns() -> None:
    assert [padded_length(count) for count in (0, 1, 8, 9)] == [0, 8, 8, 16]
    assert [first_bits(count) for count in (1, 7, 8, 20)] == [1, 127, 255, 255]


@float64_predicate
def _packed(table: FloatTable, packed: FloatTable, limit: FloatVector) -> FloatVector:
    numbers = table[0]
    packed[1] = numbers.compress(numbers > limit)
    packed[2] = numbers.reduce_min()
    return numbers > limit


@kernel()
def _pack(table: np.ndarray, first: int, to: int, limit: float) -> int:
    return _packed(table, (first, to), (limit,))


@given(
    arrays(np.float64, (3, 3 * LANES), elements=st.floats(-10, 10)),
    st.integers(0, 2 * LANES),
    st.integers(0, 2 * LANES),
)
def test_lanes_are_put_together_elsewhere_in_their_order(
    table: np.ndarray, first: int, to: int
) -> None:
    before = table.copy()
    numbers = before[0, first : first + LANES]
    chosen = numbers[numbers > 0.0]
    assert _pack(table, first, to, 0.0) == _bits(numbers > 0.0)
    np.testing.assert_array_equal(table[1, to : to + len(chosen)], chosen)
    assert (table[2, to : to + LANES] == numbers.min()).all()
    elsewhere = np.ones(3 * LANES, np.bool_)
    elsewhere[to : to + LANES] = False
    np.testing.assert_array_equal(table[1:, elsewhere], before[1:, elsewhere])


def test_other_tables_are_refused() -> None:
    with pytest.raises(TypingError):
        _ask(np.zeros((4, 8), np.float32), 0, 1.0)
    with pytest.raises(TypingError):
        _ask(np.zeros((8, 4)).T, 0, 1.0)


@mixed_predicate
def _rounded(table: FloatTable, coarse: FloatTable, limit: FloatVector) -> FloatVector:
    coarse[1] = (table[0] + table[1]).to_float32()
    return table[0] > limit


@kernel()
def _round(table: np.ndarray, coarse: np.ndarray, first: int, to: int) -> int:
    return _rounded((table, coarse), (first, to), (0.0,))


@given(
    arrays(np.float64, (2, 2 * LANES), elements=st.floats(-1e6, 1e6)),
    st.integers(0, LANES),
    st.integers(0, LANES),
)
def test_a_second_table_is_of_less_exact_numbers(table: np.ndarray, first: int, to: int) -> None:
    coarse = np.zeros((2, 2 * LANES), np.float32)
    part = table[:, first : first + LANES]
    assert _round(table, coarse, first, to) == _bits(part[0] > 0.0)
    np.testing.assert_array_equal(coarse[1, to : to + LANES], part.sum(axis=0).astype(np.float32))
    assert np.count_nonzero(coarse) == np.count_nonzero(coarse[1, to : to + LANES])


@uint64_predicate
def _looked_up(
    table: UInt64Table, first: UInt64Vector, step: UInt64Vector, end: UInt64Vector
) -> UInt64Vector:
    places = first.stepped(step)
    return (table.at(places >> 3, places >> 3 < end) >> (places & 7 | (places & 8) + step)).is_odd()


@kernel()
def _look_up(table: np.ndarray, column: int, first: int, step: int, end: int) -> int:
    return _looked_up(table, column, (np.uint64(first), np.uint64(step), np.uint64(end)))


@given(
    arrays(np.uint64, (1, 24), elements=st.integers(0, 2**64 - 1)),
    st.integers(0, 4),
    st.integers(-100, 200),
    st.integers(0, 24),
    st.integers(0, 20),
)
def test_words_are_looked_up_where_they_are_in_bounds(
    table: np.ndarray, column: int, first: int, step: int, end: int
) -> None:
    expected = []
    for lane in range(LANES):
        place = (first + lane * step) % 2**64
        word = int(table[0, column + (place >> 3)]) if place >> 3 < end else 0
        expected.append(word >> ((place & 7) | ((place & 8) + step)) & 1)
    assert _look_up(table, column, first, step, end) == _bits(np.array(expected))
