"""Detection of a display."""

from __future__ import annotations

import os
import sys


def display_found() -> bool:
    """Whether a display seems available for a window, judged without opening one."""
    if sys.platform in {"win32", "darwin"}:
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
