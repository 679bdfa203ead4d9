"""Mappers that go on in a saved map: what they promise, and what they refuse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.localisation.mapper import MapUser, Resumable
from albot_core.mappers.map_file import load_map, save_map
from albot_core.mappers.mapper import TRAVEL, Mapper, RouteHome
from albot_core.mappers.registry import make_mapper, make_mappers
from albot_core.maps.layers import MapSnapshot
from albot_core.sensing.reading import Reading, Readings
from tests.core.localisation.buildings import OTHER, OTHER_TOUR, TOUR, readings

WAY = ((12, 2), (12, 5.2), (6.5, 5.5), (3, 6.5))
NAMES = ("albot1", "scan-matching", "graph-slam", "gmapping", "fastslam")
SOME = np.array((2.0, 2.0))
"""Where the tour begins: the maps' frame lies there, turned to where the robot drives first."""


@pytest.fixture(scope="module")
def maps(tmp_path_factory) -> Path:
    """A folder with each mapper's map of the building."""
    folder = tmp_path_factory.mktemp("maps")
    for name in (*NAMES, "odometry", "ratslam"):
        mapper = make_mapper(name)
        for reading, _ in readings(TOUR):
            mapper.update(reading)
        save_map(mapper, folder / f"{name}.albot")
    return folder


def user(name: str, maps: Path, **options: bool) -> Mapper:
    return make_mapper(name, map=maps / f"{name}.albot", localise=True, **options)


def led(mapper: Mapper, found: list) -> list[float]:
    """The errors of the believed positions (m); infinite where the robot is not localised."""
    errors = []
    first = readings(TOUR)[0][1]
    turn = np.array(((np.cos(first[2]), np.sin(first[2])), (-np.sin(first[2]), np.cos(first[2]))))
    for reading, pose in found:
        mapper.update(reading)
        off = float(np.hypot(*(mapper.estimate.pose[:2] - turn @ (pose[:2] - first[:2]))))
        errors.append(off if mapper.estimate.localised else np.inf)
    return errors


