"""Landmark association on small scenes whose answers are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, relative, transform_segments
from albot_core.mappers.association.global_map import UNKNOWN
from albot_core.mappers.association.mapper import Association, AssociationConfig
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    SonarGeometry,
    SonarScan,
)
from tests.core.scenes import OUTSIDE, ROOM, doorway, scan_from

HOUSE = np.array([*OUTSIDE, *doorway(2.0, 1.2)], float)
WAY = np.array(
    (
        (-1.513, -2.021, 0.011),
        (-0.521, -1.037, 0.713),
        (0.507, 0.018, 0.523),
        (1.619, 0.027, 0.013),
        (2.717, 0.021, -0.017),
        (3.823, 0.033, 0.019),
    )
)
"""Out of the western room through the doorway into the eastern one; no beam just meets an end."""
ROUND = np.array(
    [(x, y, heading) for x, y in ((0, 0), (2, 1)) for heading in np.arange(0, 2 * np.pi, 0.25)]
)
"""All round, at two places of the room."""


def readings(walls: np.ndarray, way: np.ndarray, error: np.ndarray | None = None) -> list[Reading]:
    """What is seen on the way, with the odometer's error at each motion."""
    motions = relative(np.concatenate((way[:1], way[:-1])), way)
    motions[1:] += np.zeros(3) if error is None else error
    return [
        Reading(stamp=float(k), motion=motions[k], laser=scan_from(pose, walls))
        for k, pose in enumerate(way)
    ]


def led(taken: list[Reading], **config: float) -> Association:
    mapper = Association(AssociationConfig(**config))
    for reading in taken:
        mapper.update(reading)
    return mapper


def unlike(mapper: Association, walls: np.ndarray, start: np.ndarray) -> float:
    """The greatest distance of an end of a surface in the map from all walls (m)."""
    ends = transform_segments(start, mapper.snapshot().segments).reshape(-1, 2)
    along = walls[:, 2:] - walls[:, :2]
    to = ends[:, None] - walls[:, :2]
    share = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0, 1)
    return float(np.hypot(*np.moveaxis(to - share[..., None] * along, -1, 0)).min(1).max())


def test_the_first_view_is_the_map():
    mapper = led(readings(HOUSE, WAY[:1]))
    assert len(mapper.snapshot().segments) >= 4
    assert unlike(mapper, HOUSE, WAY[0]) < 0.05
    assert mapper.estimate.localised


def test_with_a_good_odometer_the_map_is_the_house():
    mapper = led(readings(HOUSE, WAY))
    assert unlike(mapper, HOUSE, WAY[0]) < 0.1
    np.testing.assert_allclose(compose(WAY[0], mapper.estimate.pose), WAY[-1], atol=0.05)


def test_turns_that_are_measured_wrong_do_not_add_up():
    taken = readings(ROOM, ROUND, error=np.array((0.0, 0.0, np.radians(4.0))))
    mapper, odometry = led(taken), make_mapper("odometry")
    for reading in taken:
        odometry.update(reading)
    true = relative(ROUND[0], ROUND[-1])
    off = [relative(each.estimate.pose, true) for each in (mapper, odometry)]
    assert abs(off[1][2]) > np.radians(100.0)
    assert abs(off[0][2]) < np.radians(3.0)
    # Along the walls nothing tells where the robot is but the odometer.
    assert np.hypot(*off[0][:2]) < 1.2


def test_turns_that_are_measured_very_wrong_are_found_out():
    """By up to 14°, so that no landmark is left where the odometer says."""
    taken, rng = readings(HOUSE, WAY), np.random.default_rng(2)
    off = rng.uniform(np.radians(11), np.radians(14), len(taken)) * rng.choice((-1, 1), len(taken))
    worse = [
        Reading(stamp=r.stamp, motion=r.motion + np.array((0, 0, turn)), laser=r.laser)
        for r, turn in zip(taken, off, strict=True)
    ]
    mapper = led(worse)
    assert mapper.estimate.localised
    assert unlike(mapper, HOUSE, WAY[0]) < 0.15
    np.testing.assert_allclose(compose(WAY[0], mapper.estimate.pose), WAY[-1], atol=0.1)


