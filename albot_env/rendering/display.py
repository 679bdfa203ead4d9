"""Whether there is a screen."""

from __future__ import annotations

import os
import sys


def display_found() -> bool:
    """Whether there is a screen to open a window on, as far as one can tell without trying."""
    if sys.platform in {"win32", "darwin"}:
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
