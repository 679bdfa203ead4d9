"""Poses and angles in compiled code against those in numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry import pose_kernels, poses

coordinate = st.floats(-1e3, 1e3)
pose = st.tuples(coordinate, coordinate, st.floats(-10, 10)).map(np.array)


@settings(deadline=None)  # The first call compiles.
@given(st.floats(-1e6, 1e6))
@pytest.mark.parametrize("turns", [0.0, 2 * math.pi, -math.pi, math.pi])
def test_an_angle_is_wrapped_as_many_are(turns: float, angle: float) -> None:
    assert pose_kernels.wrap_angle(angle + turns) == poses.wrap_angle(angle + turns)
    assert pose_kernels.wrap_angle(turns) == poses.wrap_angle(turns)


def test_an_angle_that_is_none_stays_none() -> None:
    assert math.isnan(pose_kernels.wrap_angle(math.nan))
    assert math.isnan(pose_kernels.wrap_angle(math.inf))


@settings(deadline=None)
@given(pose, pose)
def test_compiled_poses_are_those_of_numpy(first: np.ndarray, second: np.ndarray) -> None:
    cos, sin = math.cos(first[2]), math.sin(first[2])
    composed = poses.compose(first, second)
    assert np.array(pose_kernels.compose(first, second)) == pytest.approx(composed)
    point = pose_kernels.transform_point(first, cos, sin, second[0], second[1])
    assert point == pytest.approx(tuple(composed[:2]))


@settings(deadline=None)
@given(st.floats(-10, 10), coordinate, coordinate)
def test_a_vector_turned_and_turned_back_is_the_same(turn: float, x: float, y: float) -> None:
    cos, sin = math.cos(turn), math.sin(turn)
    turned = pose_kernels.rotate(cos, sin, x, y)
    assert turned == pytest.approx(
        tuple(poses.compose(np.array((0, 0, turn)), np.array((x, y, 0.0)))[:2])
    )
    assert pose_kernels.rotate_back(cos, sin, *turned) == pytest.approx((x, y), abs=1e-9)
