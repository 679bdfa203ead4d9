"""Path integration: closed forms, laws of rigid motion, and the ant's error by its equation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from albot_core.geometry.poses import compose, relative, wrap_angle
from albot_core.mappers.sahabot.path_integration import (
    CompassHeading,
    HomeVector,
    ant_cosine,
    ant_sine,
    approximate_step,
    exact_step,
)

STUCK = math.radians(20.0)


def integrate(poses: np.ndarray, offset: float = 0.0, flips: tuple[int, ...] = ()) -> np.ndarray:
    """Where a robot with a faultless compass believes it is at each of its true poses.

    Args:
        poses: The true poses.
        offset: The direction from which the compass measures.
        flips: The readings at which the compass shows the opposite heading.
    """
    shown = wrap_angle(poses[:, 2] - offset)
    shown[list(flips)] = wrap_angle(shown[list(flips)] + math.pi)
    heading = CompassHeading(STUCK, uses_compass=True)
    heading.begin(float(shown[0]))
    position, found = (0.0, 0.0), [(0.0, 0.0, 0.0)]
    for k, motion in enumerate(relative(poses[:-1], poses[1:]), start=1):
        position = exact_step(position, heading.heading, motion)
        heading.update(0.9 * float(motion[2]), float(shown[k]))  # The wheels turn too little.
        found.append((*position, heading.heading))
    return np.array(found)


def arc(radius: float, angle: float, steps: int) -> np.ndarray:
    """Poses on an arc to the left that begins at the origin, heading along x."""
    turned = np.linspace(0.0, angle, steps + 1)
    return np.stack(
        (radius * np.sin(turned), radius * (1 - np.cos(turned)), wrap_angle(turned)), axis=-1
    )


def test_an_arc_with_a_known_compass_ends_where_it_must() -> None:
    found = integrate(arc(2.0, 1.5 * math.pi, 300))
    assert found[-1] == pytest.approx((-2.0, 2.0, -math.pi / 2), abs=1e-9)
    assert integrate(arc(2.0, 2 * math.pi, 300))[-1] == pytest.approx((0, 0, 0), abs=1e-9)


steps = st.lists(
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.1, 0.1), st.floats(-0.7, 0.7)),
    min_size=1,
    max_size=30,
)


@settings(max_examples=40, deadline=None)
@given(steps, st.floats(-3.0, 3.0), st.tuples(*[st.floats(-3.0, 3.0)] * 3))
def test_the_home_vector_does_not_depend_on_where_the_world_begins(
    motions: list[tuple[float, float, float]], offset: float, start: tuple[float, float, float]
) -> None:
    """Rigid motion: neither the start's pose nor the meridian changes what the robot believes."""
    poses = [np.zeros(3)]
    for motion in motions:
        poses.append(compose(poses[-1], np.array(motion)))
    true = np.array(poses)
    moved = compose(np.array(start), true)
    found = integrate(moved, offset)
    np.testing.assert_allclose(found[:, :2], true[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.cos(found[:, 2] - true[:, 2]), 1.0, atol=1e-9)


@pytest.mark.parametrize("flips", [(0,), (3,), (0, 1, 5, 6, 40), (300,)])
def test_opposite_headings_change_nothing(flips: tuple[int, ...]) -> None:
    poses = arc(3.0, 2.0, 300)
    np.testing.assert_allclose(integrate(poses, 0.3, flips), integrate(poses), atol=1e-9)


def test_without_a_compass_the_wheels_errors_add_up() -> None:
    heading = CompassHeading(STUCK, uses_compass=False)
    heading.begin(0.0)
    for _ in range(100):
        heading.update(0.009, 0.0)
    assert heading.heading == pytest.approx(0.9)
    assert not heading.is_stuck


def test_a_compass_that_stands_still_is_not_believed_until_it_moves_again() -> None:
    heading = CompassHeading(STUCK, uses_compass=True)
    heading.begin(0.4)
    heading.update(0.2, 0.6)
    for _ in range(50):
        heading.update(0.02, 0.6)
    assert heading.is_stuck
    assert heading.heading == pytest.approx(0.2 + 50 * 0.02)
    heading.update(0.0, 1.62)
    assert not heading.is_stuck
    assert heading.heading == pytest.approx(1.22)


def test_a_robot_that_stands_still_has_no_broken_compass() -> None:
    heading = CompassHeading(STUCK, uses_compass=True)
    heading.begin(0.4)
    for _ in range(1000):
        heading.update(0.0, 0.4)
    assert not heading.is_stuck and heading.heading == 0.0


def test_the_constant_is_the_papers() -> None:
    degrees = np.linspace(-180.0, 180.0, 37)
    expected = 4.009e-5 * (180 - degrees) * (180 + degrees) * degrees
    found = np.degrees([ant_sine(math.radians(each)) for each in degrees])
    np.testing.assert_allclose(found, expected, rtol=3e-4, atol=1e-9)
    assert ant_cosine(0.0) == 1.0
    assert ant_cosine(math.pi / 2) == pytest.approx(0.0, abs=1e-12)
    assert ant_cosine(-math.pi) == pytest.approx(-1.0)


def two_legs(turn: float, first: float = 10.0, second: float = 5.0, step: float = 0.01):
    """The ant's home vector after two legs with a turn (rad) between them."""
    vector = HomeVector(0.0, 0.0)
    for direction, length in ((0.0, first), (turn, second)):
        for _ in range(round(length / step)):
            vector = approximate_step(vector, direction, step)
    return vector


@pytest.mark.parametrize("degrees", [-150, -90, -30, 0, 30, 60, 90, 120, 150, 170])
def test_two_legs_give_the_solution_of_the_differential_equation(degrees: int) -> None:
    """The oracle: dφ/ds = g(δ) / l, dl/ds = f(δ), with other code and another integrator."""
    turn = math.radians(degrees)

    def change(_: float, state: np.ndarray) -> tuple[float, float]:
        delta = math.degrees(turn - state[0])
        sine = 4.009e-5 * (180 - delta) * (180 + delta) * delta
        return math.radians(sine) / state[1], 1 - abs(delta) / 90

    solved = solve_ivp(change, (0, 5), (0.0, 10.0), rtol=1e-9, atol=1e-9).y[:, -1]
    found = two_legs(turn)
    assert found.direction == pytest.approx(solved[0], abs=2e-3)
    assert found.length == pytest.approx(solved[1], abs=2e-2)


@pytest.mark.parametrize("degrees", [30, 60, 90, 120, 150])
def test_the_error_leads_the_ant_back_to_its_first_leg(degrees: int) -> None:
    """As the thesis quotes: "closer to the first and mostly straight leg"."""
    turn = math.radians(degrees)
    true = np.array((10 + 5 * math.cos(turn), 5 * math.sin(turn)))
    error = two_legs(turn).direction - math.atan2(true[1], true[0])
    assert error > math.radians(2.0)  # It heads home across the first leg, before the nest.
    assert two_legs(-turn).direction == pytest.approx(-two_legs(turn).direction)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(-3.1, 3.1), st.floats(0.0, 2.0)), max_size=40))
def test_the_approximate_vector_is_finite_whatever_the_way(
    way: list[tuple[float, float]],
) -> None:
    vector = HomeVector(0.0, 0.0)
    for direction, distance in way:
        vector = approximate_step(vector, direction, distance)
        assert math.isfinite(vector.direction) and 0.0 <= vector.length < math.inf
