"""The document of a page: one file with the player, and the data compressed inside it."""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from albot_core.drawing import palette
from albot_env.rendering.page.tables import Arrays

FORMAT = 1
"""Version of the data that the player reads."""
ACROSS = "scans"
"""The array whose numbers resemble those beside them; others resemble those above them."""
_PLAYER = Path(__file__).parent / "player"
_SCRIPTS = ("data.js", "view.js", "curves.js", "timeline.js", "player.js")
_STYLES = ("uPlot.min.css", "player.css")
_LIBRARY = "uPlot.iife.min.js"
"""A script that is large, and is therefore compressed with the data."""
_VENDORED = (_LIBRARY, "uPlot.min.css")
_COMMENTS = ("//", "/**", "* ", "*/")
"""Beginnings of lines that are comments."""


def document(title: str, facts: Mapping[str, Any], arrays: Arrays) -> bytes:
    """Return a page as HTML.

    Args:
        title: Its title.
        facts: What the player is told: anything that JSON can hold.
        arrays: Arrays, by name.
    """
    blob, index = _packed(arrays)
    ours = {"format": FORMAT, "arrays": index, "library": _read(_LIBRARY)}
    manifest = json.dumps({**facts, **ours}, allow_nan=False).encode()
    content = len(manifest).to_bytes(4, "little") + manifest
    content += b"\0" * (-len(content) % 8) + blob
    # In base64, so that no name in it can end the element. No time, so that bytes repeat.
    data = base64.b64encode(gzip.compress(content, 6, mtime=0)).decode()
    page = _read("player.html")
    return (
        page.replace("{{title}}", html.escape(title))
        .replace("{{style}}", _colours() + "".join(_read(name) for name in _STYLES))
        .replace("{{script}}", "</script><script>".join(_read(name) for name in _SCRIPTS))
        .replace("{{data}}", data)
        .encode()
    )


@cache
def _read(name: str) -> str:
    """Return a file of the player without comments and indentation, which readers never see."""
    text = (_PLAYER / name).read_text("utf-8")
    if name in _VENDORED:
        return text
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith(_COMMENTS))


def _colours() -> str:
    """Return the colours of all pictures as variables of CSS, on light and on dark ground."""
    light = {**palette.LIGHT, "paper": palette.PAPER, "text": palette.TEXT, "rule": palette.RULE}
    light |= {"free": palette.FREE, "faint": palette.FAINT}
    dark = {**palette.DARK, "paper": palette.DARK_GROUND, "text": palette.DARK["wall"]}
    dark |= {"rule": palette.DARK_FREE, "free": palette.DARK_FREE, "faint": palette.DARK["grid"]}
    return f":root{{{_variables(light)}}}:root[data-theme=dark]{{{_variables(dark)}}}"


def _variables(colours: Mapping[str, str]) -> str:
    return "".join(f"--{name}:{colour};" for name, colour in colours.items())


def _packed(arrays: Arrays) -> tuple[bytes, dict[str, Any]]:
    """Return arrays as bytes that compress well, and where and how each lies in them.

    Whole numbers are written as differences, and of all numbers first the lowest bytes, then the
    next ones, and so on.
    """
    parts, index, offset = [], {}, 0
    for name, array in arrays.items():
        native = np.ascontiguousarray(array)
        kind = native.dtype.str.lstrip("<|")
        across = name == ACROSS
        if native.dtype.kind in "iu" and native.size:
            native = _differences(native, axis=native.ndim - 1 if across else 0)
        size = native.dtype.itemsize
        data = native.view(np.uint8).reshape(-1, size).T.tobytes() if native.size else b""
        index[name] = {"type": kind, "shape": list(array.shape), "at": offset, "across": across}
        parts.append(data)
        offset += len(data)
    return b"".join(parts), index


def _differences(array: np.ndarray, axis: int) -> np.ndarray:
    """Return each number less the one before it; whole numbers wrap round."""
    found = array.copy()
    later: list[slice] = [slice(None)] * array.ndim
    earlier = later.copy()
    later[axis], earlier[axis] = slice(1, None), slice(None, -1)
    with np.errstate(over="ignore"):
        found[tuple(later)] -= array[tuple(earlier)]
    return found
