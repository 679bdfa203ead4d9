"""SIMD on flat tables of bytes, for correlative scan matching: sums and maxima of rows of bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

BYTES_SUMMED, BYTES_RAISED = 16, 8
"""Number of neighbouring bytes that `sum_bytes` and `raise_bytes` process at once."""


def _sum_bytes(typing: Any, table: Any, places: Any, count: Any, shift: Any, sums: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        tools, kinds = cast(Any, cgutils), signature.args
        data = {
            k: context.make_array(kinds[k])(context, builder, values[k]).data for k in (0, 1, 4)
        }
        length, offset = (context.cast(builder, values[k], kinds[k], types.int64) for k in (2, 3))
        wide = ir.VectorType(ir.IntType(32), BYTES_SUMMED)
        narrow = ir.VectorType(ir.IntType(8), BYTES_SUMMED).as_pointer()
        total = tools.alloca_once_value(builder, ir.Constant(wide, [0] * BYTES_SUMMED))
        with tools.for_range(builder, length) as loop:
            place = builder.load(builder.gep(data[1], [loop.index], inbounds=True))
            at = builder.add(builder.sext(place, ir.IntType(64)), offset)
            row = builder.bitcast(builder.gep(data[0], [at], inbounds=True), narrow)
            more = builder.zext(builder.load(row, align=1), wide)
            builder.store(builder.add(builder.load(total), more), total)
        builder.store(builder.load(total), builder.bitcast(data[4], wide.as_pointer()), align=4)
        return context.get_dummy_value()

    is_fit = (table.dtype, places.dtype, sums.dtype) == (types.uint8, types.int32, types.int32)
    return (types.none(table, places, count, shift, sums), generate) if is_fit else None


sum_bytes = cast(
    Callable[[np.ndarray, np.ndarray, int, int, np.ndarray], None], intrinsic(_sum_bytes)
)
"""Add up bytes of a flat uint8 table: `sum_bytes(table, places, count, shift, sums)`.

`sums[j]` (int32) becomes the sum of `table[place + shift + j]` over the first `count` elements of
`places` (int32), for each j below `BYTES_SUMMED`. All of these bytes must be in the table."""


def _raise_bytes(typing: Any, table: Any, place: Any, least: Any, begin: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kinds = signature.args
        kind = ir.VectorType(ir.IntType(8), BYTES_RAISED)
        rows = []
        for k in (0, 2):
            data = context.make_array(kinds[k])(context, builder, values[k]).data
            at = context.cast(builder, values[k + 1], kinds[k + 1], types.int64)
            rows.append(builder.bitcast(builder.gep(data, [at], inbounds=True), kind.as_pointer()))
        held, wanted = (builder.load(row, align=1) for row in rows)
        is_less = builder.icmp_unsigned("<", held, wanted)
        builder.store(builder.select(is_less, wanted, held), rows[0], align=1)
        return context.get_dummy_value()

    is_fit = table.dtype == least.dtype == types.uint8
    return (types.none(table, place, least, begin), generate) if is_fit else None


raise_bytes = cast(Callable[[np.ndarray, int, np.ndarray, int], None], intrinsic(_raise_bytes))
"""Raise bytes to at least those of another table: `raise_bytes(table, place, least, begin)`.

Both tables are flat uint8. `table[place + j]` becomes the larger of itself and `least[begin + j]`,
for each j below `BYTES_RAISED`."""
