"""Which of many surfaces reach into a cone, told in vector instructions.

The compiler makes vectors of such loops only after it has made sure, each time they are
entered, that the arrays do not overlap, which costs more than the loop.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

LANES = 8
"""Surfaces that are looked at together."""

_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)
_WORD = ir.IntType(64)


@njit(cache=True)
def whole_lanes(count: int) -> int:
    """The length of rows that hold so many surfaces, for `lanes_within`."""
    return (count + LANES - 1) // LANES * LANES


def _lanes_within(
    typing: Any,
    ends: Any,
    first: Any,
    ax: Any,
    ay: Any,
    a: Any,
    bx: Any,
    by: Any,
    b: Any,
    cx: Any,
    cy: Any,
    c: Any,
) -> Any:
    """Which of LANES surfaces have, of each of three half-planes, an end within it; a bit each.

    Rows x1, y1, x2, y2 of `ends`, contiguous float64 (rows, whole lanes), from column `first`
    on; all others but `first` are float64. A point is within half-plane a where ax x + ay y <= a.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, values[0])
        length = builder.extract_value(array.shape, 1)
        rows = []
        for row in range(4):
            offset = builder.add(builder.mul(length, length.type(row)), values[1])
            place = builder.gep(array.data, [offset], inbounds=True)
            rows.append(builder.load(builder.bitcast(place, _NUMBERS.as_pointer()), align=8))
        within = None
        for plane in range(3):
            x, y, limit = (_everywhere(builder, n) for n in values[2 + 3 * plane : 5 + 3 * plane])
            one, other = (
                builder.fadd(builder.fmul(x, rows[end]), builder.fmul(y, rows[end + 1]))
                for end in (0, 2)
            )
            least = builder.select(builder.fcmp_ordered("<", one, other), one, other)
            met = builder.fcmp_ordered("<=", least, limit)
            within = met if within is None else builder.and_(within, met)
        return builder.zext(builder.bitcast(within, ir.IntType(LANES)), _WORD)

    if ends.layout != "C" or ends.dtype != types.float64:
        return None  # Numba then says that there is no such function for these arguments.
    return types.int64(ends, first, ax, ay, a, bx, by, b, cx, cy, c), generate


def _lowest_lane(typing: Any, bits: Any) -> Any:
    """The number of the lowest bit that is set."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(bits), generate


def _everywhere(builder: Any, number: Any) -> Any:
    """A number in all lanes."""
    one = builder.insert_element(_NUMBERS(ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    nowhere = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, _NUMBERS(ir.Undefined), nowhere)


lanes_within: Any = intrinsic(_lanes_within)
lowest_lane: Any = intrinsic(_lowest_lane)
