from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, relative, transform_segments
from albot_core.mappers.odometry.batch import OdometryConfig
from albot_core.mappers.odometry.mapper import OdometryMapper
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from albot_core.sensing.view import construct_view

RNG = np.random.default_rng(0)

LASER = LaserGeometry()


def wall_ahead(distance: float) -> LaserScan:
    """The scan of an endless wall across, so far ahead (m)."""
    ranges = distance / np.maximum(np.cos(LASER.bearings), 1e-6)
    return LaserScan(ranges=np.where(ranges < 10, ranges, np.inf), geometry=LASER)


def reading(motion: tuple[float, float, float], distance: float = 4.0) -> Reading:
    return Reading(stamp=0.0, motion=np.array(motion, np.float64), laser=wall_ahead(distance))


def random_readings(seed: int, count: int) -> list[Reading]:
    rng = np.random.default_rng(seed)
    return [
        Reading(
            stamp=float(k),
            motion=rng.normal((0.1, 0, 0), (0.1, 0.02, 0.2)),
            laser=LaserScan(ranges=rng.uniform(1, 9, LASER.beams), geometry=LASER),
        )
        for k in range(count)
    ]


def test_the_first_reading_is_where_the_map_begins():
    mapper = OdometryMapper()
    assert mapper.estimate.map_version == 0
    assert mapper.snapshot().segments.shape == (0, 4)
    assert mapper.update(reading((5.0, 5.0, 1.0)))
    np.testing.assert_array_equal(mapper.estimate.pose, np.zeros(3))
    np.testing.assert_array_equal(mapper.estimate.home_from_robot, np.zeros(3))
    assert mapper.estimate.map_version == 1
    assert len(mapper.snapshot().segments) > 0
    np.testing.assert_allclose(mapper.snapshot().segments[:, [0, 2]], 4.0, atol=1e-9)


def test_a_wall_seen_from_two_places_lies_in_one():
    mapper = OdometryMapper()
    mapper.update(reading((0, 0, 0), 4.0))
    before = len(mapper.snapshot().segments)
    assert mapper.update(reading((1.5, 0, 0), 2.5))
    assert len(mapper.snapshot().segments) > before
    np.testing.assert_allclose(mapper.snapshot().segments[:, [0, 2]], 4.0, atol=1e-9)


def test_a_wrong_odometer_draws_the_wall_twice():
    mapper = OdometryMapper()
    mapper.update(reading((0, 0, 0), 4.0))
    mapper.update(reading((1.0, 0, 0), 2.5))
    xs = np.unique(np.round(mapper.snapshot().segments[:, [0, 2]], 6))
    assert xs.tolist() == [3.5, 4.0]


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10**6))
def test_pose_and_home_are_the_sum_of_the_steps(seed):
    mapper = OdometryMapper()
    readings = random_readings(seed, 12)
    expected = np.zeros(3)
    for k, step in enumerate(readings):
        mapper.update(step)
        if k:
            expected = compose(expected, step.motion)
        np.testing.assert_allclose(relative(expected, mapper.estimate.pose), 0, atol=1e-9)
        np.testing.assert_allclose(
            relative(inverse(expected), mapper.estimate.home_from_robot), 0, atol=1e-9
        )


def test_every_view_lies_where_it_was_seen():
    mapper = OdometryMapper(OdometryConfig(step=0.0, turn=0.0))
    laid, pose = [], np.zeros(3)
    for k, step in enumerate(random_readings(3, 20)):
        assert mapper.update(step)
        pose = compose(pose, step.motion) if k else pose
        laid.append(transform_segments(pose, construct_view(step.laser).surfaces))
    np.testing.assert_allclose(mapper.snapshot().segments, np.concatenate(laid))
    assert mapper.estimate.map_version == 20


def test_a_robot_that_stands_lays_no_view_twice():
    mapper = OdometryMapper(OdometryConfig(step=0.2, turn=np.deg2rad(20)))
    mapper.update(reading((0, 0, 0)))
    count = len(mapper.snapshot().segments)
    for _ in range(3):
        assert not mapper.update(reading((0.06, 0, 0)))
    assert len(mapper.snapshot().segments) == count
    assert mapper.update(reading((0.06, 0, 0)))
    assert not mapper.update(reading((0, 0, np.deg2rad(15))))
    assert mapper.update(reading((0, 0, np.deg2rad(15))))
    assert mapper.estimate.map_version == 3


def test_the_map_is_bounded_and_keeps_the_newest():
    plain = OdometryMapper(OdometryConfig(step=0.0, turn=0.0))
    small = OdometryMapper(OdometryConfig(step=0.0, turn=0.0, capacity=30))
    for step in random_readings(1, 60):
        plain.update(step)
        small.update(step)
        np.testing.assert_array_equal(small.snapshot().segments, plain.snapshot().segments[-30:])
    assert len(plain.snapshot().segments) > 100
    assert len(small._robot._stores[0]) < 200


def test_what_is_given_out_is_no_part_of_the_memory():
    mapper = OdometryMapper()
    mapper.update(reading((0, 0, 0)))
    kept = mapper.snapshot().segments
    with pytest.raises(ValueError, match="read-only"):
        mapper.snapshot().segments[:] = 0
    mapper.estimate.pose[:] = 7
    for array in mapper.state().values():
        array[...] = 9
    np.testing.assert_array_equal(mapper.snapshot().segments, kept)
    np.testing.assert_array_equal(mapper.estimate.pose, np.zeros(3))


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10**6), split=st.integers(0, 30))
def test_a_restored_mapper_continues_as_if_never_stopped(seed, split):
    config = OdometryConfig(capacity=40)
    straight, resumed = OdometryMapper(config), OdometryMapper(config)
    readings = random_readings(seed, 30)
    for step in readings[:split]:
        straight.update(step)
    resumed.restore(straight.state())
    for step in readings[split:]:
        assert straight.update(step) == resumed.update(step)
    for name, array in straight.state().items():
        np.testing.assert_array_equal(array, resumed.state()[name])


def test_reset_forgets_everything():
    mapper, fresh = OdometryMapper(), OdometryMapper()
    for step in random_readings(2, 5):
        mapper.update(step)
    mapper.reset(RNG)
    for name, array in fresh.state().items():
        np.testing.assert_array_equal(array, mapper.state()[name])


@pytest.mark.parametrize(
    "fields", [{"step": -0.1}, {"turn": np.nan}, {"step": np.inf}, {"capacity": 0}]
)
def test_a_wrong_configuration_is_refused(fields):
    with pytest.raises(InputError, match=f"OdometryConfig.{next(iter(fields))}"):
        OdometryConfig(**fields)
