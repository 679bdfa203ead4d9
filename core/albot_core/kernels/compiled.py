"""How functions are compiled, and how long what was compiled is kept.

numba keeps compiled code beside the source, and looks only at the file that a function stands in.
A function that it calls, or a constant that it takes, may have changed in another file, or be gone,
after an update in place. So all compiled code is tied to a digest of all files with kernels.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config, serialize
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from albot_core.kernels.linking import Kernel

_config: Any = config
ZERO: Any = np.int64(0)
"""A plain 0 is a type of its own to numba: what it is passed to would be compiled twice."""
_WORD = ir.IntType(64)

# What compiled code returns is wrapped with the help of a Python function of numba's. A Ctrl-C that
# had been pressed meanwhile was raised in there, where nobody looks for it: the process ended with
# a SystemError, or a segmentation fault. With a cache, which is written in C, that function runs
# once only, and Python finds the signal after the call has returned.
_numba: Any = serialize
_numba._numba_unpickle = cache(_numba._numba_unpickle)

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(*, arrays: bool = False, nogil: bool = False) -> Callable[[Function], Function]:
    """A decorator: compiles a function, which then divides as numpy does (by zero: inf or NaN).

    An array is passed in seven registers, a view or a map in dozens. So a kernel is always inlined
    where another kernel calls it, however long it is; but not one that makes arrays.

    numba counts references to an array with atomic instructions each time it is passed on, which
    costs more than the work of a short function. Only functions that make or return arrays need
    reference counts, and those that call such with arrays they were given.

    Args:
        arrays: Whether it makes, copies or returns arrays (numba's option `_nrt`).
        nogil: Whether Python's other threads may run meanwhile.
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
        compiled = Kernel(function, targetoptions=options)
        compiled.enable_caching()
        _tie_to_all_kernels(compiled)
        return cast(Function, compiled)

    return compiling


def _tie_to_all_kernels(dispatcher: Any) -> None:
    # By the version, which numba reads first: an index kept of other kernels may name types that
    # are gone, and could not even be unpickled to look for a stamp in it.
    kept = dispatcher._cache._cache_file
    kept._version = f"{kept._version} {kernel_stamp()}"


def scratch(*shape: int, kind: Any = types.float64) -> Callable[[], np.ndarray]:
    """Makes a function that compiled code calls for a small array on the stack.

    The array is uninitialised, and gone when the function ends that called for it, which must not
    return it. Within one call of that function it is the same array each time.

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
    """Makes a function that compiled code calls with an address and a length for the array there.

    Its references are not counted: the caller must keep its memory alive.

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
"""`array[place]`, for a contiguous array with one axis, by a load of its own.

The compiler turns a loop over scattered places into gather instructions, which on some processors
take longer than as many loads. It does not do so with atomic loads."""


def _array(context: Any, builder: Any, signature: Any, where: Any, lengths: list[Any]) -> Any:
    """The array of the signature's type at a pointer, without a reference count."""
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


PACKAGES = ("albot_core", "albot_maps", "albot_env")
"""The packages that have compiled functions."""
_MARKS = (b"numba", b"albot_core.kernels.compiled")
_IMPORTED = re.compile(rb"^\s*(?:from|import) ([\w.]+)", re.MULTILINE)


@cache
def kernel_stamp() -> str:
    """A digest of all files of ours that compiled functions are made from."""
    folders = []
    for package in PACKAGES:
        spec = find_spec(package)
        folders += (spec.submodule_search_locations or []) if spec is not None else []
    return digest(map(Path, folders))


def digest(packages: Iterable[Path]) -> str:
    """A digest of the files that use kernels, and of the modules that these import.

    Args:
        packages: The folders of the packages, named as these are; no others are read.
    """
    sources = {}
    for package in packages:
        for path in package.rglob("*.py"):
            parts = package.name, *path.relative_to(package).with_suffix("").parts
            sources[".".join(parts).removesuffix(".__init__").encode()] = path.read_bytes()
    waiting = [name for name, text in sources.items() if any(mark in text for mark in _MARKS)]
    reached = set(waiting)
    while waiting:
        found = {name for name in _IMPORTED.findall(sources[waiting.pop()]) if name in sources}
        waiting += found - reached
        reached |= found
    summed = hashlib.sha256()
    for name in sorted(reached):
        summed.update(name + b"\0" + hashlib.sha256(sources[name]).digest())
    return summed.hexdigest()
