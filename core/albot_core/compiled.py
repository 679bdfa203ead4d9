"""How functions are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(
    *, arrays: bool = False, inline: bool = False, nogil: bool = False
) -> Callable[[Function], Function]:
    """A decorator: compiles a function, once for all runs, to divide as numpy does.

    numba counts who holds an array, with instructions that lock the bus, each time one is handed
    on, and in short functions that costs more than their work. Only functions that make or return
    arrays need it, and those that call such with what they are given; all others do without.

    Args:
        arrays: Whether it makes, copies or returns arrays (numba's option `_nrt`).
        inline: Whether it is copied to where it is called.
        nogil: Whether Python's other threads may run meanwhile.
    """
    options: dict[str, Any] = {"inline": "always"} if inline else {"_nrt": arrays}
    compiled: Callable[[Function], Function]
    compiled = njit(cache=True, error_model="numpy", nogil=nogil, **options)
    return compiled
