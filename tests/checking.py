"""What jaxtyping's import hook puts before every function: its check, each argument seen once.

jaxtyping's own decorator binds the arguments anew and looks at each of them twice, once before
and once after the call, for its messages' sake: half of the time of all tests. And where types
and shapes alone decide, a call like one that passed is not checked again: half of what was left.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import sys
import types
import typing
from abc import ABCMeta
from collections.abc import Callable
from enum import EnumType
from typing import Any, Union, get_args, get_origin, get_type_hints

import jaxtyping
import numpy as np
from beartype import BeartypeConf, beartype

JAXTYPED = jaxtyping.jaxtyped
CHECK = beartype(conf=BeartypeConf(violation_type=jaxtyping.TypeCheckError))
DIMENSIONS = jaxtyping.jaxtyped("context")
"""Within it a dimension that bears a name has one length."""
ARRAY = type(jaxtyping.Float[np.ndarray, ""])
"""What all hints of arrays are instances of."""
_PLAIN: set[type] = set()
"""The types met so far that are themselves all that hints look at."""
_KEPT = 1000
"""As many kinds of calls are remembered of a function."""


def checked(fn: Any = None, *, typechecker: Any) -> Any:
    """Check a function's arguments and result at every call, a dataclass's fields at the making."""
    if fn is None:
        return functools.partial(checked, typechecker=typechecker)
    if inspect.isgeneratorfunction(fn):  # Its body runs at other times than its call.
        return JAXTYPED(fn, typechecker=typechecker)
    if not isinstance(fn, type):
        return _checked(fn)
    if dataclasses.is_dataclass(fn) and "__init__" in vars(fn):
        fn.__init__ = _checked(fn.__init__)  # type: ignore[method-assign]
    return fn


def _checked(fn: Callable[..., Any]) -> Callable[..., Any]:
    names = fn.__globals__
    fn.__annotations__ = {name: _resolved(of, names) for name, of in fn.__annotations__.items()}
    hints = list(fn.__annotations__.values())
    whole = CHECK(fn)
    if "jaxtyping" not in repr(hints):
        return whole
    if not all(map(is_told_by_kind, hints)):

        @functools.wraps(fn)
        def call(*args: Any, **kwargs: Any) -> Any:
            with DIMENSIONS:
                return whole(*args, **kwargs)

        return call

    passed: dict[Any, set[Any]] = {}
    """The kinds of arguments that passed, and with each those of their results."""

    @functools.wraps(fn)
    def call_once_a_kind(*args: Any, **kwargs: Any) -> Any:
        kind: Any = tuple(map(_kind, args))
        if kwargs:
            kind = kind, tuple([(name, _kind(each)) for name, each in kwargs.items()])
        results = passed.get(kind)
        if results is None:
            with DIMENSIONS:
                result = whole(*args, **kwargs)
            if len(passed) > _KEPT:
                passed.clear()
            passed[kind] = {_kind(result)}
            return result
        result = fn(*args, **kwargs)
        if (kind_of_result := _kind(result)) not in results:
            with DIMENSIONS:
                CHECK(functools.wraps(fn)(lambda *_, **__: result))(*args, **kwargs)
            if len(results) > _KEPT:
                results.clear()
            results.add(kind_of_result)
        return result

    return call_once_a_kind


def _kind(value: Any) -> Any:
    """All of a value that hints look at that are told by kind."""
    of = type(value)
    if of in _PLAIN:
        return of
    if of is np.ndarray:
        return value.dtype, value.shape
    if of is tuple:
        return tuple(map(_kind, value))
    if issubclass(of, tuple):
        return (of, *map(_kind, value))
    if issubclass(of, np.ndarray):
        return of, value.dtype, value.shape
    _PLAIN.add(of)
    return of


def is_told_by_kind(hint: Any) -> bool:
    """Whether two values of one kind both fit a hint or both do not."""
    if hint is Any or hint is None:
        return True
    if isinstance(hint, ARRAY):
        return hint.array_type is np.ndarray and "{" not in hint.dim_str
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return all(map(is_told_by_kind, parts))
    if origin is tuple:
        return all(part is ... or is_told_by_kind(part) for part in parts)
    if origin is Callable:
        return True
    # Of protocols a type's instances may differ.
    return isinstance(hint, type) and origin is None and type(hint) in (type, ABCMeta, EnumType)


@functools.cache
def _has_all(protocol: Any, of: Any) -> bool:
    """Whether a type has all members of a protocol, whatever its instances have besides."""
    names = typing._get_protocol_attrs(protocol)  # type: ignore[attr-defined]
    found = {name: value for each in reversed(of.__mro__) for name, value in vars(each).items()}
    return all(found.get(name) is not None for name in names)


def _is_instance(protocol: Any, instance: Any) -> bool:
    """Whether an object is of a protocol; as Python 3.12 sees it, none of its properties is read.

    Python 3.11 works them all out at each check: snapshots of maps, for one.
    """
    by_type = protocol._is_protocol and protocol._is_runtime_protocol
    return (by_type and _has_all(protocol, type(instance))) or _IS_INSTANCE(protocol, instance)


_PROTOCOLS: Any = type(typing.Protocol)
_IS_INSTANCE = _PROTOCOLS.__instancecheck__
if sys.version_info < (3, 12):
    _PROTOCOLS.__instancecheck__ = _is_instance


def _resolved(annotation: Any, names: dict[str, Any]) -> Any:
    """What an annotation names; anything where only type checkers know it, or it names itself."""

    def holder() -> None: ...

    holder.__annotations__ = {"held": annotation}
    try:
        hint = get_type_hints(holder, names, include_extras=True)["held"]
    except NameError:
        return Any
    return Any if "ForwardRef" in repr(hint) else hint
