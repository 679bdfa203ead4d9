"""Checks of a mapper's stored arrays: which are refused, and what is told of them."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.stored_arrays import LONGEST, check_finite, check_lengths, check_shapes

FAR = 1e4
"""Where a map may lie (m), far beyond the length of any of its lines."""


@pytest.mark.parametrize(
    "line",
    [
        (0, 0, LONGEST, 0),
        (FAR, FAR, FAR + 0.6 * LONGEST, FAR + 0.8 * LONGEST),
        (0, -FAR, 0, LONGEST - FAR),
        (np.nan, np.nan, np.nan, np.nan),
    ],
)
def test_a_line_may_lie_anywhere(line):
    check_lengths("surfaces", np.array((line, (0, 0, 1, 1)), float))


@pytest.mark.parametrize(
    "line",
    [
        (-LONGEST, 0, 1, 0),
        (-0.6 * LONGEST, -0.8 * LONGEST, 1, 0),
        (FAR, -LONGEST, FAR, 1),
    ],
)
def test_a_line_that_is_too_long_is_refused(line):
    length = np.hypot(line[2] - line[0], line[3] - line[1])
    lines = np.array(((0, 0, 1, 1), (np.nan, 0, 0, 0), line), float)
    with pytest.raises(InputError) as refused:
        check_lengths("surfaces", lines)
    assert refused.value.source == "surfaces"
    assert refused.value.found == f"{length:g} m"


def test_no_lines_are_none_too_long():
    check_lengths("surfaces", np.empty((0, 4)))


def test_axes_of_one_name_have_one_length():
    shapes = {"lines": ("lines", 4), "ages": ("lines",), "pose": (3,)}
    arrays = {"lines": np.zeros((2, 4)), "ages": np.zeros(2), "pose": np.zeros(3)}
    check_shapes(arrays, shapes)
    for name, wrong in (("lines", (2, 3)), ("ages", (3,)), ("ages", (2, 1)), ("pose", ())):
        with pytest.raises(InputError, match=rf"^map\.{name}: expected shape"):
            check_shapes(arrays | {name: np.zeros(wrong)}, shapes, prefix="map.")


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_refused(wrong):
    arrays = {"pose": np.zeros(3), "ranges": np.array((1.0, wrong))}
    check_finite(arrays, "pose")
    with pytest.raises(InputError, match=r"^map\.ranges: expected finite numbers"):
        check_finite(arrays, "pose", "ranges", prefix="map.")
