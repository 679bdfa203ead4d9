"""Angles and directions in compiled code."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.directions import wrapped
from albot_core.geometry.poses import wrap_angle


@settings(deadline=None)  # The first call compiles.
@given(st.floats(-1e6, 1e6))
@pytest.mark.parametrize("turns", [0.0, 2 * math.pi, -math.pi, math.pi])
def test_an_angle_is_wrapped_as_many_are(turns: float, angle: float) -> None:
    assert wrapped(angle + turns) == wrap_angle(angle + turns)
    assert wrapped(turns) == wrap_angle(turns)


def test_an_angle_that_is_none_stays_none() -> None:
    assert math.isnan(wrapped(math.nan))
    assert math.isnan(wrapped(math.inf))
