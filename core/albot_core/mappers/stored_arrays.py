"""Checks of the arrays of a mapper's state; for `restore`, which gets them from files.

Compiled code checks no bounds, and loops along surfaces. An invalid shape or length could make it
access memory that is not its own, or run for ever.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Segments

LONGEST = 1000.0
"""Largest length of a surface, exit or link of a map (m); no robot's laser measures half as far."""

Shape = tuple[str | int, ...]
"""Lengths of an array's axes; axes with the same name must have the same length."""


def check_shapes(
    arrays: Mapping[str, np.ndarray], shapes: Mapping[str, Shape], prefix: str = ""
) -> None:
    """Check the shapes of arrays.

    Args:
        arrays: The arrays.
        shapes: The shapes by the arrays' names.
        prefix: Prefix of the names in errors.

    Raises:
        InputError: An array has another shape.
    """
    lengths: dict[str, int] = {}
    for name, shape in shapes.items():
        found = arrays[name].shape
        wanted = tuple(
            lengths.setdefault(length, found[axis]) if isinstance(length, str) else length
            for axis, length in enumerate(shape)
            if axis < len(found)
        )
        if len(found) != len(shape) or found != wanted:
            raise InputError(f"{prefix}{name}", f"shape {shape}", str(found))


def check_finite(arrays: Mapping[str, np.ndarray], *names: str, prefix: str = "") -> None:
    """Check that no array holds NaN or infinity.

    Raises:
        InputError: An array holds NaN or infinity.
    """
    for name in names:
        if not np.isfinite(arrays[name]).all():
            raise InputError(f"{prefix}{name}", "finite numbers", "NaN or infinity")


def check_lengths(name: str, segments: Segments) -> None:
    """Check that no line segment is longer than `LONGEST`; NaN is ignored.

    Raises:
        InputError: A line segment is longer.
    """
    lengths = np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    if (lengths > LONGEST).any():
        found = f"{np.nanmax(lengths):g} m"
        raise InputError(name, f"line segments of {LONGEST:g} m at most", found)
