"""Albot1 with places, end to end in a house of two rooms, and the laws that it keeps there."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_segments
from albot_core.mappers.albot1.batch import Albot1Batch
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.events import EventKind
from albot_core.mappers.albot1.trail.breadcrumbs import WAYPOINT_AHEAD
from albot_core.mappers.mapper import EXIT, TRAVEL
from albot_core.sensing.reading import Reading, Readings
from tests.core.scenes import FURNITURE, house_walk, scan_from, two_rooms

RNG = np.random.default_rng(0)

HOUSE = np.concatenate((two_rooms(), FURNITURE))


def readings_in(walls: np.ndarray, path: np.ndarray, seed: int | None = None) -> list[Reading]:
    rng = np.random.default_rng(seed)
    made = []
    for i, pose in enumerate(path):
        motion, scan = relative(path[max(i - 1, 0)], pose), scan_from(pose, walls)
        if seed is not None:
            motion = motion + rng.normal(0, (0.01, 0.01, 0.01))
            scan.ranges[:] += rng.normal(0, 0.01, len(scan.ranges))
        made.append(Reading(stamp=float(i), motion=motion, laser=scan))
    return made


@pytest.fixture(scope="module")
def noisy() -> list[Reading]:
    return readings_in(HOUSE, house_walk(), seed=1)


def led(readings: list[Reading]) -> Albot1:
    mapper = Albot1()
    for reading in readings:
        mapper.update(reading)
    return mapper


def test_two_rooms_are_two_places_joined_by_their_door(noisy):
    mapper = led(noisy)
    what = [event.kind for event in mapper.events]
    assert what == [EventKind.SET_OUT, EventKind.NEW, *3 * [EventKind.ENTERED]]
    network = mapper.network
    assert (len(network.places), network.links, network.current) == (2, ((0, 1),), 0)
    (door,) = network.place(0).exits
    # With the place left to its left: from +y to -y for who leaves towards +x.
    np.testing.assert_allclose(door.line, (2.5, -0.45, 2.5, 0.45), atol=0.15)
    for place in network.places:
        assert len(place.surfaces) >= 6


def test_the_way_home_leads_through_the_door(noisy):
    mapper = led(noisy[:14])
    assert mapper.network.current == 1
    line = mapper.way_home[EXIT]
    assert np.hypot(*(0.5 * (line[:2] + line[2:]) - (2.5, 0.0))) < 0.2
    direction, distance = mapper.point_to(0)
    home = relative(noisy_truth(13), np.zeros(3))
    assert distance == pytest.approx(np.hypot(*home[:2]), abs=0.2)
    assert np.cos(direction - np.arctan2(home[1], home[0])) > 0.99
    with pytest.raises(InputError, match="place"):
        mapper.way_to(5)
    for reading in noisy[14:]:
        mapper.update(reading)
    assert np.isnan(mapper.way_home[EXIT]).all()


def test_there_is_no_exit_on_the_way_where_home_is_at_hand():
    """Two steps beyond the door the place is another one, but home is in view behind it."""
    path = np.column_stack((np.arange(1.4, 4.1, 0.2), np.zeros(14), np.zeros(14)))
    mapper, ways = Albot1(), []
    for reading in readings_in(HOUSE, path):
        mapper.update(reading)
        if mapper.network.current == 1:
            ways.append(mapper.way_home.copy())
    lengths, exits = np.array([way[TRAVEL] for way in ways]), np.array([way[EXIT] for way in ways])
    assert lengths[0] < 1.9 < 2.2 < lengths[-1]
    np.testing.assert_array_equal(np.isnan(exits).all(axis=1), lengths < WAYPOINT_AHEAD)


def noisy_truth(step: int) -> np.ndarray:
    return np.asarray(house_walk()[step])


def same_state(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    assert one.keys() == other.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


@pytest.mark.parametrize("cut", [1, 5, 6, 7, 13, 30, 50])
def test_a_run_restored_in_the_middle_goes_on_bit_for_bit(noisy, cut):
    whole, first = led(noisy), led(noisy[:cut])
    second = Albot1()
    second.restore(first.state())
    np.testing.assert_array_equal(second.estimate.pose, first.estimate.pose)
    np.testing.assert_array_equal(second.estimate.home_from_robot, first.estimate.home_from_robot)
    for reading in noisy[cut:]:
        second.update(reading)
    same_state(second.state(), whole.state())
    assert second.events == whole.events
    np.testing.assert_array_equal(second.estimate.home_from_robot, whole.estimate.home_from_robot)


def test_a_batch_does_what_a_single_one_does(noisy):
    batch, singles = Albot1Batch(3), [Albot1() for _ in range(3)]
    path = readings_in(HOUSE, house_walk()[::-1].copy(), seed=2)
    for k, reading in enumerate(noisy):
        rows = np.array([row for row in (2, 0, 1) if (k + row) % 5])
        given = [noisy[k], path[k], reading]
        batch.update(
            rows,
            Readings(
                stamps=np.zeros(3),
                motions=np.stack([one.motion for one in given]),
                laser=reading.laser.geometry,
                ranges=np.stack([one.laser.ranges for one in given]),
            ),
        )
        for row in rows.tolist():
            singles[row].update(given[row])
        if k == 40:
            batch.reset(1, RNG)
            singles[1].reset(RNG)
    for row, single in enumerate(singles):
        same_state(batch.state(row), single.state())
        home = compose(single.estimate.pose, single.estimate.home_from_robot)
        np.testing.assert_allclose(batch.homes_in_map[row], home, atol=1e-12)
        batch.find_ways(np.array([row]))
        np.testing.assert_array_equal(batch.ways_home[row], single.way_home)
    # The second was reset half-way, and readings with their motions are left out of its walk.
    assert all(len(singles[row].network.places) > 1 for row in (0, 2))


def test_moving_the_whole_world_leaves_the_network_as_it_was():
    path, motion = house_walk()[:40], np.array([13.0, -7.0, 1.1])
    here = led(readings_in(HOUSE, path))
    there = led(readings_in(transform_segments(motion, HOUSE), compose(motion, path)))
    assert [str(event) for event in here.events] == [str(event) for event in there.events]
    for mine, theirs in zip(here.network.places, there.network.places, strict=True):
        np.testing.assert_allclose(mine.frame, theirs.frame, atol=1e-6)
        np.testing.assert_allclose(mine.surfaces, theirs.surfaces, atol=1e-6)
        for door, its in zip(mine.exits, theirs.exits, strict=True):
            np.testing.assert_allclose(door.line, its.line, atol=1e-6)
            assert (door.leads_to, door.exit_there) == (its.leads_to, its.exit_there)
    assert here.network.links == there.network.links


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("progress", lambda a: a[:4]),
        ("odometer", lambda a: a[:2]),
        ("odometer", lambda a: a - 1.0),
        ("progress", lambda a: -a - 1),
        ("exits.counts", lambda a: a + 1),
        ("exits.lines", lambda a: a * np.nan),
        ("exits.gate", lambda a: a[:4]),
        ("memory.met", lambda a: a[1:]),
        ("memory.marks", lambda a: a + 100),
        ("memory.counts", lambda a: a[:4]),
        ("places.visits", lambda a: a[[0, 1, 1, 2, 3, 4, 5][: len(a)]]),
        ("places.links", lambda a: a + 7),
        ("view.pose", lambda a: a * np.nan),
        ("view.surfaces", lambda a: a * np.inf),
    ],
)
def test_a_damaged_memory_is_refused_and_nothing_is_lost(noisy, name, damage):
    mapper = led(noisy[:40])
    state = mapper.state()
    with pytest.raises(InputError, match=name.split(".")[0]):
        mapper.restore(state | {name: np.asarray(damage(state[name]), state[name].dtype)})
    same_state(mapper.state(), state)


def test_a_reset_forgets_the_places(noisy):
    mapper = led(noisy[:30])
    mapper.reset(RNG)
    same_state(mapper.state(), Albot1().state())
    assert mapper.network.links == ()
    assert len(mapper.exits) == 0
