"""What the arrays of a mapper's state may be; for `restore`, which gets them from files.

Compiled code checks no bounds, and runs along surfaces: a shape or a length that no mapper made
would end in memory that is not its own, or not end at all.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.types import Segments

LONGEST = 1000.0
"""No surface, exit or link of a map is longer (m): no laser of a robot measures half as far."""

Shape = tuple[str | int, ...]
"""The lengths of an array's axes; a name stands for one that must agree wherever it stands."""


def check_shapes(
    arrays: Mapping[str, np.ndarray], shapes: Mapping[str, Shape], prefix: str = ""
) -> None:
    """Check the shapes of arrays.

    Args:
        arrays: The arrays.
        shapes: The shapes by the arrays' names.
        prefix: What goes before the names in errors.

    Raises:
        InputError: One is of another shape.
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
    """Raise InputError if an array holds NaN or infinity.

    Raises:
        InputError: One does.
    """
    for name in names:
        if not np.isfinite(arrays[name]).all():
            raise InputError(f"{prefix}{name}", "finite numbers", "NaN or infinity")


def check_lengths(name: str, segments: Segments) -> None:
    """Raise InputError if a line segment is longer than `LONGEST`; NaN is passed over.

    Raises:
        InputError: One is.
    """
    lengths = np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    if (lengths > LONGEST).any():
        found = f"{np.nanmax(lengths):g} m"
        raise InputError(name, f"line segments of {LONGEST:g} m at most", found)
