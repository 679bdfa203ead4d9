"""Bit operations for compiled code: on int64 used as sets of bits, and on float32 numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _lowest_bit(typing: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate


def _popcount(typing: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.ctpop(values[0])

    return types.int64(types.int64), generate


def _float32_bits(typing: Any, number: Any) -> Any:
    return types.int32(types.float32), _bitcast


def _float32_from_bits(typing: Any, bits: Any) -> Any:
    return types.float32(types.int32), _bitcast


def _bitcast(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.bitcast(values[0], context.get_value_type(signature.return_type))


lowest_bit = cast(Callable[[int], int], intrinsic(_lowest_bit))
"""The index of the lowest set bit, from 0; at least one must be set."""
popcount = cast(Callable[[int], int], intrinsic(_popcount))
"""The number of set bits."""
float32_bits = cast(Callable[[np.float32], np.int32], intrinsic(_float32_bits))
"""The 32 bits of a float32, as int32."""
float32_from_bits = cast(Callable[[np.int32], np.float32], intrinsic(_float32_from_bits))
"""The float32 with these 32 bits."""
