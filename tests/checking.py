"""What jaxtyping's import hook puts before every function: its check, each argument seen once.

jaxtyping's own decorator binds the arguments anew and looks at each of them twice, once before
and once after the call, for its messages' sake: half of the time of all tests.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints

import jaxtyping
from beartype import BeartypeConf, beartype

JAXTYPED = jaxtyping.jaxtyped
CHECK = beartype(conf=BeartypeConf(violation_type=jaxtyping.TypeCheckError))
DIMENSIONS = jaxtyping.jaxtyped("context")
"""Within it a dimension that bears a name has one length."""


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
    whole = CHECK(fn)

    @functools.wraps(fn)
    def call(*args: Any, **kwargs: Any) -> Any:
        with DIMENSIONS:
            return whole(*args, **kwargs)

    return call


def _resolved(annotation: Any, names: dict[str, Any]) -> Any:
    """What an annotation names; anything where only type checkers know it, or it names itself."""

    def holder() -> None: ...

    holder.__annotations__ = {"held": annotation}
    try:
        hint = get_type_hints(holder, names, include_extras=True)["held"]
    except NameError:
        return Any
    return Any if "ForwardRef" in repr(hint) else hint
