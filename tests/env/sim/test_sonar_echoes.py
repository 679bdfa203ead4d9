"""Corners and edges, noise, misses and cross-talk: closed forms and frequencies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import kstest

from albot_core.sensing.reading import SonarGeometry
from albot_env.sim.sonar import SONARS, SonarConfig
from albot_env.sim.sonar_kernels import SONAR_DRAWS
from tests.env.sim.test_sonar import heard, one_sonar, wall

LIMIT = math.radians(20)


def corner(opening: float, distance: float, turn: float = 0.0) -> np.ndarray:
    """Two walls of 0.2 m that meet ahead, `opening` on the sonar's side, turned about there."""
    walls = []
    for side in (1, -1):
        bearing = math.pi + side * opening / 2 + turn
        x, y = 0.2 * math.cos(bearing), 0.2 * math.sin(bearing)
        walls.append((distance, 0.0, distance + x, y))
    return np.array(walls)


def echo_of(walls: np.ndarray, **reaches: float) -> float:
    return float(heard(one_sonar(specular_limit=LIMIT, **reaches), walls)[0])


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.3])
def test_a_right_angle_sends_the_sound_back_from_wherever_it_comes(turn: float) -> None:
    walls = corner(math.pi / 2, 2.0, turn)
    assert math.isinf(echo_of(walls))
    assert echo_of(walls, corner_reach=4.0) == pytest.approx(2.0)
    assert math.isinf(echo_of(walls, corner_reach=1.9, edge_reach=1.5))


@pytest.mark.parametrize(("off", "heard_of"), [(0.99, True), (-0.99, True), (1.01, False)])
def test_a_corner_may_be_off_a_right_angle_by_the_specular_limit(
    off: float, heard_of: bool
) -> None:
    found = echo_of(corner(math.pi / 2 + off * LIMIT, 2.0), corner_reach=4.0)
    assert math.isfinite(found) == heard_of


def test_a_wall_that_ends_at_another_makes_corners() -> None:
    """One wall runs on, the other ends there; none of both is hit near its perpendicular."""
    along = np.array([[1.0, -1.0, 3.0, 1.0], [2.0, 0.0, 1.0, 1.0]])
    assert echo_of(along, corner_reach=4.0) == pytest.approx(2.0)


def test_edges_are_heard_from_near() -> None:
    convex = corner(1.5 * math.pi, 0.8)
    end = np.array([[0.8, 0.0, 2.0, 0.3]])
    for walls in (convex, end):
        assert math.isinf(echo_of(walls, corner_reach=4.0))
        assert echo_of(walls, edge_reach=1.0) == pytest.approx(0.8)
        assert math.isinf(echo_of(walls, edge_reach=0.7))


def test_a_wall_that_goes_straight_on_has_no_edge() -> None:
    """Two walls in line, hit too aslant, and another that leaves behind them."""
    line = np.array([[0.5, -0.5, 1.0, 0.0], [1.0, 0.0, 1.5, 0.5], [1.0, 0.0, 2.0, -1.0]])
    assert math.isinf(echo_of(line, corner_reach=4.0, edge_reach=4.0))


def test_a_corner_behind_a_wall_is_not_heard() -> None:
    screen = np.array([[0.4, -0.3, 1.6, 0.3]])  # aslant: hides, and does not echo
    walls = np.vstack((corner(math.pi / 2, 2.0), screen))
    assert math.isinf(echo_of(walls, corner_reach=4.0))


def test_in_a_box_the_nearer_of_wall_and_corner_is_heard() -> None:
    """A room of 4 m: towards a corner the wall, which is nearer, is hit too aslant."""
    corners = np.array(((-2, -2), (2, -2), (2, 2), (-2, 2)), float)
    walls = np.hstack((corners, np.roll(corners, -1, axis=0)))
    config = one_sonar(specular_limit=LIMIT, corner_reach=4.0)
    assert heard(config, walls, (0.0, 0.0, math.pi / 4))[0] == pytest.approx(2 * math.sqrt(2))
    assert heard(config, walls, (0.0, 0.0, 0.1))[0] == pytest.approx(2.0)


