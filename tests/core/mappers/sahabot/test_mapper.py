"""Sahabot 2 as a mapper, in a desert of posts whose answers are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import relative, wrap_angle
from albot_core.mappers.mapper import POINT, TRAVEL, RouteHome
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.sahabot.config import SahabotConfig
from albot_core.mappers.sahabot.mapper import Sahabot
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading

ALL_ROUND = LaserGeometry(beams=360, first_bearing=-np.pi)
POSTS = np.array(((4.0, 1.0), (-1.0, 4.5), (-4.0, -2.0), (1.5, -4.0)))


def scan(pose: np.ndarray, posts: np.ndarray = POSTS, laser: LaserGeometry = ALL_ROUND):
    """What a laser sees of posts with a radius of 0.2 m, by the equation of a circle."""
    bearings = laser.bearings + pose[2]
    units = np.stack((np.cos(bearings), np.sin(bearings)), axis=-1)
    ranges = np.full(laser.beams, np.inf)
    for post in posts - pose[:2]:
        along, across = units @ post, units @ np.array((post[1], -post[0]))
        meets = (np.abs(across) < 0.2) & (along > 0)
        reach = along - np.sqrt(np.maximum(0.04 - across**2, 0.0))
        ranges[meets] = np.minimum(ranges[meets], reach[meets])
    return LaserScan(ranges=ranges, geometry=laser)


def readings(
    poses: np.ndarray,
    posts: np.ndarray = POSTS,
    laser: LaserGeometry = ALL_ROUND,
    scale: float = 1.0,
) -> list[Reading]:
    """The readings at true poses; the wheels' distances are `scale` times too long."""
    motions = np.concatenate((np.zeros((1, 3)), relative(poses[:-1], poses[1:])))
    motions[:, :2] *= scale
    return [
        Reading(
            stamp=0.1 * k,
            motion=motion,
            laser=scan(pose, posts, laser),
            compass=float(wrap_angle(pose[2] + 0.5)),
        )
        for k, (pose, motion) in enumerate(zip(poses, motions, strict=True))
    ]


def there_and_back(far: float = 6.0, spacing: float = 0.1) -> np.ndarray:
    """Poses from the nest out along x, turning, and back to the nest."""
    out = np.arange(0.0, far, spacing)
    turn = np.linspace(0.0, np.pi, 20)
    ways = [(x, 0.0, 0.0) for x in out], [(far, 0.0, a) for a in turn]
    back = [(x, 0.0, np.pi) for x in np.arange(far, -spacing / 2, -spacing)]
    poses = np.array([*ways[0], *ways[1], *back])
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses


def run(mapper: Sahabot, given: list[Reading]) -> Sahabot:
    for reading in given:
        mapper.update(reading)
    return mapper


@pytest.mark.parametrize("integration", ["exact", "approximate"])
def test_straight_there_and_back_is_integrated_without_an_error(integration: str) -> None:
    config = SahabotConfig(integration=integration)
    open_ground = readings(there_and_back()[:-20], posts=np.empty((0, 2)))
    found = run(Sahabot(config), open_ground).estimate
    np.testing.assert_allclose(found.pose[:2], (2.0, 0.0), atol=0.02)
    assert np.cos(found.pose[2]) == pytest.approx(-1.0)


@pytest.mark.parametrize("visual", ["alv", "snapshot"])
def test_near_the_nest_landmarks_tell_the_way_though_the_wheels_are_wrong(visual: str) -> None:
    """The nest is believed 0.9 m farther on; the landmarks still tell where it is."""
    poses = there_and_back()
    mapper = Sahabot(SahabotConfig(visual=visual))
    given = readings(poses)
    # Only the way back is measured too short.
    given = [
        replace(each, motion=each.motion * (0.85, 0.85, 1.0)) if k > 80 else each
        for k, each in enumerate(given)
    ]
    told = 0
    for pose, reading in zip(poses, given, strict=True):
        mapper.update(reading)
        point = mapper.way_home[POINT]
        if np.isfinite(point).all():
            told += 1
            ahead = point - mapper.estimate.pose[:2]
            assert np.dot(ahead, -pose[:2]) > 0.7 * np.hypot(*ahead) * np.hypot(*pose[:2])
    assert told > 10
    assert mapper.estimate.matched_reading == 0 and mapper.estimate.place == 0
    assert np.hypot(*mapper.estimate.pose[:2]) < 0.25  # It would be 0.9 m off.


def test_home_is_not_met_again_before_the_robot_was_away() -> None:
    mapper = Sahabot()
    for reading in readings(there_and_back()[:25]):
        mapper.update(reading)
        assert mapper.estimate.matched_reading is None
        assert np.isnan(mapper.way_home[POINT]).all()
    assert mapper.way_home[TRAVEL] == pytest.approx(2.4)


