"""The comparison of a scan with a map, against a slow version that looks at every cell anew."""

from __future__ import annotations

import math

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.slam.beam_model import BeamConfig, beam_tables, cut_patch, weigh_points
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.tiles import log_odds_at
from albot_core.matching.scan_points import matched_points
from tests.core.mappers.slam.rooms import scan_from

CELL = 0.05
POSE = np.array((0.3, -0.4, 0.7))


def a_map() -> LogOddsGrid:
    """The room, seen from three places."""
    grid = LogOddsGrid(GridConfig(cell=CELL))
    for pose in (np.zeros(3), np.array((0.6, 0.3, 2.0)), np.array((-1.0, 0.5, -1.5))):
        grid.integrate(pose, scan_from(pose))
    return grid


def obvious_distance(grid: LogOddsGrid, eye: np.ndarray, x: float, y: float) -> float:
    """From a point to the middle of the nearest occupied cell around it that is seen from `eye`."""
    row, column = math.floor(y / CELL), math.floor(x / CELL)
    # The point is known to a quarter of a cell.
    y = (row + (math.floor((y / CELL - row) * 4) + 0.5) / 4) * CELL
    x = (column + (math.floor((x / CELL - column) * 4) + 0.5) / 4) * CELL
    nearest = math.inf
    for i in range(row - 1, row + 2):
        for j in range(column - 1, column + 2):
            middle = np.array((j + 0.5, i + 0.5)) * CELL
            towards = (eye - middle) / np.hypot(*(eye - middle))
            before = np.floor(1.41 * towards + 0.5).astype(int)
            arrays = grid.pool.arrays, grid.index, grid.corner
            if log_odds_at(*arrays, i, j) <= 0:
                continue
            if log_odds_at(*arrays, i + int(before[1]), j + int(before[0])) > 0:
                continue
            nearest = min(nearest, math.hypot(x - middle[0], y - middle[1]))
    return nearest


@pytest.mark.parametrize("off", [(0.003, -0.004, 0.001), (0.04, -0.03, 0.01), (-0.06, 0.1, -0.05)])
def test_each_beam_counts_by_the_nearest_occupied_cell(off):
    config, grid = BeamConfig(), a_map()
    scores, log_likelihoods = beam_tables(config, CELL)
    points, _ = matched_points(scan_from(POSE), 12.0, config.spacing)
    patch, low = cut_patch(grid.pool.arrays, grid.index, grid.corner, CELL, points, POSE)
    x, y, heading = (POSE + off).tolist()
    cos, sin = math.cos(heading), math.sin(heading)
    expected_score = expected_log = 0.0
    for px, py in points:
        nearest = obvious_distance(grid, POSE[:2], x + cos * px - sin * py, y + sin * px + cos * py)
        expected_score += math.exp(-(nearest**2) / config.sigma)
        fit = -(nearest**2) if math.isfinite(nearest) else config.null
        expected_log += fit / config.likelihood_sigma / config.gain
    score = weigh_points(patch, low, CELL, points, x, y, heading, scores)
    log = weigh_points(patch, low, CELL, points, x, y, heading, log_likelihoods)
    assert score == pytest.approx(expected_score, rel=1e-9)
    assert log == pytest.approx(expected_log, rel=1e-9)
    assert expected_score > 20


def test_a_scan_fits_best_where_it_was_taken():
    config, grid = BeamConfig(), a_map()
    scores, _ = beam_tables(config, CELL)
    points, _ = matched_points(scan_from(POSE), 12.0, config.spacing)
    patch, low = cut_patch(grid.pool.arrays, grid.index, grid.corner, CELL, points, POSE)

    def score(*off):
        return weigh_points(patch, low, CELL, points, *(POSE + off).tolist(), scores)

    assert score(0, 0, 0) > 0.9 * len(points)
    for off in ((0.2, 0, 0), (0, -0.2, 0), (0, 0, 0.1), (3.0, 3.0, 0.0)):
        assert score(*off) < 0.8 * score(0, 0, 0)


def test_a_scan_outside_all_that_is_known_is_unlikely_and_no_error():
    config, grid = BeamConfig(), LogOddsGrid(GridConfig(cell=CELL))
    _, log_likelihoods = beam_tables(config, CELL)
    points, _ = matched_points(scan_from(POSE), 12.0, config.spacing)
    patch, low = cut_patch(grid.pool.arrays, grid.index, grid.corner, CELL, points, POSE)
    log = weigh_points(patch, low, CELL, points, *POSE.tolist(), log_likelihoods)
    # In the authors' program, noHit is nullLikelihood / lsigma.
    assert log == pytest.approx(len(points) * -0.5 / 0.075 / 3.0)
    none = np.empty((0, 2))
    patch, low = cut_patch(grid.pool.arrays, grid.index, grid.corner, CELL, none, POSE)
    assert weigh_points(patch, low, CELL, none, *POSE.tolist(), log_likelihoods) == 0.0


@pytest.mark.parametrize("wrong", [{"sigma": 0.0}, {"gain": -1.0}, {"null": 0.0}, {"spacing": -1}])
def test_thresholds_out_of_range_are_refused(wrong):
    with pytest.raises(InputError, match="BeamConfig"):
        BeamConfig(**wrong)
