"""Parcels: many arrays that compiled code takes in one piece.

To unpack the arguments of a compiled call costs most of a microsecond for each array, far
more than many a call's work. A parcel is unpacked once; then its address is all there is to
take.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, update_wrapper
from operator import is_not
from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.registry import cpu_target
from numba.extending import (
    NativeValue,
    intrinsic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

from albot_core.kernels.compiled import kernel

_LINE = 64
"""Contents begin at a multiple of so many bytes."""


class Parcel:
    """Arrays and numbers, in tuples, that compiled code gets back by `opened`.

    What stands in the arrays may change; which arrays they are may not.

    Args:
        contents: A tuple of them.
    """

    def __init__(self, contents: tuple[Any, ...]) -> None:
        kind = typeof(contents)  # type: ignore[no-untyped-call]
        self._kept = contents
        self._room = np.empty(_size_of(kind) + _LINE, np.uint8)
        self.kind = ParcelType(kind)
        """What compiled code takes it for."""
        self.address = -(-self._room.ctypes.data // _LINE) * _LINE
        """Where the contents are, as compiled code holds them."""
        _pack(contents, self.address)

    def __reduce__(self) -> tuple[type[Parcel], tuple[Any, ...]]:
        """A copy holds the copied contents, at an address of its own."""
        return Parcel, (self._kept,)


class Packer:
    """Has a parcel at hand, packed anew only when it is asked for with other parts.

    Args:
        arrange: Makes the contents of the parts.
    """

    def __init__(self, arrange: Callable[..., tuple[Any, ...]]) -> None:
        self._arrange = arrange
        self._packed: tuple[tuple[Any, ...], Parcel] | None = None

    def parcel(self, *parts: Any) -> Parcel:
        """The parcel with these parts, which are known by which objects they are."""
        packed = self._packed
        if packed is None or any(map(is_not, parts, packed[0])):
            # In one assignment, for threads that ask at the same time.
            self._packed = packed = parts, Parcel(self._arrange(*parts))
        return packed[1]


class Entry:
    """A way into compiled code that takes a parcel, for Python: a decorator over `kernel`.

    numba asks what all arguments are each time, and to find out of a parcel takes longer than many
    a call's work. Here it asks only when the parcel's contents are of another type than the time
    before; so all other arguments must be of the same types each time, arrays contiguous.

    Args:
        compiled: The compiled code; compiled code itself must call this.
    """

    def __init__(self, compiled: Callable[..., Any]) -> None:
        self.compiled: Any = compiled
        """The compiled code."""
        self._known: tuple[ParcelType | None, Callable[..., Any]] = None, compiled
        update_wrapper(self, compiled)

    def __call__(self, rows: np.ndarray, parcel: Parcel, *others: Any) -> Any:
        """Run it for some rows."""
        kind, run = self._known
        if kind is not parcel.kind:
            run = self._find(rows, parcel, *others)
        return run(rows, parcel, *others)

    def _find(self, *arguments: Any) -> Callable[..., Any]:
        """What runs with such arguments, compiled if need be."""
        signature = tuple(map(typeof, arguments))
        self.compiled.compile(signature)
        found: Callable[..., Any] = self.compiled.overloads[signature].entry_point
        self._known = arguments[1].kind, found  # In one assignment, for threads.
        return found


class ParcelType(types.Type):
    """The compiler's type of parcels with contents of one type."""

    def __init__(self, contents: Any) -> None:
        self.contents = contents
        super().__init__(name=f"Parcel({contents})")


@cache
def _size_of(kind: Any) -> int:
    """Bytes that contents of a type take."""
    context = cpu_target.target_context
    size: int = context.get_abi_sizeof(context.get_value_type(kind))
    return size


@typeof_impl.register(Parcel)
def _kind_of(parcel: Parcel, _: Any) -> ParcelType:
    return parcel.kind


@register_model(ParcelType)
class _ParcelModel(models.PrimitiveModel):
    """Compiled code holds a parcel as its address."""

    def __init__(self, manager: Any, kind: ParcelType) -> None:
        super().__init__(manager, kind, ir.IntType(64))  # type: ignore[no-untyped-call]


@unbox(ParcelType)  # type: ignore[no-untyped-call, untyped-decorator]
def _take(_: ParcelType, parcel: Any, context: Any) -> NativeValue:
    address = context.pyapi.object_getattr_string(parcel, "address")
    number = context.pyapi.long_as_longlong(address)
    context.pyapi.decref(address)
    return NativeValue(number)  # type: ignore[no-untyped-call]


def _store(typing: Any, contents: Any, address: Any) -> Any:
    """Write contents to an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        value = _unowned(context, builder, signature.args[0], values[0])
        builder.store(value, builder.inttoptr(values[1], value.type.as_pointer()))
        return context.get_dummy_value()

    return types.void(contents, types.int64), generate


def _unowned(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The same value, whose arrays nobody counts the owners of: the parcel keeps them."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = array.meminfo.type(None)
        array.parent = array.parent.type(None)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        contents: Any = kind
        parts = [
            _unowned(context, builder, inner, builder.extract_value(value, place))
            for place, inner in enumerate(contents)
        ]
        return context.make_tuple(builder, kind, parts)
    return value


def _opened(typing: Any, parcel: Any) -> Any:
    """What is in a parcel."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = context.get_value_type(signature.return_type)
        contents = builder.load(builder.inttoptr(values[0], kind.as_pointer()))
        return impl_ret_borrowed(context, builder, signature.return_type, contents)  # type: ignore[no-untyped-call]

    return parcel.contents(parcel), generate


opened: Any = intrinsic(_opened)
_stored: Any = intrinsic(_store)


@kernel()
def _pack(contents: Any, address: int) -> None:
    _stored(contents, address)
