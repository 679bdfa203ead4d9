"""How often Python looks for garbage in cycles."""

from __future__ import annotations

import gc

_OBJECTS = 10_000
"""New objects after which it looks. Python's default, up to 3.12, is 700: while libraries load,
which make hundreds of thousands that stay, a fifth of the time goes into looking in vain."""


def collect_rarely() -> None:
    """Let Python look for garbage less often, in a process that starts; others are left alone."""
    gc.set_threshold(_OBJECTS, *gc.get_threshold()[1:])