LASERS = (
    LaserGeometry(),
    LaserGeometry(beams=361, spacing=np.radians(0.5), mount=(0.2, 0.05, 0.1)),
    LaserGeometry(beams=241, first_bearing=-np.radians(120.0), max_range=8.0),
    LaserGeometry(beams=91, spacing=np.radians(2.0), mount=(-0.1, 0.0, -0.3)),
)
"""Lasers with other beams, fields of view, ranges and places on the robot."""


def test_the_laser_may_change_on_the_way():
    """The surfaces of a view are in the robot's coordinates, whichever laser saw them."""
    motions = relative(np.concatenate((WAY[:1], WAY[:-1])), WAY)
    mapper = Association()
    for k, pose in enumerate(WAY):
        laser = LASERS[k % len(LASERS)]
        seen_from = compose(pose, np.array(laser.mount))
        plain = replace(laser, mount=(0.0, 0.0, 0.0))
        scan = LaserScan(ranges=scan_from(seen_from, HOUSE, plain).ranges, geometry=laser)
        motion = motions[k] + np.array((0.03, -0.02, 0.05))
        mapper.update(Reading(stamp=float(k), motion=motion, laser=scan))
        assert mapper.estimate.localised
    assert unlike(mapper, HOUSE, WAY[0]) < 0.2
    np.testing.assert_allclose(compose(WAY[0], mapper.estimate.pose), WAY[-1], atol=0.1)


def test_going_round_again_adds_nothing():
    once = led(readings(ROOM, ROUND))
    twice = led(readings(ROOM, np.concatenate((ROUND, ROUND))))
    assert len(twice.snapshot().segments) <= len(once.snapshot().segments) + 2


def test_what_is_in_view_is_as_long_as_in_the_map():
    mapper = Association()
    for reading in readings(HOUSE, WAY, error=np.array((0.05, -0.03, 0.05))):
        mapper.update(reading)
        state = mapper.state()
        in_map = state["view.ids"] != UNKNOWN
        seen = state["view.surfaces"][in_map]
        known = state["surfaces"][state["view.ids"][in_map]]
        assert len(seen)
        lengths = [np.hypot(*(each[:, 2:] - each[:, :2]).T) for each in (seen, known)]
        np.testing.assert_allclose(*lengths, atol=1e-9)


@settings(max_examples=10)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))
def test_the_map_does_not_depend_on_where_the_house_stands(x, y, heading):
    moved = np.array((x, y, heading))
    here = led(readings(HOUSE, WAY))
    there = led(readings(transform_segments(moved, HOUSE), compose(moved[None], WAY)))
    np.testing.assert_allclose(there.snapshot().segments, here.snapshot().segments, atol=1e-6)
    np.testing.assert_allclose(there.estimate.pose, here.estimate.pose, atol=1e-6)


def test_it_is_lost_where_nothing_is_known_and_found_where_something_is():
    taken = readings(HOUSE, WAY)
    nothing = LaserScan(ranges=np.full(181, np.inf), geometry=LaserGeometry())
    mapper = led(taken[:3])
    before = mapper.snapshot().segments
    away = Reading(stamp=3.0, motion=np.array((1.5, 0.0, 0.0)), laser=nothing)
    assert mapper.update(away)
    assert not mapper.estimate.localised
    np.testing.assert_array_equal(mapper.snapshot().segments, before)
    # It comes back, by the odometer; what it then sees is what the map holds.
    back = Reading(stamp=4.0, motion=inverse(away.motion), laser=taken[2].laser)
    mapper.update(back)
    assert len(mapper.snapshot().segments) <= len(before) + 1
    turn = np.array((0.0, 0.0, 0.3))
    mapper.update(Reading(stamp=5.0, motion=turn, laser=scan_from(compose(WAY[2], turn), HOUSE)))
    assert mapper.estimate.localised


def test_a_reading_is_a_view_once_the_robot_has_gone_or_turned_so_far():
    taken = readings(HOUSE, WAY)
    steps = [np.array(motion) for motion in ((0.4, 0, 0), (0.4, 0, 0), (0.3, 0, 0), (0, 0, -0.3))]
    mapper = led(taken[:1])
    looks = [mapper.update(Reading(stamp=0.0, motion=m, laser=taken[0].laser)) for m in steps]
    assert looks == [False, False, True, True]


