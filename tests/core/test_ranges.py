"""What numbers of a configuration may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.ranges import (
    COUNT,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    Range,
    are_numbers,
    check_fields,
)

TINY = math.nextafter(0.0, 1.0)


@dataclass
class Settings:
    first: object = 1.0
    second: object = 1.0


@pytest.mark.parametrize(
    ("allowed", "inside", "outside"),
    [
        (POSITIVE, (TINY, 1, 1e300, np.float32(2)), (0, 0.0, -TINY)),
        (NOT_NEGATIVE, (0, 0.0, 1e300), (-TINY, -1)),
        (SHARE, (0, 0.5, 1), (-TINY, math.nextafter(1.0, 2.0))),
        (COUNT, (0, 3, np.int64(4)), (-1, 1.5, 2.0)),
        (Range("between", -1.0, 2.0, beyond=True), (-0.999, 0, 2), (-1, 2.001)),
        (Range("one", 1.0, 1.0), (1, 1.0), (True, np.True_, 1j, [1.0])),
    ],
)
def test_a_range_holds_what_it_says(allowed, inside, outside) -> None:
    assert all(value in allowed for value in inside)
    for value in (*outside, math.nan, math.inf, -math.inf, 10**400, -(10**400), "1", None):
        assert value not in allowed


def test_infinity_is_in_a_range_only_where_it_says_so() -> None:
    allowed = Range("a number from 0, or infinity", 0.0, infinite=True)
    assert all(value in allowed for value in (0, 1e300, math.inf))
    assert not any(value in allowed for value in (-math.inf, math.nan, -1, True, None, "inf"))


def test_what_is_no_number_is_shown_as_what_it_is() -> None:
    with pytest.raises(InputError, match=r"first: expected a positive number, found '1\.5'$"):
        check_fields(Settings(first="1.5"), POSITIVE, "first")
    with pytest.raises(
        InputError, match=r"first: expected a positive number, found array\(1\.5\)$"
    ):
        check_fields(Settings(first=np.array(1.5)), POSITIVE, "first")


def test_numbers_side_by_side_are_counted() -> None:
    assert are_numbers((1, 2.0), 2)
    assert are_numbers([np.float64(1)])
    assert are_numbers(np.zeros(3), 3)
    for values in (1.0, None, "12", (1.0,), (1.0, math.nan), (1.0, "2"), ((1.0, 2.0),)):
        assert not are_numbers(values, 2)


def test_the_first_wrong_field_is_named() -> None:
    check_fields(Settings(), POSITIVE, "first", "second")
    with pytest.raises(InputError, match=r"Settings\.second: expected a positive number, found -3"):
        check_fields(Settings(second=-3), POSITIVE, "first", "second")
    check_fields(Settings(second=-3), POSITIVE, "first")
