"""Compilation of functions, and how long compiled code is kept.

numba keeps compiled code beside the source until the file changes that defines the function. Here
it is kept until any file changes that this file imports, directly or indirectly (`stamp`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config, serialize
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from albot_core.kernels.linking import Kernel
from albot_core.kernels.stamp import stamp_of

_config: Any = config
ZERO: Any = np.int64(0)
"""0 as an int64. numba has an own type for a literal 0, for which it would compile a callee
again."""
_WORD = ir.IntType(64)

# numba wraps the results of compiled code by a Python function. A Ctrl-C pressed during the call
# was raised inside that function, where no code handles it, and the process ended with a
# SystemError or a segmentation fault. With a cache, which is written in C, the function runs only
# once, and Python finds the signal after the call has returned.
_numba: Any = serialize
_numba._numba_unpickle = cache(_numba._numba_unpickle)

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(*, arrays: bool = False, nogil: bool = False) -> Callable[[Function], Function]:
    """Compile a function (a decorator); division by zero in it gives inf or NaN, as in numpy.

    An array is passed in seven registers, a view or a map in dozens. So a kernel is always inlined
    where another kernel calls it, however long it is, unless it makes arrays.

    numba counts references to an array with atomic instructions each time it is passed on, which
    costs more than the work of a short function. Only functions that make or return arrays need
    reference counts, and those that call such functions with arrays they were given.

    Args:
        arrays: Whether the function makes, copies or returns arrays (numba's option `_nrt`).
        nogil: Whether Python's other threads may run during a call.
    """
    options: dict[str, Any] = {
        "nopython": True,
        "boundscheck": None,
        "error_model": "numpy",
        "nogil": nogil,
        "_nrt": arrays,
        "forceinline": not arrays,
    }

    def compiling(function: Function) -> Function:
        if _config.DISABLE_JIT:
            return function
        compiled: Any = Kernel(function, targetoptions=options)
        compiled.enable_caching()
        _tie_to_imports(function, compiled._cache)
        return cast(Function, compiled)

    return compiling


def _tie_to_imports(function: Any, kept: Any) -> None:
    """Use a function's kept code only if all files that may be part of it are unchanged.

    Args:
        function: The function.
        kept: numba's store of the compiled code.
    """
    path = Path(function.__code__.co_filename)
    # By the version, which numba reads first: an index kept for other versions of kernels may name
    # types that no longer exist, and so could not be unpickled to look for a stamp in it.
    index = kept._cache_file
    index._version = f"{index._version} {stamp_of(function.__module__, path)}"
    load, key = index._load_index, kept._index_key

    def load_index() -> Any:
        """Return the index of kept code; empty if it names types that no longer exist."""
        try:
            return load()
        except (AttributeError, ImportError):
            return {}

    def key_of(signature: Any, codegen: Any) -> Any:
        """Return numba's key, with the fields of named tuples, which numba does not compare."""
        return *key(signature, codegen), tuple(_fields_of(getattr(signature, "args", signature)))

    index._load_index, kept._index_key = load_index, key_of


def _fields_of(kinds: Iterable[Any]) -> Iterator[tuple[str, ...]]:
    """Yield the names of the fields of all named tuples in some of numba's types."""
    for kind in kinds:
        if isinstance(kind, types.BaseTuple):
            yield tuple(getattr(kind, "fields", ()))
            parts: Any = kind
            yield from _fields_of(parts)
        elif hasattr(kind, "contents"):  # The contents of kernel arguments.
            yield from _fields_of((kind.contents,))


def scratch(*shape: int, kind: Any = types.float64) -> Callable[[], np.ndarray]:
    """Return a function that compiled code calls for a small array on the stack.

    The array is uninitialised. It is valid until the calling function ends, which must not return
    it. Within one call of that function it is the same array each time.

    Args:
        shape: The length of each axis.
        kind: The dtype, as numba names it.
    """

    def _scratch(typing: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            tools: Any = cgutils
            room = ir.ArrayType(context.get_data_type(kind), math.prod(shape))
            lengths = [ir.Constant(_WORD, length) for length in shape]
            return _array(context, builder, signature, tools.alloca_once(builder, room), lengths)

        return types.Array(kind, len(shape), "C")(), generate

    return cast(Callable[[], np.ndarray], intrinsic(_scratch))


def array_at(*columns: int, kind: Any = types.float64) -> Callable[[int, int], np.ndarray]:
    """Return a function that compiled code calls with an address and a length for the array there.

    References to the array are not counted: the caller must keep its memory alive.

    Args:
        columns: The lengths of the axes after the first.
        kind: The dtype, as numba names it.
    """

    def _array_at(typing: Any, address: Any, rows: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            where = builder.inttoptr(values[0], context.get_data_type(kind).as_pointer())
            lengths = [values[1], *(ir.Constant(_WORD, length) for length in columns)]
            return _array(context, builder, signature, where, lengths)

        return types.Array(kind, 1 + len(columns), "C")(types.int64, types.int64), generate

    return cast(Callable[[int, int], np.ndarray], intrinsic(_array_at))


def _load_element(typing: Any, array: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        of = signature.args[0]
        data = context.make_array(of)(context, builder, values[0]).data
        size = context.get_abi_sizeof(context.get_data_type(of.dtype))
        where = builder.gep(data, [values[1]], inbounds=True)
        return builder.load_atomic(where, "unordered", size)

    return array.dtype(array, types.int64), generate


load_element = cast(Callable[[np.ndarray, int], Any], intrinsic(_load_element))
"""Return `array[place]`, for a contiguous array with one axis, by a separate load.

The compiler turns a loop over scattered elements into gather instructions, which on some processors
take longer than the same number of loads. It does not do so with atomic loads."""


def _array(context: Any, builder: Any, signature: Any, where: Any, lengths: list[Any]) -> Any:
    """Return the array of the signature's type at a pointer, without a reference count."""
    kind = signature.return_type
    element = context.get_data_type(kind.dtype)
    size = ir.Constant(_WORD, context.get_abi_sizeof(element))
    strides = [size]
    for length in reversed(lengths[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    array = context.make_array(kind)(context, builder)
    data = builder.bitcast(where, element.as_pointer())
    populate: Any = populate_array
    populate(array, data=data, shape=lengths, strides=strides, itemsize=size, meminfo=None)
    return array._getvalue()
