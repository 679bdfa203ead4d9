"""Vectors in compiled code: columns of a table, eight or sixteen of them at a time.

The compiler makes vector instructions of a loop only where it has made sure, each time the loop
is entered, that what is written does not overlap what is read, which costs more than such
short loops. So a function of vectors is written with Python's operators on `Lanes`, and
`question` makes of it what compiled code can call, `question32` where less exact will do.
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
"""Columns that are looked at together, of float64 and of float32."""

Arrays = np.ndarray | tuple[np.ndarray, ...]
Question = Callable[[Arrays, int | tuple[int, ...], tuple[Any, ...]], int]
"""What compiled code calls: see `question`."""

_WORD = ir.IntType(64)


class Lanes:
    """Numbers or truths, one for each column, known when the code runs; operators act on all."""

    def __init__(self, builder: Any, value: Any) -> None:
        self._builder, self.value = builder, value

    def __add__(self, other: Lanes | float) -> Lanes:
        return self._lanes(self._builder.fadd(self.value, self._like(other)))

    def __sub__(self, other: Lanes | float) -> Lanes:
        return self._lanes(self._builder.fsub(self.value, self._like(other)))

    def __rsub__(self, other: float) -> Lanes:
        return self._lanes(self._builder.fsub(self._like(other), self.value))

    def __neg__(self) -> Lanes:
        return self._lanes(self._builder.fneg(self.value))

    def __truediv__(self, other: Lanes) -> Lanes:
        return self._lanes(self._builder.fdiv(self.value, other.value))

    def __rtruediv__(self, other: float) -> Lanes:
        return self._lanes(self._builder.fdiv(self._like(other), self.value))

    def __mul__(self, other: Lanes | float) -> Lanes:
        return self._lanes(self._builder.fmul(self.value, self._like(other)))

    def __lt__(self, other: Lanes | float) -> Lanes:
        return self._compared("<", other)

    def __le__(self, other: Lanes | float) -> Lanes:
        return self._compared("<=", other)

    def __gt__(self, other: Lanes | float) -> Lanes:
        return self._compared(">", other)

    def __ge__(self, other: Lanes | float) -> Lanes:
        return self._compared(">=", other)

    def __and__(self, other: Lanes) -> Lanes:
        return self._lanes(self._builder.and_(self.value, other.value))

    def __or__(self, other: Lanes) -> Lanes:
        return self._lanes(self._builder.or_(self.value, other.value))

    def _compared(self, how: str, other: Lanes | float) -> Lanes:
        """NaN compares as false."""
        return self._lanes(self._builder.fcmp_ordered(how, self.value, self._like(other)))

    def _like(self, other: Lanes | float) -> Any:
        if isinstance(other, Lanes):
            return other.value
        return ir.Constant(self.value.type, [float(other)] * self.value.type.count)

    def _lanes(self, value: Any) -> Lanes:
        return Lanes(self._builder, value)

    def where(self, other: Lanes | float, truths: Lanes) -> Lanes:
        """These numbers where something is true, others elsewhere."""
        return self._lanes(self._builder.select(truths.value, self.value, self._like(other)))

    def coarse(self) -> Lanes:
        """The nearest numbers of float32."""
        kind = ir.VectorType(ir.FloatType(), self.value.type.count)
        return self._lanes(self._builder.fptrunc(self.value, kind))

    def together(self, truths: Lanes) -> Lanes:
        """Those where something is true, in their order, in the first lanes; any in the rest."""
        anything = self.value.type(ir.Undefined)
        name = "llvm.experimental.vector.compress"
        return self._lanes(_built_in(self._builder, name, self.value, truths.value, anything))

    def places(self) -> Lanes:
        """The numbers of the lanes, from 0."""
        kind = self.value.type
        return self._lanes(ir.Constant(kind, [float(lane) for lane in range(kind.count)]))

    def minimum(self) -> Lanes:
        """The least of them all, in every lane."""
        least, count = self, self.value.type.count
        order = ir.VectorType(ir.IntType(32), count)
        apart = count // 2
        while apart:
            partners = ir.Constant(order, [lane ^ apart for lane in range(count)])
            value = self._builder.shuffle_vector(least.value, least.value, partners)
            least, apart = least.least(self._lanes(value)), apart // 2
        return least

    def size(self) -> Lanes:
        """Without their signs."""
        return self._lanes(_built_in(self._builder, "llvm.fabs", self.value))

    def root(self) -> Lanes:
        """Their square roots."""
        return self._lanes(_built_in(self._builder, "llvm.sqrt", self.value))

    def least(self, other: Lanes | float) -> Lanes:
        """The lesser of both in each lane."""
        return self.where(other, self < other)

    def most(self, other: Lanes | float) -> Lanes:
        """The greater of both in each lane."""
        return self.where(other, self > other)


def _built_in(builder: Any, name: str, *values: Any) -> Any:
    """What one of the compiler's own functions makes of vectors."""
    first = values[0].type
    kind = ir.FunctionType(first, [value.type for value in values])
    width = "f32" if first.element == ir.FloatType() else "f64"
    tools: Any = cgutils
    named = f"{name}.v{first.count}{width}"
    called = tools.get_or_insert_function(builder.module, kind, named)
    return builder.call(called, values)


