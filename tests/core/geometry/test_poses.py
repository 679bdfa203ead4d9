"""Laws of rigid motions, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import (
    compose,
    interpolate,
    inverse,
    relative,
    transform_points,
    transform_segments,
    wrap_angle,
)

coordinate = st.floats(-1e3, 1e3)
poses = st.tuples(coordinate, coordinate, st.floats(-10, 10)).map(np.array)


def same_pose(a: np.ndarray, b: np.ndarray) -> bool:
    turned = np.angle(np.exp(1j * (a[2] - b[2])))
    return np.allclose(a[:2], b[:2], atol=1e-8) and abs(turned) < 1e-8


@settings(deadline=None)
@given(poses)
def test_a_pose_composed_with_its_inverse_is_the_origin(pose: np.ndarray) -> None:
    assert same_pose(compose(pose, inverse(pose)), np.zeros(3))
    assert same_pose(compose(inverse(pose), pose), np.zeros(3))


@settings(deadline=None)
@given(poses, poses, poses)
def test_composition_is_associative(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    assert same_pose(compose(compose(a, b), c), compose(a, compose(b, c)))


@settings(deadline=None)
@given(poses, poses)
def test_relative_undoes_compose(a: np.ndarray, b: np.ndarray) -> None:
    assert same_pose(compose(a, relative(a, b)), b)


@settings(deadline=None)
@given(poses, poses, st.tuples(coordinate, coordinate).map(np.array))
def test_points_follow_composition(a: np.ndarray, b: np.ndarray, point: np.ndarray) -> None:
    through = transform_points(a, transform_points(b, point))
    assert np.allclose(transform_points(compose(a, b), point), through, atol=1e-8)


def test_quarter_turn_in_closed_form() -> None:
    frame = np.array([2.0, 1.0, np.pi / 2])
    assert np.allclose(transform_points(frame, np.array([1.0, 0.0])), [2.0, 2.0])
    moved = transform_segments(frame, np.array([[1.0, 0.0, 1.0, 1.0]]))
    assert np.allclose(moved, [[2.0, 2.0, 1.0, 2.0]])


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(np.pi, -np.pi), (-np.pi, -np.pi), (3.5 * np.pi, -np.pi / 2), (0.0, 0.0)]
)
def test_angles_wrap_into_the_half_open_circle(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)


def test_shapes_broadcast() -> None:
    path = np.zeros((5, 3))
    path[:, 0] = np.arange(5)
    assert compose(np.array([0.0, 0.0, np.pi / 2]), path).shape == (5, 3)
    assert np.allclose(compose(np.array([0.0, 0.0, np.pi / 2]), path)[4], [0, 4, np.pi / 2])


@settings(deadline=None)
@given(poses, poses)
def test_single_poses_and_many_have_the_same_bits(a: np.ndarray, b: np.ndarray) -> None:
    assert compose(a, b).tobytes() == compose(a[None], b[None]).tobytes()
    assert inverse(a).tobytes() == inverse(a[None]).tobytes()


@settings(deadline=None)
@given(poses, st.floats(-3, 3), st.floats(-5, 5), st.floats(0, 1))
def test_on_an_arc_poses_are_interpolated_exactly(
    begin: np.ndarray, turn: float, length: float, part: float
) -> None:
    def along(share: float) -> np.ndarray:
        angle = share * turn
        radius = length / turn if abs(turn) > 1e-9 else 0.0
        moved = (radius * np.sin(angle), radius * (1 - np.cos(angle)), angle)
        return compose(begin, np.array(moved if radius else (share * length, 0.0, angle)))

    stamps = np.array((10.0, 10.5))
    ends = np.stack((along(0.0), along(1.0)))
    wanted = np.array((10.0, 10.0 + part / 2, 10.5))
    found = interpolate(stamps, ends, wanted)
    for pose, share in zip(found, (0.0, part, 1.0), strict=True):
        np.testing.assert_allclose(pose[:2], along(share)[:2], atol=1e-6)
        assert abs(np.angle(np.exp(1j * (pose[2] - along(share)[2])))) < 1e-6


def test_a_turn_on_the_spot_over_the_wrap_goes_the_short_way() -> None:
    ends = np.array(((1.0, 2.0, 3.0), (1.0, 2.0, -3.0)))
    (middle,) = interpolate(np.array((0.0, 1.0)), ends, np.array((0.5,)))
    np.testing.assert_allclose((*middle[:2], abs(middle[2])), (1.0, 2.0, np.pi))


def test_one_pose_is_its_own_interpolation() -> None:
    pose = np.array(((1.0, 2.0, 0.5),))
    np.testing.assert_array_equal(interpolate(np.zeros(1), pose, np.zeros(2)), pose.repeat(2, 0))
