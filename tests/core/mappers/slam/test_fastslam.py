"""FastSLAM with landmarks: a loop whose truth is known, limits, and readings that are not right."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_points
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.slam.fastslam import FastSlam
from albot_core.mappers.slam.fastslam_config import FastSlamConfig
from albot_core.mappers.slam.grid import LogOddsGrid
from albot_core.maps.layers import ParticlesLayer
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from tests.core.mappers.slam.rooms import CORRIDOR, LASER, reading_from
from tests.core.mappers.slam.test_line_ends import CORNERS
from tests.core.mappers.slam.test_scan_matching import drive, lap

ODOMETER = {
    "motion": "odometer",
    "drift": 0.1,
    "drift_by_turn": 0.1,
    "twist": 0.1,
    "twist_by_way": 0.05,
}
"""Montemerlo's way: the odometer moves the particles, which spread as it errs."""


def worst(mapper: FastSlam, believed: np.ndarray, poses: np.ndarray) -> tuple[float, float]:
    """Largest distance from the truth online, and of the path as it is believed at the end (m)."""
    true = relative(poses[0], poses)
    ways = believed, mapper.corrected_poses()
    online, final = (float(np.hypot(*(way - true)[:, :2].T).max()) for way in ways)
    return online, final


@pytest.mark.parametrize(("turn_error", "scale"), [(0.0, 0.0), (np.radians(25), 0.1)])
@pytest.mark.parametrize("proposal", ["landmarks", "motion"])
def test_it_follows_the_robot_whatever_the_odometer_says(proposal, turn_error, scale):
    mapper, poses = make_mapper("fastslam", config={"proposal": proposal}), lap()
    believed = drive(mapper, poses, np.random.default_rng(0), turn_error, scale)
    assert max(worst(mapper, believed, poses)) < 0.15
    points = transform_points(poses[0], mapper.landmarks.points)
    away = np.hypot(*(points[:, None] - CORNERS).transpose(2, 0, 1))
    assert (away.min(axis=0) < 0.1).all()  # Each corner is on the map, at its place.
    assert (np.linalg.eigvalsh(mapper.landmarks.covariances) > 0.0).all()


def test_landmarks_mend_an_odometer_that_errs():
    """Two laps of the room without scan matching; an odometer alone is far off at the end."""
    poses = np.concatenate((lap(), lap()[1:]))
    rng = np.random.default_rng(1)
    mapper = make_mapper("fastslam", config=ODOMETER, rng=np.random.default_rng(0))
    alone, believed = np.zeros(3), []
    for k, pose in enumerate(poses):
        motion = np.zeros(3) if k == 0 else relative(poses[k - 1], pose)
        motion[2] += 0.03 * rng.standard_normal() if k else 0.0
        alone = compose(alone, motion)
        mapper.update(reading_from(pose, motion))
        believed.append(mapper.estimate.pose)
    true = relative(poses[0], poses)
    assert np.hypot(*(alone - true[-1])[:2]) > 0.5
    assert np.hypot(*(believed[-1] - true[-1])[:2]) < 0.2
    assert max(worst(mapper, np.array(believed), poses)) < 0.4


def test_without_landmarks_it_follows_the_motion_and_no_particle_is_preferred():
    mapper = make_mapper("fastslam", config={**ODOMETER, "particles": 10})
    for k in range(8):
        motion = np.array((0.6 if k else 0.0, 0.0, 0.0))
        mapper.update(reading_from(np.array((0.6 * k, 0.0, 0.0)), motion, CORRIDOR))
    spread = mapper.snapshot().layer(ParticlesLayer)
    np.testing.assert_allclose(spread.weights, 0.1)
    np.testing.assert_allclose(spread.poses.mean(axis=0), (4.2, 0.0, 0.0), atol=0.4)
    assert len(mapper.landmarks.points) == 0
    assert mapper.landmarks.covariances.shape == (0, 2, 2)


def test_weights_are_numbers_when_nothing_fits_any_particle():
    """The robot is set down elsewhere again and again; every observation contradicts every map."""
    mapper, rng = make_mapper("fastslam", config={**ODOMETER, "particles": 10}), lap()
    for k in range(30):
        pose = rng[(17 * k) % len(rng)]
        motion = np.array((0.6, 0.0, 0.0))
        mapper.update(reading_from(pose, motion))
        weights = mapper.snapshot().layer(ParticlesLayer).weights
        assert np.isfinite(weights).all()
        assert weights.sum() == pytest.approx(1.0)
        assert np.isfinite(mapper.estimate.pose).all()
    assert np.isfinite(mapper.landmarks.points).all()
    assert all(np.isfinite(array).all() for array in mapper.state().values() if array.size < 10**4)


