"""What the experiments with Albot0 hold against the truth."""

from __future__ import annotations

import numpy as np
import pytest

from albot_experiments import albot0_hall, albot0_lost_frame, albot0_return
from albot_maps import load_world


def test_a_corridor_is_no_large_room():
    """The corridor of 27 × 1.8 m has the most floor; where it is split the rooms are not."""
    world = load_world("random:office:103?rooms=12")
    rooms = {room.name: room.boundary for room in world.rooms}
    corridor, office = rooms["corridor 1"], rooms["office 4"]
    along = np.linspace(corridor.min(axis=0) + 0.8, corridor.max(axis=0) - 0.8, 60)
    inside = np.linspace(office.min(axis=0) + 1.5, office.max(axis=0) - 1.5, 20)
    out = np.concatenate((along, inside))
    assert [world.room_at(*place) for place in inside.tolist()] == ["office 4"] * 20
    places = np.repeat((0, 1, 2), (30, 30, 20))
    assert albot0_return._is_whole(world, out, places) is True
    assert albot0_return._is_whole(world, out[:60], places[:60]) is None
    places[-5:] = 3
    assert albot0_return._is_whole(world, out, places) is False


def test_corridors_count_as_parted_where_an_asr_ends_near_their_crossing():
    """The way leads 10 m along one corridor and 8 m along the link that crosses it."""
    world = load_world("random:office:203?rooms=12")
    rooms = {room.name: room.boundary for room in world.rooms}
    along, across = rooms["corridor 1"], rooms["link 2"]
    x, y = across.mean(axis=0)[0], along.mean(axis=0)[1]
    up = 1.0 if across.mean(axis=0)[1] > y else -1.0
    legs = np.linspace(10.0, 0.0, 101), np.linspace(0.1, 9.0, 90)
    side = 1.0 if x < along.mean(axis=0)[0] else -1.0
    corridor = np.stack((x + side * legs[0], np.full(101, y)), axis=1)
    link = np.stack((np.full(90, x), y + up * legs[1]), axis=1)
    out = np.concatenate((corridor, link))
    assert {world.room_at(*place) for place in out.tolist()} >= {"corridor 1", "link 2"}
    parted, late = np.arange(191) >= 101, np.arange(191) >= 150
    assert albot0_return._bends(world, out, parted.astype(np.int64)) == (True,)
    assert albot0_return._bends(world, out, late.astype(np.int64)) == (False,)
    assert albot0_return._bends(world, out[:120], parted[:120].astype(np.int64)) == ()


def test_away_across_leads_through_a_door_hardly_wider_than_the_clearance():
    """The rooms of seeds 1, 71, 90, 92 and 3012 could not be reached, and the experiment ended."""
    world = load_world(albot0_return.OFFICE.format(seed=3012))
    way = albot0_return.way_across(world, 3012)
    assert world.room_at(*way[0]) != world.room_at(*way[-1])


def test_ways_drawn_at_random_come_through_the_large_room():
    world = load_world(albot0_hall.WORLD)
    low, high = (
        getattr(albot0_hall._large_room(world).boundary, f)(axis=0) for f in ("min", "max")
    )
    for seed in range(10):
        way = albot0_hall._way_at_random(world, np.random.default_rng(seed))
        is_inside = ((way > low) & (way < high)).all(axis=1)
        assert is_inside.any()
        assert not is_inside[[0, -1]].any()
        assert {world.room_at(*way[k]) for k in (0, -1)} <= set(albot0_hall.ENDS)


def test_a_large_room_is_one_asr_on_a_way_drawn_at_random():
    """On this way it was split in three, with split points 26 m from its exits."""
    split = albot0_hall.drive_at_random(load_world(albot0_hall.WORLD), 11)
    assert split.is_whole
    assert max(split.distances) < 2.0


@pytest.mark.parametrize("name", ["albot0-paper", "albot0"])
def test_in_another_frame_a_robot_comes_home_as_in_its_own(name):
    """Of a short way in an office; ours says that its frame was lost."""
    world = load_world(albot0_return.OFFICE.format(seed=2))
    way = albot0_return.way_across(world, 2)
    journey, turned = albot0_return.drive(world, way, "ideal", 2)
    found = dict(albot0_lost_frame.come_home(name, journey, turned, 2))
    assert found.keys() == albot0_lost_frame.FRAMES.keys()
    for frame, outcome in found.items():
        assert outcome.right > 0.9
        assert outcome.is_home
        if name == "albot0":
            assert outcome.kept is not None
            assert (outcome.kept > 0.5) == (frame == "kept")
        else:
            assert outcome.kept is None
