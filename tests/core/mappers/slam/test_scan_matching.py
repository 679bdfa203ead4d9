"""Incremental scan matching on a loop whose truth is known, and on readings that are not right."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers.slam.scan_matching import ScanMatching
from albot_core.maps.layers import OccupancyGridLayer
from albot_core.sensing.reading import LaserScan, Reading
from tests.core.mappers.slam.rooms import LASER, reading_from

CORNERS = np.array(((-2.0, -1.5), (3.0, -1.5), (3.0, 2.0), (-2.0, 2.0)))


def lap(step: float = 0.25, turn: float = 0.3) -> np.ndarray:
    """Poses of a robot that drives once around the room, from corner to corner."""
    poses = [np.array((*CORNERS[0], 0.0))]
    for corner in (*CORNERS[1:], CORNERS[0]):
        way = corner - poses[-1][:2]
        bearing, length = np.arctan2(way[1], way[0]), np.hypot(*way)
        off = (bearing - poses[-1][2] + np.pi) % (2 * np.pi) - np.pi
        for _ in range(int(np.ceil(abs(off) / turn))):
            poses.append(poses[-1] + (0, 0, off / np.ceil(abs(off) / turn)))
        for _ in range(round(length / step)):
            poses.append(poses[-1] + step * np.array((np.cos(bearing), np.sin(bearing), 0.0)))
    return np.array(poses)


def drive(mapper, poses: np.ndarray, rng: np.random.Generator, turn_error: float, scale: float):
    """Lead a mapper along poses, by an odometer that errs; return what it believed."""
    believed = []
    for k, pose in enumerate(poses):
        motion = np.zeros(3) if k == 0 else relative(poses[k - 1], pose)
        motion[:2] *= rng.uniform(1 - scale, 1 + scale)
        motion[2] += rng.uniform(-turn_error, turn_error)
        mapper.update(reading_from(pose, motion))
        believed.append(mapper.estimate.pose)
    return np.array(believed)


@pytest.mark.parametrize(("turn_error", "scale"), [(0.0, 0.0), (np.radians(25), 0.1), (0.0, 1.0)])
def test_it_follows_the_robot_whatever_the_odometer_says(turn_error, scale):
    mapper, poses = ScanMatching(), lap()
    believed = drive(mapper, poses, np.random.default_rng(0), turn_error, scale)
    true = relative(poses[0], poses)
    off = np.hypot(*(believed - true)[:, :2].T)
    assert off.max() < 0.08
    assert mapper.estimate.localised
    layer = mapper.snapshot().layer(OccupancyGridLayer)
    walls = compose(poses[0], np.c_[layer.centres(0.65), np.zeros(len(layer.centres(0.65)))])
    x, y = walls[:, 0], walls[:, 1]
    away = np.min([abs(x + 4), abs(x - 5), abs(y + 3), abs(y - 4), abs(x - 1)], axis=0)
    assert len(away) > 300
    assert np.quantile(away, 0.95) < 0.1


def test_a_scan_of_no_returns_follows_the_odometer_and_says_so():
    mapper, poses = ScanMatching(), lap()
    drive(mapper, poses[:5], np.random.default_rng(0), 0.0, 0.0)
    before, size = mapper.estimate.pose, np.isfinite(mapper.snapshot().layers[0].occupancy).sum()
    nothing = LaserScan(ranges=np.full(LASER.beams, np.inf), geometry=LASER)
    mapper.update(Reading(stamp=0.0, motion=np.array((0.5, 0.1, 0.2)), laser=nothing))
    np.testing.assert_allclose(mapper.estimate.pose, compose(before, np.array((0.5, 0.1, 0.2))))
    assert not mapper.estimate.localised
    assert np.isfinite(mapper.snapshot().layers[0].occupancy).sum() == size
    first = ScanMatching()
    first.update(Reading(stamp=0.0, motion=np.zeros(3), laser=nothing))
    assert first.snapshot().layers[0].occupancy.size == 0


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("counts", lambda a: a + 10**6, "counts"),
        ("poses", lambda a: a * np.nan, "finite"),
        ("local.counts", lambda a: a + 1, "add up to"),
        ("local.errors", lambda a: -a, "from 0"),
        ("grid.places", lambda a: a * 10**9, "tiles"),
    ],
)
def test_a_damaged_state_is_refused(name, damage, message):
    mapper = ScanMatching()
    drive(mapper, lap()[:5], np.random.default_rng(0), 0.0, 0.0)
    state = mapper.state()
    state[name] = damage(state[name])
    with pytest.raises(InputError, match=message):
        ScanMatching().restore(state)
