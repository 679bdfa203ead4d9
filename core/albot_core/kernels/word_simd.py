"""Whole numbers of 64 bits in compiled code, eight at a time: see `lanes`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types

from albot_core.kernels.simd import LANES, Question, make_question

_KIND = ir.VectorType(ir.IntType(64), LANES)
_TRUTHS = ir.VectorType(ir.IntType(1), LANES)


class Words:
    """Numbers from 0 to 2^64 - 1, or truths, in lanes; what goes beyond begins anew at 0."""

    def __init__(self, builder: Any, value: Any) -> None:
        self._builder, self.value = builder, value

    def __add__(self, other: Words) -> Words:
        return Words(self._builder, self._builder.add(self.value, other.value))

    def __mul__(self, other: Words) -> Words:
        return Words(self._builder, self._builder.mul(self.value, other.value))

    def __and__(self, other: Words | int) -> Words:
        return Words(self._builder, self._builder.and_(self.value, _like(other)))

    def __or__(self, other: Words) -> Words:
        return Words(self._builder, self._builder.or_(self.value, other.value))

    def __rshift__(self, other: Words | int) -> Words:
        """By less than 64."""
        return Words(self._builder, self._builder.lshr(self.value, _like(other)))

    def __lt__(self, other: Words) -> Words:
        return Words(self._builder, self._builder.icmp_unsigned("<", self.value, other.value))

    def onwards(self, step: Words) -> Words:
        """These numbers, from the first lane on one, two and more steps farther."""
        lanes = ir.Constant(_KIND, list(range(LANES)))
        return self + Words(self._builder, self._builder.mul(step.value, lanes))

    def odd(self) -> Words:
        """Whether each is."""
        return Words(self._builder, self._builder.trunc(self.value, _TRUTHS))


class WordTable:
    """A table of such numbers, whose rows stand one after another."""

    def __init__(self, builder: Any, kind: Any, data: Any, length: Any, first: Any) -> None:
        self._builder, self._begin = builder, builder.gep(data, [first], inbounds=True)

    def at(self, places: Words, truths: Words) -> Words:
        """The numbers at some places from the first column on; 0 where something is not true."""
        builder = self._builder
        chosen = builder.select(truths.value, places.value, _like(0))
        numbers = _KIND(ir.Undefined)
        for lane in map(ir.IntType(32), range(LANES)):
            place = builder.extract_element(chosen, lane)
            number = builder.load(builder.gep(self._begin, [place], inbounds=True))
            numbers = builder.insert_element(numbers, number, lane)
        return Words(builder, builder.select(truths.value, numbers, _like(0)))


def _like(other: Words | int) -> Any:
    return other.value if isinstance(other, Words) else ir.Constant(_KIND, [other] * LANES)


def question64(ask: Callable[..., Words]) -> Question:
    """`question` of eight columns of uint64, by numbers that are uint64, too."""
    return make_question(ask, (types.uint64,), LANES, Words, WordTable)
