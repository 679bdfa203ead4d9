"""Map entropy: closed forms, and that smearing and doubling raise it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.evaluation.crispness import SMEAR, laid_points, mean_map_entropy
from albot_core.geometry.poses import transform_points
from albot_core.sensing.reading import LaserGeometry, LaserScan

RNG = np.random.default_rng(5)
WALL = np.stack((np.linspace(0, 8, 1600), np.zeros(1600)), axis=-1)


def test_a_normal_cloud_has_the_entropy_of_the_normal_distribution() -> None:
    spread = 0.02
    cloud = RNG.normal(0.0, spread, (3000, 2))
    expected = np.log(2 * np.pi * np.e * (spread**2 + SMEAR**2))
    assert mean_map_entropy(cloud, radius=1.0) == pytest.approx(expected, abs=0.05)


def test_a_straight_wall_is_a_box_of_the_radius_and_the_smear() -> None:
    # Neighbours lie evenly on 0.6 m, but for those at the wall's two ends.
    expected = np.log(2 * np.pi * np.e * np.sqrt(0.3**2 / 3 + SMEAR**2) * SMEAR)
    assert mean_map_entropy(WALL, radius=0.3) == pytest.approx(expected, abs=0.05)


def test_smeared_and_doubled_walls_are_less_crisp() -> None:
    once = mean_map_entropy(WALL)
    smeared = mean_map_entropy(WALL + RNG.normal(0.0, 0.05, WALL.shape))
    doubled = mean_map_entropy(np.concatenate((WALL, WALL + np.array([0.0, 0.2]))))
    assert once is not None
    assert smeared is not None
    assert doubled is not None
    assert smeared > once + 0.5
    assert doubled > once + 1.0


@settings(deadline=None, max_examples=20)
@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)).map(np.array))
def test_moving_the_map_changes_nothing(motion: np.ndarray) -> None:
    cloud = np.random.default_rng(0).normal(0.0, 0.3, (500, 2))
    moved = mean_map_entropy(transform_points(motion, cloud))
    assert moved == pytest.approx(mean_map_entropy(cloud), abs=1e-6)


def test_nothing_and_loneliness_have_no_entropy() -> None:
    assert mean_map_entropy(np.empty((0, 2))) is None
    assert mean_map_entropy(np.arange(20.0).reshape(-1, 2) * 10) is None


def test_the_radius_must_be_a_length() -> None:
    with pytest.raises(InputError, match="radius"):
        mean_map_entropy(WALL, radius=float("nan"))


def test_scans_are_laid_where_the_poses_say_and_thinned() -> None:
    geometry = LaserGeometry(beams=2, first_bearing=0.0, spacing=np.pi / 2)
    scan = LaserScan(ranges=np.array([1.0, np.inf]), geometry=geometry)
    poses = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, np.pi / 2]])
    assert np.allclose(laid_points([scan, scan], poses), [[1.0, 0.0], [5.0, 1.0]])
    assert len(laid_points([scan] * 10, np.zeros((10, 3)), most=4)) <= 4
    assert laid_points([], np.empty((0, 3))).shape == (0, 2)