def test_without_landmarks_only_the_home_vector_is_left() -> None:
    for posts in (np.empty((0, 2)), POSTS[:1]):
        mapper = Sahabot()
        for reading in readings(there_and_back(), posts=posts):
            mapper.update(reading)
            assert np.isnan(mapper.way_home[POINT]).all()
            assert np.isfinite(mapper.estimate.pose).all()
        assert mapper.estimate.matched_reading is None
        assert len(mapper.snapshot().place_graph.nodes[0].segments) == len(posts)


def test_a_place_with_landmarks_in_the_same_directions_is_not_the_nest() -> None:
    """The posts stand twice as far away where the robot comes back to."""
    there = there_and_back()
    out, home = readings(there), readings(there, posts=2.0 * POSTS)
    mapper = run(Sahabot(), [*out[: len(out) // 2], *home[len(out) // 2 :]])
    assert mapper.estimate.matched_reading is None
    assert run(Sahabot(), out).estimate.matched_reading == 0


def test_a_compass_that_stands_still_is_told_and_gives_no_nan() -> None:
    poses = there_and_back()
    given = [replace(each, compass=0.5) for each in readings(poses)]
    mapper = run(Sahabot(), given)
    assert not mapper.estimate.localised
    # The wheels told the turn: these have no error.
    np.testing.assert_allclose(mapper.estimate.pose[:2], 0.0, atol=0.26)
    assert np.isfinite(mapper.estimate.pose).all()


def test_with_the_compass_off_the_robot_is_lost_where_the_wheels_turn_wrongly() -> None:
    given = readings(there_and_back()[:-30], posts=np.empty((0, 2)))
    given = [replace(each, motion=each.motion * (1.0, 1.0, 0.7)) for each in given]
    errors = [
        np.hypot(*(run(make_mapper(name), given).estimate.pose[:2] - (3.0, 0.0)))
        for name in ("sahabot", "sahabot-wheels")
    ]
    assert errors[0] < 0.01 and errors[1] > 1.0


def test_the_snapshot_is_completed_while_the_robot_turns_at_the_nest() -> None:
    half = LaserGeometry()
    turning = np.array([(0.0, 0.0, a) for a in np.linspace(0.0, 3.1, 40)])
    mapper = Sahabot()
    first, *others = readings(turning, laser=half)
    assert mapper.update(first)
    assert len(mapper.snapshot().place_graph.nodes[0].segments) < 4
    assert sum(mapper.update(each) for each in others) > 1
    assert len(mapper.snapshot().place_graph.nodes[0].segments) == 4
    assert mapper.estimate.map_version == mapper.estimate.updates > 1


def test_what_lies_behind_is_carried_along() -> None:
    """A laser of 180° turns at the nest, and drives away from a post, 3.8 m behind."""
    turning = [(0.0, 0.0, a) for a in np.linspace(0.0, 2 * np.pi, 40)]
    poses = np.array([*turning, (0.5, 0.0, 0.0), (1.0, 0.0, 0.0), (1.5, 0.0, 0.0)])
    post = np.array([(-4.0, 0.0)])
    mapper = run(Sahabot(), readings(poses, posts=post, laser=LaserGeometry()))
    assert mapper.state()["panorama"][180] == pytest.approx(5.3, abs=0.02)


def test_a_mapper_that_is_restored_goes_on_as_before() -> None:
    given = readings(there_and_back(), scale=1.02)
    whole, other = Sahabot(), Sahabot()
    for k, reading in enumerate(given):
        whole.update(reading)
        if k == 110:
            other.restore(whole.state())
            np.testing.assert_array_equal(other.way_home, whole.way_home)
        elif k > 110:
            other.update(reading)
            np.testing.assert_array_equal(other.estimate.pose, whole.estimate.pose)
            np.testing.assert_array_equal(other.way_home, whole.way_home)
    assert isinstance(whole, RouteHome)
    for name, array in whole.state().items():
        np.testing.assert_array_equal(other.state()[name], array)


def test_a_robot_without_the_sensors_is_refused() -> None:
    reading = readings(there_and_back()[:1])[0]
    with pytest.raises(InputError, match=r"Reading.compass: expected a compass, which sahabot"):
        make_mapper("sahabot").update(replace(reading, compass=None))
    with pytest.raises(InputError, match=r"Reading.laser"):
        make_mapper("sahabot").update(replace(reading, laser=None))
    make_mapper("sahabot-wheels").update(replace(reading, compass=None))


@pytest.mark.parametrize(
    ("field", "value"),
    [("heading", "stars"), ("integration", "euler"), ("visual", "eye"), ("near", 0.0)],
)
def test_wrong_parameters_are_refused(field: str, value: object) -> None:
    with pytest.raises(InputError, match=f"SahabotConfig.{field}"):
        SahabotConfig(**{field: value})
