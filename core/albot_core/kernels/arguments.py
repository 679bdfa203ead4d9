"""Kernel arguments: many arrays that compiled code takes as one address.

numba unpacks each array that Python passes to a compiled call. This costs most of a microsecond per
array, often far more than the work of the call. `KernelArguments` are unpacked once, when they are
made. Then a call takes one address, and the kernel gets the arrays back by `unpack`.
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
"""Contents begin at a multiple of this many bytes."""


class KernelArguments:
    """Arrays and numbers, in nested tuples, that compiled code gets back by `unpack`.

    The values in the arrays may change; the arrays cannot be replaced.

    Args:
        contents: A tuple of arrays, numbers and nested tuples.
    """

    def __init__(self, contents: tuple[Any, ...]) -> None:
        self._kept = contents
        self.kind = _kind_of_contents(contents)
        """The numba type."""
        self._room = np.empty(_size_of(self.kind.contents) + _LINE, np.uint8)
        self.address = -(-self._room.ctypes.data // _LINE) * _LINE
        """Address of the contents, in compiled code's own layout."""
        _packer_of(self.kind)(contents, self.address)

    def __reduce__(self) -> tuple[type[KernelArguments], tuple[Any, ...]]:
        """Copy or pickle the contents; the copy has an address of its own."""
        return KernelArguments, (self._kept,)


class ArgumentsCache:
    """Keeps the last `KernelArguments`, and makes new ones only if a part is replaced.

    Args:
        arrange: Makes the contents from the parts.
    """

    def __init__(self, arrange: Callable[..., tuple[Any, ...]]) -> None:
        self._arrange = arrange
        self._packed: tuple[tuple[Any, ...], KernelArguments] | None = None

    def arguments(self, *parts: Any) -> KernelArguments:
        """Return the arguments made from these parts; parts are compared by identity, not value."""
        packed = self._packed
        if packed is None or any(map(is_not, parts, packed[0])):
            # A single assignment, for threads that call this at the same time.
            self._packed = packed = parts, KernelArguments(self._arrange(*parts))
        return packed[1]


class KernelDispatcher:
    """Calls compiled code that takes `KernelArguments`, from Python: a decorator over `kernel`.

    numba works out the types of all arguments at each call. For `KernelArguments` this often takes
    longer than the work of the call. This dispatcher does so only if the contents' type differs
    from the call before. So all other arguments must have the same types at each call, and arrays
    must be contiguous.

    Args:
        compiled: The compiled function; other compiled code must call this, not the dispatcher.
    """

    def __init__(self, compiled: Callable[..., Any]) -> None:
        self.compiled: Any = compiled
        """The compiled function."""
        self._known: tuple[KernelArgumentsType | None, Callable[..., Any]] = None, compiled
        update_wrapper(self, compiled)

    def __call__(self, rows: np.ndarray, arguments: KernelArguments, *others: Any) -> Any:
        """Run the compiled function for these rows."""
        kind, run = self._known
        if kind is not arguments.kind:
            run = self._find(rows, arguments, *others)
        return run(rows, arguments, *others)

    def _find(self, *arguments: Any) -> Callable[..., Any]:
        """Return the machine code for arguments of these types; compile it if needed."""
        signature = tuple(map(typeof, arguments))
        self.compiled.compile(signature)
        found: Callable[..., Any] = self.compiled.overloads[signature].entry_point
        self._known = arguments[1].kind, found  # A single assignment, for threads.
        return found


class KernelArgumentsType(types.Type):
    """The numba type of kernel arguments whose contents have one type."""

    def __init__(self, contents: Any) -> None:
        self.contents = contents
        super().__init__(name=f"KernelArguments({contents})")


_KINDS: dict[Any, KernelArgumentsType] = {}
"""The types of contents seen so far, by `_shape_of`."""
_NUMBERS = int | float | np.number | np.bool_


def _kind_of_contents(contents: tuple[Any, ...]) -> KernelArgumentsType:
    """Return the type of kernel arguments with these contents.

    numba's `typeof` takes milliseconds for a hundred arrays, so it is asked once for all that are
    alike.
    """
    shape = _shape_of(contents)
    kind = _KINDS.get(shape)
    if kind is None:
        kind = _KINDS[shape] = KernelArgumentsType(typeof(contents))  # type: ignore[no-untyped-call]
    return kind


def _shape_of(value: Any) -> Any:
    """Return what the numba type of a value depends on."""
    if isinstance(value, np.ndarray):
        flags = value.flags
        layout = flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned
        return value.dtype, value.ndim, *layout
    if isinstance(value, tuple):
        return type(value), *map(_shape_of, value)
    if isinstance(value, int):
        return type(value), value.bit_length() > 63  # These are unsigned for numba.
    return type(value) if isinstance(value, _NUMBERS) else typeof(value)  # type: ignore[no-untyped-call]


@cache
def _size_of(kind: Any) -> int:
    """Return the number of bytes that contents of a numba type take."""
    context = cpu_target.target_context
    size: int = context.get_abi_sizeof(context.get_value_type(kind))
    return size


@typeof_impl.register(KernelArguments)
def _kind_of(arguments: KernelArguments, _: Any) -> KernelArgumentsType:
    return arguments.kind


@register_model(KernelArgumentsType)
class _ArgumentsModel(models.PrimitiveModel):
    """The numba model of kernel arguments: their address."""

    def __init__(self, manager: Any, kind: KernelArgumentsType) -> None:
        super().__init__(manager, kind, ir.IntType(64))  # type: ignore[no-untyped-call]


@unbox(KernelArgumentsType)  # type: ignore[no-untyped-call, untyped-decorator]
def _take(_: KernelArgumentsType, arguments: Any, context: Any) -> NativeValue:
    address = context.pyapi.object_getattr_string(arguments, "address")
    number = context.pyapi.long_as_longlong(address)
    context.pyapi.decref(address)
    return NativeValue(number)  # type: ignore[no-untyped-call]


def _store(typing: Any, contents: Any, address: Any) -> Any:
    """Write the contents to an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        value = _unowned(context, builder, signature.args[0], values[0])
        builder.store(value, builder.inttoptr(values[1], value.type.as_pointer()))
        return context.get_dummy_value()

    return types.void(contents, types.int64), generate


def _unowned(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return the value without reference counts: `KernelArguments` keep the arrays alive."""
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


def _unpack(typing: Any, arguments: Any) -> Any:
    """Return the contents, as compiled code's own tuples and arrays."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = context.get_value_type(signature.return_type)
        contents = builder.load(builder.inttoptr(values[0], kind.as_pointer()))
        return impl_ret_borrowed(context, builder, signature.return_type, contents)  # type: ignore[no-untyped-call]

    return arguments.contents(arguments), generate


unpack: Any = intrinsic(_unpack)
"""In compiled code: the contents of `KernelArguments`, as the tuple they were made from."""
_stored: Any = intrinsic(_store)


@kernel()
def _pack(contents: Any, address: int) -> None:
    _stored(contents, address)


@cache
def _packer_of(kind: KernelArgumentsType) -> Callable[[tuple[Any, ...], int], None]:
    """Return the machine code of `_pack` for contents of a type."""
    pack: Any = _pack
    signature = kind.contents, types.int64
    pack.compile(signature)
    packer: Callable[[tuple[Any, ...], int], None] = pack.overloads[signature].entry_point
    return packer