@pytest.mark.parametrize("extend", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_each_mapper_localises_in_its_map_and_goes_on(name, extend, maps):
    mapper = user(name, maps, extend=extend)
    errors = led(mapper, readings(WAY))
    assert errors[0] == np.inf
    known = np.array([error for error in errors if error < np.inf])
    assert len(known) > len(errors) // 3 and errors[-1] < np.inf
    assert known.max() < 0.3
    assert np.hypot(*mapper.estimate.home[:2]) < 0.2  # The saved map's home.


@pytest.mark.parametrize("name", NAMES)
def test_a_frozen_map_stays_as_it_is_and_an_extended_one_grows(name, maps):
    before = load_map(maps / f"{name}.albot")
    frozen, extended = user(name, maps), user(name, maps, extend=True)
    for mapper in (frozen, extended):
        led(mapper, readings(WAY))
    assert frozen.estimate.updates == before.estimate.updates
    assert frozen.estimate.map_version == before.estimate.map_version
    assert extended.estimate.updates > before.estimate.updates
    assert same_layers(frozen.snapshot(), before.snapshot())
    assert not same_layers(extended.snapshot(), before.snapshot())


def same_layers(one: MapSnapshot, other: MapSnapshot) -> bool:
    pairs = [
        (value, vars(its)[name])
        for mine, its in zip(one.layers, other.layers, strict=True)
        for name, value in vars(mine).items()
        if isinstance(value, np.ndarray)
    ]
    return all(np.array_equal(value, known, equal_nan=True) for value, known in pairs)


@pytest.mark.parametrize("extend", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_it_goes_on_from_a_state_to_the_bit_and_a_reset_makes_it_new(name, extend, maps):
    found = readings(WAY)
    one, other = (user(name, maps, extend=extend) for _ in range(2))
    first = led(one, found[:30])
    led(other, found[5:25])
    other.restore(one.state())
    assert led(one, found[30:]) == led(other, found[30:])
    state, its = one.state(), other.state()
    assert all(np.array_equal(array, its[key], equal_nan=True) for key, array in state.items())
    one.reset(np.random.default_rng(0))
    assert led(one, found[:30]) == first


def test_an_extended_map_is_a_map_like_any_other(maps, tmp_path):
    mapper = user("scan-matching", maps, extend=True)
    led(mapper, readings(WAY))
    assert isinstance(mapper, MapUser)
    save_map(mapper.saved, tmp_path / "more.albot")
    again = make_mapper("scan-matching", map=tmp_path / "more.albot", localise=True)
    assert led(again, readings(WAY))[-1] < 0.3


def test_it_knows_the_way_home_of_the_saved_map(maps):
    mapper = user("scan-matching", maps)
    led(mapper, readings(WAY))
    assert isinstance(mapper, RouteHome)
    way = mapper.way_home  # From (3, 6.5) through the door at (2, 4) to (2, 2).
    assert 4.0 < way[TRAVEL] < 6.0


def test_a_robot_in_another_building_never_claims_its_place(maps):
    mapper = user("albot1", maps)
    assert set(led(mapper, readings(OTHER_TOUR, OTHER))) == {np.inf}
    assert isinstance(mapper, MapUser) and mapper.standing == "lost"


def test_robots_of_a_batch_are_as_each_alone_and_share_the_map(maps):
    batch = make_mappers("scan-matching", 2, map=maps / "scan-matching.albot")
    alone = user("scan-matching", maps)
    found = readings(WAY)
    for reading, _ in found[:40]:
        alone.update(reading)
        laser = reading.required_laser("test")
        ranges, motions = np.tile(laser.ranges, (2, 1)), np.tile(reading.motion, (2, 1))
        both = Readings(stamps=np.zeros(2), motions=motions, laser=laser.geometry, ranges=ranges)
        batch.update(np.arange(2), both)
        assert np.array_equal(batch.poses[1], alone.estimate.pose)
        assert batch.is_lost.tolist() == [not alone.estimate.localised] * 2


def test_without_localise_it_goes_on_where_it_stopped(maps):
    mapper = make_mapper("scan-matching", map=maps / "scan-matching.albot")
    saved = load_map(maps / "scan-matching.albot")
    assert not isinstance(mapper, MapUser)
    assert np.array_equal(mapper.estimate.pose, saved.estimate.pose)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("albot1", {"map": "scan-matching.albot", "localise": True}, "expected a map of albot1"),
        ("albot1", {"map": "none.albot", "localise": True}, r"none\.albot"),
        ("albot1", {"localise": True}, "expected a map file"),
        ("albot1", {"map": "albot1.albot", "extend": True}, "expected localise=True"),
        ("odometry", {"map": "odometry.albot", "localise": True, "extend": True}, "goes on"),
        ("ratslam", {"map": "ratslam.albot", "localise": True}, "a map with walls"),
        ("albot1", {"map": "albot1.albot", "localise": True, "config": {"places": {
            "min_matches": 9}}}, "the config with which the map was made"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(name, options, message, maps):
    if "map" in options:
        options = {**options, "map": maps / options["map"]}
    with pytest.raises(InputError, match=message):
        make_mapper(name, **options)


def test_an_empty_map_is_refused_by_its_file(tmp_path):
    save_map(make_mapper("scan-matching"), tmp_path / "empty.albot")
    with pytest.raises(InputError, match=r"empty\.albot: expected a map with walls"):
        make_mapper("scan-matching", map=tmp_path / "empty.albot", localise=True)


def test_a_reading_without_a_laser_is_refused(maps):
    with pytest.raises(InputError, match="a laser scan, which localisation"):
        user("albot1", maps).update(Reading(stamp=0.0, motion=np.zeros(3)))


def test_who_can_extend_a_map_says_so():
    for name in NAMES:
        assert isinstance(make_mapper(name), Resumable)