def test_the_drift_of_the_odometer_is_known_where_there_are_no_landmarks():
    """It turns 3° too far in a metre, to and fro, and then 1.2 m without any return."""
    way, drift = np.concatenate((WAY, WAY[::-1]) * 3), np.radians(3.0)
    mapper = Association()
    for reading in readings(HOUSE, way):
        length = np.hypot(*reading.motion[:2])
        mapper.update(replace(reading, motion=reading.motion + np.array((0, 0, drift * length))))
    before = mapper.estimate.pose[2]
    nothing = LaserScan(ranges=np.full(181, np.inf), geometry=LaserGeometry())
    mapper.update(Reading(stamp=99.0, motion=np.array((1.2, 0, 1.2 * drift)), laser=nothing))
    assert not mapper.estimate.localised
    assert abs(mapper.estimate.pose[2] - before) < 0.5 * 1.2 * drift


def test_without_odometry_landmarks_tell_how_the_robot_moved():
    """Small moves and turns, of which the odometer reports none."""
    along = np.linspace(0, 1, 25)
    way = np.column_stack((-2 + 2.4 * along, -2 + 1.5 * along, 0.2 + 1.5 * along))
    mapper = Association()
    for k, pose in enumerate(way):
        mapper.update(Reading(stamp=float(k), motion=np.zeros(3), laser=scan_from(pose, ROOM)))
    np.testing.assert_allclose(compose(way[0], mapper.estimate.pose), way[-1], atol=0.15)
    assert unlike(mapper, ROOM, way[0]) < 0.3


@pytest.mark.parametrize(
    "name",
    ["spacing", "turn", "angle", "closeness", "corner", "map_turn", "map_shift", "map_slope"],
)
def test_thresholds_are_checked(name):
    with pytest.raises(InputError, match=rf"AssociationConfig\.{name}"):
        AssociationConfig(**{name: -0.1})


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("view.ids", np.array((0, 99)), "view.ids"),
        ("view.ids", np.array((1, 1)), "view.ids"),
        ("view.ids", np.array((0, -2)), "view.ids"),
        ("view.lengths", np.array((1.0, 0.0)), "view.lengths"),
        ("odometer", np.array((0.0, 1.0, -1.0, 1.0)), "odometer"),
        (
            "view.surfaces",
            np.array(((0.0, 0, 0, 0), (0, 0, 1, 1))),
            "view.surfaces: expected line segments from",
        ),
        ("counts", np.array((2, 5)), "counts"),
        ("pose", np.full(3, np.nan), "pose"),
    ],
)
def test_a_damaged_state_is_refused(name, value, expected):
    mapper = led(readings(HOUSE, WAY[:2]))
    state = mapper.state()
    for array in ("view.surfaces", "view.lengths"):
        state[array] = state[array][:2]
    state["view.ids"] = np.array((0, 1))
    Association().restore(state)
    with pytest.raises(InputError, match=expected):
        Association().restore(state | {name: value})


def test_a_reading_without_a_laser_is_refused_and_changes_nothing():
    mapper = led(readings(HOUSE, WAY[:2]))
    before = mapper.state()
    sonar = SonarScan(ranges=np.ones(len(SonarGeometry().bearings)), geometry=SonarGeometry())
    with pytest.raises(InputError, match="association"):
        mapper.update(Reading(stamp=2.0, motion=np.ones(3), sonar=sonar))
    for name, array in mapper.state().items():
        np.testing.assert_array_equal(array, before[name])


def test_a_journey_without_surfaces_has_an_empty_map():
    nothing = LaserScan(ranges=np.full(181, np.inf), geometry=LaserGeometry())
    mapper = Association()
    for k in range(4):
        mapper.update(Reading(stamp=float(k), motion=np.array((1.5, 0.0, 0.1)), laser=nothing))
    assert len(mapper.snapshot().segments) == 0
    assert not mapper.estimate.localised
    assert np.isfinite(mapper.estimate.pose).all()