def test_the_largest_number_of_landmarks_is_kept_and_told():
    mapper, poses = make_mapper("fastslam", config={"landmarks": 3, "particles": 10}), lap()
    assert mapper.refused == 0
    believed = drive(mapper, poses, np.random.default_rng(0), 0.0, 0.0)
    assert len(mapper.landmarks.points) == 3
    assert mapper.refused > 0
    assert max(worst(mapper, believed, poses)) < 0.3
    twin = make_mapper("fastslam", config={"landmarks": 3, "particles": 10})
    twin.restore(mapper.state())
    assert twin.refused == mapper.refused


def test_each_particles_grid_is_that_of_its_own_path():
    """However the common beginning is drawn, the grid is that of all scans along the path."""
    config = {**ODOMETER, "particles": 6, "proposal": "motion"}  # Resampled often.
    mapper, poses = make_mapper("fastslam", config=config), lap()
    rng, looked = np.random.default_rng(3), 0
    for k, pose in enumerate(poses[:40]):
        motion = np.zeros(3) if k == 0 else relative(poses[k - 1], pose)
        mapper.update(reading_from(pose, motion + 0.02 * rng.standard_normal(3)))
        particles = mapper._particles
        if k % 7:
            continue
        for particle in range(particles.count):
            grid = LogOddsGrid(mapper.config.grid)
            for at, scan in zip(particles.trajectory(particle), particles.scans, strict=True):
                grid.integrate(at, scan)
            drawn, wanted = particles.grid(particle).layer(), grid.layer()
            for most in (0.35, 0.65):
                np.testing.assert_array_equal(drawn.centres(most), wanted.centres(most))
            looked += 1
    assert looked == 36
    assert particles._common_length > 0
    used = particles._common.pool.used
    particles.grid(0)
    assert particles._common.pool.used <= used + 20  # Grids that were drawn before are released.


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("landmarks.counts", lambda a: a + 1, "add up to"),
        ("landmarks.rows", lambda a: -a, "positive definite"),
        ("landmarks.rows", lambda a: a * np.nan, "finite"),
        ("landmarks.refused", lambda a: a - 1, "from 0"),
        ("scans.ranges", lambda a: a[:, :10], "laser"),
        ("scans.ranges", lambda a: a[1:], "shape"),
        ("laser", lambda a: a * 0, "laser"),
        ("particles.poses", lambda a: a[:, :3], "shape"),
    ],
)
def test_a_damaged_state_is_refused(name, damage, message):
    mapper = make_mapper("fastslam", config={"particles": 5})
    drive(mapper, lap()[:8], np.random.default_rng(0), 0.0, 0.0)
    state = mapper.state()
    state[name] = np.asarray(damage(state[name]), state[name].dtype)
    if name == "scans.ranges" and message == "laser":
        state["laser"] = state["laser"] * np.array((1, 99, 1, 1, 1, 1))
    with pytest.raises(InputError, match=message):
        make_mapper("fastslam", config={"particles": 5}).restore(state)


def test_a_state_with_more_landmarks_than_the_config_allows_is_refused():
    mapper = make_mapper("fastslam", config={"particles": 5})
    drive(mapper, lap()[:8], np.random.default_rng(0), 0.0, 0.0)
    small = make_mapper("fastslam", config={"particles": 5, "landmarks": 1})
    with pytest.raises(InputError, match=r"landmarks\.counts: expected at most 1 each"):
        small.restore(mapper.state())


def test_another_laser_during_a_run_is_refused():
    mapper = make_mapper("fastslam", config={"particles": 5})
    mapper.update(reading_from(lap()[0], np.zeros(3)))
    other = LaserGeometry(beams=90)
    scan = LaserScan(ranges=np.full(90, 3.0), geometry=other)
    with pytest.raises(InputError, match="the same laser at each reading"):
        mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=scan))
    mapper.update(reading_from(lap()[0], np.zeros(3), laser=LASER))


@pytest.mark.parametrize(
    "wrong",
    [{"landmarks": 0}, {"landmarks": 10**6}, {"gate": 0.0}, {"new_landmark": 0.0}, {"step": -1.0}],
)
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        FastSlamConfig(**wrong)


@pytest.mark.parametrize(("name", "known"), [("motion", "matched"), ("proposal", "landmarks")])
def test_a_choice_that_there_is_not_is_refused(name, known):
    with pytest.raises(InputError, match=known):
        make_mapper("fastslam", config={name: "nothing"})
