"""Strict reading of JSON: finite numbers of limited length, limited nesting."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from albot_core.errors import InputError
from albot_core.files import read_text

LARGEST = 16 << 20
"""Largest size of a JSON file (bytes); a house or a page of results has a few thousand."""
_DIGITS = 40
"""Largest number of digits of an integer: enough for 128 bits, and within a float's range."""
_DEPTH = 100
"""Largest depth of nested lists and objects."""


def read_json(path: Path) -> Any:
    """Read the value in a file.

    Raises:
        InputError: The file cannot be read, is larger than `LARGEST`, is not UTF-8, or as for
            `parse_json`.
    """
    return parse_json(read_text(path, LARGEST), path)


def parse_json(content: bytes | str, source: object, place: str = "") -> Any:
    """Parse a JSON text.

    Args:
        content: The text.
        source: Origin of the text, for errors.
        place: Place of the text in the source, for errors.

    Raises:
        InputError: The text is not JSON or not UTF-8, is nested too deeply, or holds a number that
            is not finite or too long.
    """
    try:
        value = json.loads(content, parse_int=_whole, parse_float=_finite, parse_constant=_finite)
    except json.JSONDecodeError as error:
        line = "" if place else f"line {error.lineno}"
        raise InputError(source, "valid JSON", error.msg, place=place or line) from None
    except UnicodeDecodeError:
        raise InputError(source, "JSON text", "bytes that are not text", place=place) from None
    except RecursionError:
        raise _too_deep(source, place) from None
    except ValueError as error:
        expected = f"finite numbers of {_DIGITS} digits at most"
        raise InputError(source, expected, str(error), place=place) from None
    if _is_deeper(value, _DEPTH):
        raise _too_deep(source, place)
    return value


def _too_deep(source: object, place: str) -> InputError:
    return InputError(source, f"JSON nested {_DEPTH} levels at most", "more", place=place)


def _whole(text: str) -> int:
    if len(text) > _DIGITS:
        raise ValueError(f"one of {len(text)} digits")
    return int(text)


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


def _is_deeper(value: Any, levels: int) -> bool:
    """Return whether lists and objects are nested more than `levels` deep."""
    holders = [value] if isinstance(value, dict | list) else []
    for _ in range(levels):
        items = (each.values() if isinstance(each, dict) else each for each in holders)
        holders = [each for held in items for each in held if isinstance(each, dict | list)]
    return bool(holders)
