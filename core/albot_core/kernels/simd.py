"""SIMD vectors in compiled code: eight or sixteen columns of a table at a time.

The compiler turns a loop into vector instructions only behind a check, at each entry of the loop,
that the memory that is written does not overlap the memory that is read. In short loops that check
costs more than the loop. So vector code is written with Python's operators on `FloatVector` (or
`UInt64Vector`), and a decorator turns it into a function that compiled code can call:

| decorator | columns of |
|---|---|
| `float64_predicate` | 8 float64 |
| `float32_predicate` | 16 float32, where less precision is enough |
| `mixed_predicate` | 8, of a float64 array and of a float32 array |
| `uint64_predicate` | 8 uint64, each looked up at its own position |
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import cycle
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from albot_core.kernels.compiled import kernel

LANES, LANES32 = 8, 16
"""Number of columns in a vector of float64 (or uint64), and of float32."""

Arrays = np.ndarray | tuple[np.ndarray, ...]
Predicate = Callable[[Arrays, int | tuple[int, ...], tuple[Any, ...]], int]
"""A function that compiled code calls: see `float64_predicate`."""

_WORD = ir.IntType(64)
_UINT64S = ir.VectorType(ir.IntType(64), LANES)
_BOOLS = ir.VectorType(ir.IntType(1), LANES)


class FloatVector:
    """Floats, or booleans (a mask), one per lane, known at run time; operators act on all lanes."""

    def __init__(self, builder: Any, value: Any) -> None:
        self._builder, self.value = builder, value

    def __add__(self, other: FloatVector | float) -> FloatVector:
        return self._vector(self._builder.fadd(self.value, self._like(other)))

    def __sub__(self, other: FloatVector | float) -> FloatVector:
        return self._vector(self._builder.fsub(self.value, self._like(other)))

    def __rsub__(self, other: float) -> FloatVector:
        return self._vector(self._builder.fsub(self._like(other), self.value))

    def __neg__(self) -> FloatVector:
        return self._vector(self._builder.fneg(self.value))

    def __truediv__(self, other: FloatVector) -> FloatVector:
        return self._vector(self._builder.fdiv(self.value, other.value))

    def __rtruediv__(self, other: float) -> FloatVector:
        return self._vector(self._builder.fdiv(self._like(other), self.value))

    def __mul__(self, other: FloatVector | float) -> FloatVector:
        return self._vector(self._builder.fmul(self.value, self._like(other)))

    def __lt__(self, other: FloatVector | float) -> FloatVector:
        return self._compare("<", other)

    def __le__(self, other: FloatVector | float) -> FloatVector:
        return self._compare("<=", other)

    def __gt__(self, other: FloatVector | float) -> FloatVector:
        return self._compare(">", other)

    def __ge__(self, other: FloatVector | float) -> FloatVector:
        return self._compare(">=", other)

    def __and__(self, other: FloatVector) -> FloatVector:
        return self._vector(self._builder.and_(self.value, other.value))

    def __or__(self, other: FloatVector) -> FloatVector:
        return self._vector(self._builder.or_(self.value, other.value))

    def _compare(self, how: str, other: FloatVector | float) -> FloatVector:
        """Compare lane by lane; NaN compares as false."""
        return self._vector(self._builder.fcmp_ordered(how, self.value, self._like(other)))

    def _like(self, other: FloatVector | float) -> Any:
        if isinstance(other, FloatVector):
            return other.value
        return ir.Constant(self.value.type, [float(other)] * self.value.type.count)

    def _vector(self, value: Any) -> FloatVector:
        return FloatVector(self._builder, value)

    def where(self, other: FloatVector | float, mask: FloatVector) -> FloatVector:
        """Return these numbers where the mask is true, the others elsewhere."""
        return self._vector(self._builder.select(mask.value, self.value, self._like(other)))

    def minimum(self, other: FloatVector | float) -> FloatVector:
        """Return the lesser of both in each lane; the other where one is NaN."""
        return self.where(other, self < other)

    def maximum(self, other: FloatVector | float) -> FloatVector:
        """Return the greater of both in each lane; the other where one is NaN."""
        return self.where(other, self > other)

    def abs(self) -> FloatVector:
        """Return the absolute values."""
        return self._vector(_call_llvm(self._builder, "llvm.fabs", self.value))

    def sqrt(self) -> FloatVector:
        """Return the square roots."""
        return self._vector(_call_llvm(self._builder, "llvm.sqrt", self.value))

    def to_float32(self) -> FloatVector:
        """Return the nearest float32 numbers."""
        kind = ir.VectorType(ir.FloatType(), self.value.type.count)
        return self._vector(self._builder.fptrunc(self.value, kind))

    def lane_numbers(self) -> FloatVector:
        """Return the numbers of the lanes, from 0."""
        kind = self.value.type
        return self._vector(ir.Constant(kind, [float(lane) for lane in range(kind.count)]))

    def compress(self, mask: FloatVector) -> FloatVector:
        """Return those where the mask is true, in order, in the first lanes.

        The remaining lanes are undefined.
        """
        undefined = self.value.type(ir.Undefined)
        name = "llvm.experimental.vector.compress"
        return self._vector(_call_llvm(self._builder, name, self.value, mask.value, undefined))

    def reduce_min(self) -> FloatVector:
        """Return the least of all lanes, in every lane."""
        least, count = self, self.value.type.count
        order = ir.VectorType(ir.IntType(32), count)
        apart = count // 2
        while apart:
            partners = ir.Constant(order, [lane ^ apart for lane in range(count)])
            value = self._builder.shuffle_vector(least.value, least.value, partners)
            least, apart = least.minimum(self._vector(value)), apart // 2
        return least


def _call_llvm(builder: Any, name: str, *values: Any) -> Any:
    """Return the result of one of LLVM's own functions (intrinsics) on vectors."""
    first = values[0].type
    kind = ir.FunctionType(first, [value.type for value in values])
    width = "f32" if first.element == ir.FloatType() else "f64"
    tools: Any = cgutils
    function = tools.get_or_insert_function(builder.module, kind, f"{name}.v{first.count}{width}")
    return builder.call(function, values)


