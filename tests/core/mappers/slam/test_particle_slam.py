"""grid-slam and gmapping: a loop whose truth is known, proposals, and wrong readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers.mapper import TRAVEL
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.slam.beam_model import beam_tables
from albot_core.mappers.slam.gmapping import GMappingConfig, Search, draw_poses
from albot_core.mappers.slam.grid_slam import GridSlamConfig, move_and_weigh
from albot_core.mappers.slam.particles import Particles
from albot_core.maps.layers import OccupancyGridLayer, ParticlesLayer
from albot_core.matching.scan_points import matched_points
from tests.core.mappers.slam.rooms import reading_from, scan_from
from tests.core.mappers.slam.test_scan_matching import drive, lap

NAMES = ("grid-slam", "gmapping")
ERRORLESS = dict.fromkeys(("drift", "drift_by_turn", "twist", "twist_by_way"), 1e-9)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("turn_error", "scale"), [(0.0, 0.0), (np.radians(25), 0.1)])
def test_it_follows_the_robot_whatever_the_odometer_says(name, turn_error, scale):
    mapper, poses = make_mapper(name, config={"particles": 30}), lap()
    believed = drive(mapper, poses, np.random.default_rng(0), turn_error, scale)
    true = relative(poses[0], poses)
    assert np.hypot(*(believed - true)[:, :2].T).max() < 0.15
    assert np.hypot(*(mapper.corrected_poses() - true)[:, :2].T).max() < 0.15
    layer = mapper.snapshot().layer(OccupancyGridLayer)
    assert len(layer.centres(0.65)) > 300
    spread = mapper.snapshot().layer(ParticlesLayer)
    assert spread.poses.shape == (30, 3)
    assert spread.weights.sum() == pytest.approx(1.0)
    assert mapper.way_home[TRAVEL] < 1.0


@pytest.mark.parametrize("name", NAMES)
def test_other_random_numbers_are_another_run(name):
    poses, ways = lap()[:12], []
    for seed in (1, 1, 2):
        mapper = make_mapper(name, rng=np.random.default_rng(seed))
        drive(mapper, poses, np.random.default_rng(0), 0.0, 0.0)
        ways.append(mapper.corrected_poses())
    np.testing.assert_array_equal(ways[0], ways[1])
    assert (ways[0] != ways[2]).any()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("is_likelier", "survivors"), [(0.0, 8), (1e6, 1)])
def test_particles_are_resampled_once_few_are_likely(name, is_likelier, survivors):
    """By their effective number: one that is far likelier than the others replaces them all."""
    mapper = make_mapper(name, config={"particles": 8, **ERRORLESS})
    poses = lap()[:6]
    drive(mapper, poses[:3], np.random.default_rng(0), 0.0, 0.0)
    mapper._particles.log_weights[5] += is_likelier
    mapper._particles._way[0][:, 0] = np.arange(8)  # By which each path is known.
    for pose, motion in zip(poses[3:], relative(poses[2:-1], poses[3:]), strict=True):
        mapper.update(reading_from(pose, motion))
    assert len({mapper._particles.trajectory(k)[0, 0] for k in range(8)}) == survivors


def _drawn(points: np.ndarray, deviations: np.ndarray, off: np.ndarray, **changed: float):
    """A thousand poses that GMapping draws around (0.5, 0.2, 0.3) in a room it has seen."""
    config = replace(GMappingConfig(particles=1000), **changed)
    true, particles = np.array((0.5, 0.2, 0.3)), Particles(1000, config.grid)
    for pose in (np.zeros(3), np.array((0.3, 0.1, 0.2))):
        # All maps are the same as long as nobody remembers.
        particles.poses[:] = pose
        particles.integrate(scan_from(pose))
    particles.poses[:] = 0.0
    tables = beam_tables(config.beams, config.grid.cell)
    search = Search(0.05, 0.05, 5, config.samples, 0.02, np.radians(0.5), config.least_score)
    noise = np.random.default_rng(0).standard_normal((1000, 3))
    weights = np.zeros(1000)
    draw_poses(
        particles.pool.arrays, particles.index, particles.corner, config.grid.cell, points,
        true + off, deviations, noise, tables, search, particles.poses, weights,
    )  # fmt: skip
    return particles.poses, weights, true


def test_particles_move_by_the_motion_and_err_along_the_robots_own_axes():
    config = GridSlamConfig(particles=3)
    particles = Particles(3, config.grid)
    particles.integrate(scan_from(np.zeros(3)))
    particles.poses[:] = begun = np.array(((0.0, 0.0, 0.0), (0.1, -0.2, 1.2), (-0.1, 0.0, -2.5)))
    points, _ = matched_points(scan_from(np.zeros(3)), 12.0, 0.1)
    motion, errors = (
        np.array((0.3, 0.1, 0.4)),
        np.array(((0.2, 0, 0), (0, 0.1, 0), (0.1, 0.2, 0.3))),
    )
    weights = np.zeros(3)
    _, logs = beam_tables(config.beams, config.grid.cell)
    move_and_weigh(
        particles.pool.arrays, particles.index, particles.corner, config.grid.cell, points,
        motion, errors, logs, particles.poses, weights,
    )  # fmt: skip
    expected = compose(compose(begun, motion), errors)
    np.testing.assert_allclose(particles.poses, expected, atol=1e-12)
    assert np.isfinite(weights).all()


def test_poses_are_drawn_where_the_scan_says():
    """The odometer is off by 8 cm and 3°, and knows it."""
    points, _ = matched_points(scan_from(np.array((0.5, 0.2, 0.3))), 12.0, 0.1)
    deviations = np.array((0.2, 0.2, 0.1))
    poses, weights, true = _drawn(points, deviations, np.array((0.08, -0.05, np.radians(3))))
    # To a cell: two scans leave the map no finer.
    np.testing.assert_allclose(poses.mean(axis=0), true, atol=0.05)
    assert (poses.std(axis=0) < (0.05, 0.05, 0.02)).all()
    assert (poses.std(axis=0) > 1e-4).all()
    assert np.ptp(weights) < 1e-6  # All maps are the same, so are all weights.


def test_a_sure_odometer_is_not_overruled():
    points, _ = matched_points(scan_from(np.array((0.5, 0.2, 0.3))), 12.0, 0.1)
    unsure, sure = np.array((0.2, 0.2, 0.1)), np.array((0.01, 0.01, 0.005))
    off = np.array((0.0, 0.08, 0.02))
    by_scan, weights, true = _drawn(points, unsure, off)
    by_both, less_likely, _ = _drawn(points, sure, off)
    away = [np.hypot(*(poses.mean(axis=0) - true - off)[:2]) for poses in (by_scan, by_both)]
    assert away[1] < away[0] - 0.005
    assert (less_likely < weights).all()


def test_where_no_scan_matches_poses_are_drawn_by_the_motion_alone():
    """Lines 7 to 9 of the algorithm; the closed form of the normal distribution."""
    deviations = np.array((0.3, 0.1, 0.05))
    poses, weights, true = _drawn(np.empty((0, 2)), deviations, np.zeros(3))
    along = relative(true, poses)
    np.testing.assert_allclose(along.mean(axis=0), np.zeros(3), atol=4 * 0.3 / np.sqrt(1000))
    np.testing.assert_allclose(along.std(axis=0), deviations, rtol=0.1)
    assert (weights == 0).all()


@pytest.mark.parametrize(
    ("config", "wrong"),
    [
        (GMappingConfig, {"samples": 0}),
        (GMappingConfig, {"samples": 99}),
        (GMappingConfig, {"iterations": -1}),
        (GMappingConfig, {"iterations": 1_000_000_000}),
        (GMappingConfig, {"particles": 0}),
        (GMappingConfig, {"particles": 1_000_000_000}),
        (GridSlamConfig, {"particles": 1_000_000_000}),
        (GridSlamConfig, {"drift": 0.0}),
        (GridSlamConfig, {"resample_below": 1.5}),
    ],
)
def test_thresholds_out_of_range_are_refused(config, wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        config(**wrong)
