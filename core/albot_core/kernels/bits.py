"""Bits, for compiled code: of sets of small numbers, and of float32 numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _lowest(typing: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate


def _ones(typing: Any, bits: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.ctpop(values[0])

    return types.int64(types.int64), generate


def _bits_of(typing: Any, number: Any) -> Any:
    return types.int32(types.float32), _taken_for


def _number_of(typing: Any, bits: Any) -> Any:
    return types.float32(types.int32), _taken_for


def _taken_for(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.bitcast(values[0], context.get_value_type(signature.return_type))


lowest = cast(Callable[[int], int], intrinsic(_lowest))
"""The number of the lowest bit that is set, from 0; one must be."""
ones = cast(Callable[[int], int], intrinsic(_ones))
"""How many bits are set."""
bits_of = cast(Callable[[np.float32], np.int32], intrinsic(_bits_of))
"""The 32 bits of a number."""
number_of = cast(Callable[[np.int32], np.float32], intrinsic(_number_of))
"""The number with these 32 bits."""