class FloatTable:
    """Some columns of a table of floats: `table[row]` is the vector of that row."""

    def __init__(self, builder: Any, kind: Any, data: Any, length: Any, first: Any) -> None:
        self._builder, self._kind, self._data = builder, kind, data
        self._length, self._first = length, first

    def __getitem__(self, row: int) -> FloatVector:
        return FloatVector(self._builder, self._builder.load(self._pointer(row), align=4))

    def __setitem__(self, row: int, vector: FloatVector) -> None:
        self._builder.store(vector.value, self._pointer(row), align=4)

    def _pointer(self, row: int) -> Any:
        builder = self._builder
        offset = builder.add(builder.mul(self._length, self._length.type(row)), self._first)
        place = builder.gep(self._data, [offset], inbounds=True)
        return builder.bitcast(place, self._kind.as_pointer())


class UInt64Vector:
    """Whole numbers from 0 to 2^64 - 1, or booleans (a mask); arithmetic is modulo 2^64."""

    def __init__(self, builder: Any, value: Any) -> None:
        self._builder, self.value = builder, value

    def __add__(self, other: UInt64Vector) -> UInt64Vector:
        return UInt64Vector(self._builder, self._builder.add(self.value, other.value))

    def __mul__(self, other: UInt64Vector) -> UInt64Vector:
        return UInt64Vector(self._builder, self._builder.mul(self.value, other.value))

    def __and__(self, other: UInt64Vector | int) -> UInt64Vector:
        return UInt64Vector(self._builder, self._builder.and_(self.value, _uint64s(other)))

    def __or__(self, other: UInt64Vector) -> UInt64Vector:
        return UInt64Vector(self._builder, self._builder.or_(self.value, other.value))

    def __rshift__(self, other: UInt64Vector | int) -> UInt64Vector:
        """Shift right by less than 64 bits."""
        return UInt64Vector(self._builder, self._builder.lshr(self.value, _uint64s(other)))

    def __lt__(self, other: UInt64Vector) -> UInt64Vector:
        return UInt64Vector(
            self._builder, self._builder.icmp_unsigned("<", self.value, other.value)
        )

    def stepped(self, step: UInt64Vector) -> UInt64Vector:
        """Return these numbers plus 0, 1, 2, … steps, from the first lane on."""
        lanes = ir.Constant(_UINT64S, list(range(LANES)))
        return self + UInt64Vector(self._builder, self._builder.mul(step.value, lanes))

    def is_odd(self) -> UInt64Vector:
        """Return a mask: whether each is odd."""
        return UInt64Vector(self._builder, self._builder.trunc(self.value, _BOOLS))


class UInt64Table:
    """A table of uint64, with its rows one after another in memory."""

    def __init__(self, builder: Any, kind: Any, data: Any, length: Any, first: Any) -> None:
        self._builder, self._begin = builder, builder.gep(data, [first], inbounds=True)

    def at(self, places: UInt64Vector, mask: UInt64Vector) -> UInt64Vector:
        """Return the numbers at places from the first column on; 0 where the mask is false."""
        builder = self._builder
        chosen = builder.select(mask.value, places.value, _uint64s(0))
        numbers = _UINT64S(ir.Undefined)
        for lane in map(ir.IntType(32), range(LANES)):
            place = builder.extract_element(chosen, lane)
            number = builder.load(builder.gep(self._begin, [place], inbounds=True))
            numbers = builder.insert_element(numbers, number, lane)
        return UInt64Vector(builder, builder.select(mask.value, numbers, _uint64s(0)))


