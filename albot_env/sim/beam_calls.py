"""A wall's inverse ranges along a block of beams, in vector instructions.

The compiler makes vectors of such loops only after it has made sure, each time they are
entered, that the arrays do not overlap, which costs more than the loop.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

BLOCK = 16
"""Beams in a block."""

_LANE = ir.IntType(32)
_LANES = ir.VectorType(ir.FloatType(), BLOCK)
_BITS = ir.VectorType(_LANE, BLOCK)


def _raise_block(
    typing: Any,
    nearest: Any,
    cosines: Any,
    sines: Any,
    block: Any,
    ax: Any,
    ay: Any,
    bx: Any,
    by: Any,
    p: Any,
    q: Any,
) -> Any:
    """Raise a block's inverse ranges `nearest` to those of a wall, where beams meet it.

    `nearest`, `cosines` and `sines` are contiguous float32 (blocks, BLOCK), all others but
    the block's number float32: see `ray_kernels`.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        places = [
            _place(context, builder, kind, value, values[3])
            for kind, value in zip(signature.args[:3], values[:3], strict=True)
        ]
        before, u, v = (builder.load(place, align=4) for place in places)
        ax, ay, bx, by, p, q = (_everywhere(builder, value) for value in values[4:])
        inverse = builder.fadd(builder.fmul(p, u), builder.fmul(q, v))
        from_a = builder.fsub(builder.fmul(ax, v), builder.fmul(ay, u))
        from_b = builder.fsub(builder.fmul(bx, v), builder.fmul(by, u))
        zero = ir.Constant(_LANES, [0.0] * BLOCK)
        met = builder.select(builder.fcmp_ordered(">=", from_a, zero), inverse, zero)
        met = builder.select(builder.fcmp_ordered("<=", from_b, zero), met, zero)
        # Numbers that are not negative are in the order of their bits.
        bits, others = builder.bitcast(met, _BITS), builder.bitcast(before, _BITS)
        greater = builder.select(builder.icmp_signed(">", bits, others), bits, others)
        builder.store(builder.bitcast(greater, _LANES), places[0], align=4)
        return context.get_dummy_value()

    return types.void(nearest, cosines, sines, block, ax, ay, bx, by, p, q), generate


def _place(context: Any, builder: Any, kind: Any, array: Any, block: Any) -> Any:
    """Where a block begins in an array."""
    data = context.make_array(kind)(context, builder, array).data
    begin = builder.gep(data, [builder.mul(block, block.type(BLOCK))], inbounds=True)
    return builder.bitcast(begin, _LANES.as_pointer())


def _everywhere(builder: Any, number: Any) -> Any:
    """A number in all lanes."""
    one = builder.insert_element(_LANES(ir.Undefined), number, _LANE(0))
    nowhere = ir.Constant(_BITS, [0] * BLOCK)
    return builder.shuffle_vector(one, _LANES(ir.Undefined), nowhere)


raise_block: Any = intrinsic(_raise_block)
