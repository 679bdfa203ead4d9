"""Calls of C functions by their address, for compiled code. An address is an int64 here.

They pass pointers and numbers alone, which every platform does alike; structures by value,
as most of Chipmunk's functions take them, each platform passes in its own way.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _visit(typing: Any, function: Any, first: Any, second: Any, third: Any) -> Any:
    """Call the function at an address with three pointers."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word, word])
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, types.int64), generate


def _take_step(typing: Any, function: Any, space: Any, duration: Any) -> Any:
    """Call the function at an address with a pointer and a number."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(64), ir.DoubleType()])
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.float64), generate


def _load(typing: Any, address: Any) -> Any:
    """The 64 bits at an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(builder.inttoptr(values[0], ir.IntType(64).as_pointer()))

    return types.int64(types.int64), generate


visit: Any = intrinsic(_visit)
take_step: Any = intrinsic(_take_step)
load: Any = intrinsic(_load)