def many(count: int, distance: float, **errors: float) -> np.ndarray:
    """So many echoes of a wall ahead, one a reading."""
    config = one_sonar(**errors)
    return np.concatenate(
        [heard(config, wall(distance), key=9, place=k * SONAR_DRAWS) for k in range(count)]
    )


def test_noise_is_normal_and_grows_with_the_range() -> None:
    for distance in (0.5, 3.0):
        echoes = many(4000, distance, range_noise=0.01, proportional_noise=0.01)
        deviation = math.hypot(0.01, 0.01 * distance)
        assert kstest((echoes - distance) / deviation, "norm").pvalue > 0.01


def test_echoes_are_missed_at_the_rate_asked_for() -> None:
    echoes = many(5000, 2.0, dropout=0.04)
    assert np.isinf(echoes).mean() == pytest.approx(0.04, rel=0.25)
    assert np.ptp(echoes[np.isfinite(echoes)]) < 1e-12


def pair(crosstalk: float) -> SonarConfig:
    """Two sonars a metre apart that look ahead; the left one is number 1."""
    geometry = SonarGeometry(bearings=(0.0, 0.0), places=((0.0, -0.5), (0.0, 0.5)))
    return SonarConfig(geometry=geometry, crosstalk=crosstalk)


def test_crosstalk_is_half_the_way_of_the_neighbour_s_echo() -> None:
    """The right sonar faces a wall at 1 m, the left one nothing: it hears the other's pulse."""
    walls = np.array([[1.0, -0.8, 1.0, -0.3]])
    ghost = (1.0 + math.hypot(1.0, 1.0)) / 2
    config, silent, ghosts = pair(0.4), 0, 0
    for reading in range(4000):
        right, left = heard(config, walls, key=2, place=reading * 2 * SONAR_DRAWS)
        assert right == pytest.approx(1.0)
        silent += math.isinf(left)
        ghosts += left == pytest.approx(ghost)
    assert silent + ghosts == 4000
    # Half of the pulses would be those of a neighbour that there is not.
    assert ghosts / 4000 == pytest.approx(0.2, abs=0.025)


def test_the_first_of_both_echoes_is_reported() -> None:
    walls = np.array([[1.0, -0.8, 1.0, -0.3], [2.0, 0.3, 2.0, 0.8]])
    ghost = (1.0 + math.hypot(1.0, 1.0)) / 2
    found = {
        round(float(heard(pair(0.5), walls, key=2, place=2 * reading)[1]), 6)
        for reading in range(200)
    }
    assert found == {round(ghost, 6), 2.0}
    walls[1, [0, 2]] = 0.9
    for reading in range(200):
        assert heard(pair(0.5), walls, key=2, place=2 * reading)[1] == pytest.approx(0.9)


def test_without_crosstalk_nobody_hears_anybody() -> None:
    walls = np.array([[1.0, -0.8, 1.0, -0.3]])
    for reading in range(200):
        assert math.isinf(heard(pair(0.0), walls, place=2 * reading)[1])


@pytest.mark.parametrize("name", SONARS)
def test_the_presets_hear_a_room(name: str) -> None:
    corners = np.array(((-1.5, -1), (2, -1), (2, 1.2), (-1.5, 1.2)), float)
    walls = np.hstack((corners, np.roll(corners, -1, axis=0)))
    echoes = np.array(
        [heard(SONARS[name], walls, (0, 0, 0.1), place=8 * k * SONAR_DRAWS) for k in range(200)]
    )
    assert ((echoes >= 0.1) & ((echoes < 4.0) | np.isinf(echoes))).all()
    assert np.isfinite(echoes).mean() > {"ideal": 0.999, "pioneer": 0.8, "poor": 0.4}[name]
    again = heard(SONARS[name], walls, (0, 0, 0.1), place=0)
    assert np.array_equal(echoes[0], again)
