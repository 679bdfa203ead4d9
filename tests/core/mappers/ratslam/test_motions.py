"""Motions put together and taken apart, against poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import compose
from albot_core.mappers.ratslam.motions import after, before, beyond, nearest_turn

MOTIONS = st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9))


@given(MOTIONS, MOTIONS)
def test_what_is_put_together_comes_apart(first, last):
    whole = after(first, last)
    composed = compose(np.array(first), np.array(last))
    np.testing.assert_allclose(whole[:2], composed[:2], atol=1e-9)
    assert whole[2] == pytest.approx(first[2] + last[2])  # Whole turns count.
    np.testing.assert_allclose(before(whole, last), first, atol=1e-9)
    np.testing.assert_allclose(beyond(first, whole), last, atol=1e-9)


@given(st.floats(-50, 50))
def test_the_nearest_turn_is_the_same_direction(turn):
    nearest = nearest_turn(turn)
    assert -math.pi <= nearest < math.pi
    assert math.cos(nearest - turn) == pytest.approx(1.0)