Answer = Lanes | tuple[Lanes, ...]
"""Truths that answer a question, or several."""


class Table:
    """Some columns of a table whose rows are numbers: `table[row]` are their lanes."""

    def __init__(self, builder: Any, kind: Any, data: Any, length: Any, first: Any) -> None:
        self._builder, self._kind, self._data = builder, kind, data
        self._length, self._first = length, first

    def __getitem__(self, row: int) -> Lanes:
        return Lanes(self._builder, self._builder.load(self._place(row), align=4))

    def __setitem__(self, row: int, lanes: Lanes) -> None:
        self._builder.store(lanes.value, self._place(row), align=4)

    def _place(self, row: int) -> Any:
        builder = self._builder
        offset = builder.add(builder.mul(self._length, self._length.type(row)), self._first)
        place = builder.gep(self._data, [offset], inbounds=True)
        return builder.bitcast(place, self._kind.as_pointer())


def question(ask: Callable[..., Answer]) -> Question:
    """What compiled code calls to ask something of eight columns at once.

    Args:
        ask: Answers it: `ask(table, *numbers)`, the numbers being the same in all lanes. It
            may write rows of the table, too, and give several answers.

    Returns:
        A function for compiled code of an array (rows, whole lanes), contiguous float64; of the
        first of the columns, or a tuple of them, for each of which `ask` is given a table; and of
        a tuple of float64, the numbers. Its answer is an int64 with a bit for each column, the
        first's the lowest; those of a second answer follow, and so on.
    """
    return make_question(ask, (types.float64,), LANES)


def question32(ask: Callable[..., Answer]) -> Question:
    """`question` of sixteen columns of float32, by numbers that are float32, too."""
    return make_question(ask, (types.float32,), LANES32)


def coarse_question(ask: Callable[..., Answer]) -> Question:
    """`question` of two arrays and the firsts of both; the second's numbers are float32."""
    return make_question(ask, (types.float64, types.float32), LANES)


def make_question(
    ask: Callable[..., Any],
    elements: tuple[Any, ...],
    count: int,
    lanes: Any = Lanes,
    table: Any = Table,
) -> Question:
    """`question` of columns of another kind.

    Args:
        ask: Answers it.
        elements: What the arrays hold, as numba names it; the first holds what the numbers are.
        count: How many columns it is asked of.
        lanes: What `ask` is given for numbers.
        table: What it is given for tables.
    """

    def _asked(typing: Any, array: Any, first: Any, given: Any) -> Any:
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
            same = [lanes(builder, everywhere(builder, kind, number)) for number, _ in numbers]
            answer = ask(*tables, *same)
            bits = _WORD(0)
            for k, truths in enumerate(answer if isinstance(answer, tuple) else (answer,)):
                own = builder.zext(builder.bitcast(truths.value, ir.IntType(count)), _WORD)
                bits = builder.or_(bits, builder.shl(own, _WORD(k * count)))
            return bits

        arrays: Any = array if isinstance(array, types.BaseTuple) else (array,)
        fit = all(of.layout == "C" for of in arrays)
        fit &= tuple(of.dtype for of in arrays) == elements
        if not fit or any(number != elements[0] for number in given):
            return None  # Numba then says that there is no such function for these arguments.
        return types.int64(array, first, given), generate

    _asked.__name__ = ask.__name__
    return cast(Question, intrinsic(_asked))


def _parts(builder: Any, value: Any, kind: Any) -> list[tuple[Any, Any]]:
    """The parts of a tuple with their types; of anything else itself."""
    if not isinstance(kind, types.BaseTuple):
        return [(value, kind)]
    elements: Any = kind
    return [(builder.extract_value(value, place), part) for place, part in enumerate(elements)]


def everywhere(builder: Any, kind: Any, number: Any) -> Any:
    """A vector of this kind with a number in all lanes, as the compiler knows them."""
    nothing, place = kind(ir.Undefined), ir.IntType(32)
    one = builder.insert_element(nothing, number, place(0))
    nowhere = ir.Constant(ir.VectorType(place, kind.count), [0] * kind.count)
    return builder.shuffle_vector(one, nothing, nowhere)


@kernel()
def whole_lanes(count: int) -> int:
    """The length of rows that hold so many columns, for questions."""
    return (count + LANES - 1) // LANES * LANES


@kernel()
def first_of(count: int) -> int:
    """Ones in the bits of the first `count` columns, up to LANES of them."""
    return (1 << min(count, LANES)) - 1