def _uint64s(other: UInt64Vector | int) -> Any:
    return (
        other.value if isinstance(other, UInt64Vector) else ir.Constant(_UINT64S, [other] * LANES)
    )


Masks = FloatVector | tuple[FloatVector, ...]
"""What a predicate returns: one mask, or several."""


def float64_predicate(function: Callable[..., Masks]) -> Predicate:
    """Make a function that compiled code calls to test eight columns of float64 at once.

    Args:
        function: The test: `function(table, *numbers)`, where each number is the same in all
            lanes. It may also write rows of the table, and return several masks.

    Returns:
        A function for compiled code with three arguments. First: a contiguous array of float64
        (rows, a multiple of LANES), or a tuple of such arrays. Second: the first of the columns, or
        a tuple of first columns, for each of which `function` is given a table. Third: the numbers,
        a tuple of float64. It returns an int64 with a bit for each column; the lowest bit is the
        first column's. The bits of a second mask follow, and so on.
    """
    return _make_predicate(function, (types.float64,), LANES)


def float32_predicate(function: Callable[..., Masks]) -> Predicate:
    """Do the same as `float64_predicate` for sixteen columns of float32, with float32 numbers."""
    return _make_predicate(function, (types.float32,), LANES32)


def mixed_predicate(function: Callable[..., Masks]) -> Predicate:
    """Do the same as `float64_predicate` for two arrays; the second array is float32."""
    return _make_predicate(function, (types.float64, types.float32), LANES)


def uint64_predicate(function: Callable[..., UInt64Vector]) -> Predicate:
    """Do the same as `float64_predicate` for eight columns of uint64, with uint64 numbers."""
    return _make_predicate(function, (types.uint64,), LANES, UInt64Vector, UInt64Table)


def _make_predicate(
    function: Callable[..., Any],
    elements: tuple[Any, ...],
    count: int,
    vector: Any = FloatVector,
    table: Any = FloatTable,
) -> Predicate:
    """Make a predicate of any kind.

    Args:
        function: The test.
        elements: The arrays' dtypes as numba types; the first is also the numbers' dtype.
        count: Number of columns that are tested at once.
        vector: Class of the vectors that `function` gets for the numbers.
        table: Class of the tables that `function` gets for the arrays.
    """

    def _test(typing: Any, array: Any, first: Any, given: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            arrays, firsts, numbers = map(partial(_parts, builder), values, signature.args)
            tables = []
            for (value, of), (begin, its) in zip(cycle(arrays), firsts, strict=False):
                rows = context.make_array(of)(context, builder, value)
                kind = ir.VectorType(context.get_data_type(of.dtype), count)
                length = builder.extract_value(rows.shape, 1)
                column = context.cast(builder, begin, its, types.int64)
                tables.append(table(builder, kind, rows.data, length, column))
            kind = ir.VectorType(context.get_data_type(elements[0]), count)
            same = [vector(builder, _broadcast(builder, kind, number)) for number, _ in numbers]
            masks = function(*tables, *same)
            bits = _WORD(0)
            for k, mask in enumerate(masks if isinstance(masks, tuple) else (masks,)):
                own = builder.zext(builder.bitcast(mask.value, ir.IntType(count)), _WORD)
                bits = builder.or_(bits, builder.shl(own, _WORD(k * count)))
            return bits

        arrays: Any = array if isinstance(array, types.BaseTuple) else (array,)
        fit = all(of.layout == "C" for of in arrays)
        fit &= tuple(of.dtype for of in arrays) == elements
        if not fit or any(number != elements[0] for number in given):
            return None  # numba then reports that no function takes these arguments.
        return types.int64(array, first, given), generate

    _test.__name__ = function.__name__
    return cast(Predicate, intrinsic(_test))


def _parts(builder: Any, value: Any, kind: Any) -> list[tuple[Any, Any]]:
    """Return the parts of a tuple with their types; of any other value, itself."""
    if not isinstance(kind, types.BaseTuple):
        return [(value, kind)]
    elements: Any = kind
    return [(builder.extract_value(value, place), part) for place, part in enumerate(elements)]


def _broadcast(builder: Any, kind: Any, number: Any) -> Any:
    """Return a vector of this kind with a number in all lanes."""
    undefined, place = kind(ir.Undefined), ir.IntType(32)
    one = builder.insert_element(undefined, number, place(0))
    zeros = ir.Constant(ir.VectorType(place, kind.count), [0] * kind.count)
    return builder.shuffle_vector(one, undefined, zeros)


@kernel()
def padded_length(count: int) -> int:
    """Return the row length of a table: the least multiple of LANES not below `count`."""
    return (count + LANES - 1) // LANES * LANES


@kernel()
def first_bits(count: int) -> int:
    """Return a mask with the bits of the first `count` columns set, at most LANES of them."""
    return (1 << min(count, LANES)) - 1
