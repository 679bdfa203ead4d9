"""The likelihood field against its definition."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points
from albot_core.matching.likelihood_field import CERTAIN, FieldConfig, LikelihoodField

CONFIG = FieldConfig(cell=0.1, sigma=0.12, half=3.0)


def filled(points: np.ndarray, pose: np.ndarray, centre: np.ndarray) -> LikelihoodField:
    field = LikelihoodField(CONFIG)
    field.clear(centre)
    field.add(pose, points)
    return field


def test_the_finest_level_is_the_gaussian_of_the_distance_to_the_nearest_point():
    rng = np.random.default_rng(1)
    pose, points = np.array((0.7, -0.4, 2.0)), rng.uniform(-1.2, 1.2, (40, 2))
    field = filled(points, pose, np.array((0.5, -0.3)))
    placed = transform_points(pose, points)
    # Points are placed to a quarter of a cell.
    placed = (np.floor((placed - field.corner) / 0.025) + 0.5) * 0.025 + field.corner
    rows, columns = np.indices(field.finest.shape)
    middles = field.corner + (np.stack((columns, rows), axis=-1) + 0.5) * CONFIG.cell
    distances = np.hypot(*np.moveaxis(middles[:, :, None] - placed, -1, 0)).min(axis=-1)
    expected = CERTAIN * np.exp(-0.5 * (distances / CONFIG.sigma) ** 2)
    # A stamp ends at three standard deviations.
    near = distances < 3 * CONFIG.sigma
    np.testing.assert_allclose(field.finest[near], expected[near], atol=0.51)
    assert field.finest[distances > 6 * CONFIG.sigma].max() == 0


def test_each_level_bounds_all_cells_that_a_block_of_it_covers():
    rng = np.random.default_rng(2)
    field = filled(rng.uniform(-2, 2, (25, 2)), np.zeros(3), np.zeros(2))
    levels, side = field.levels, CONFIG.side
    for level in range(CONFIG.levels):
        block = 1 << level
        windows = np.lib.stride_tricks.sliding_window_view(field.finest, (block, block))
        np.testing.assert_array_equal(
            levels[level, : side - block + 1, : side - block + 1], windows.max(axis=(2, 3))
        )


def test_adding_brings_all_levels_up_to_date_and_clearing_forgets():
    field = filled(np.array(((0.0, 0.0),)), np.zeros(3), np.zeros(2))
    assert field.levels[3].max() > 200
    field.add(np.zeros(3), np.array(((1.0, 1.0),)))
    assert field.levels[3, 38, 38] == field.finest[38:46, 38:46].max() > 200
    field.clear(np.array((10.0, 0.0)))
    assert field.levels.max() == 0
    np.testing.assert_allclose(field.corner, (7.0, -3.0))


def test_points_outside_are_left_out():
    field = filled(np.array(((1e9, 0.0), (0.0, -1e9), (2.95, 0.0))), np.zeros(3), np.zeros(2))
    assert field.levels.max() == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"cell": 0.0},
        {"sigma": -1.0},
        {"levels": 0},
        {"levels": 9},
        {"levels": 2.5},
        {"half": 1e6},
    ],
)
def test_a_config_that_makes_no_field_is_refused(wrong):
    with pytest.raises(InputError, match=f"FieldConfig.{next(iter(wrong))}"):
        FieldConfig(**wrong)
