"""What every mapper must keep to, ours and others, each by what it can do."""

from __future__ import annotations

from dataclasses import replace
from multiprocessing.reduction import ForkingPickler

import numpy as np
import pytest

from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError
from albot_core.export.geojson import map_to_geojson
from albot_core.export.picture import Panel, map_figure
from albot_core.mappers.looped import LoopedMappers
from albot_core.mappers.map_file import load_map, save_map
from albot_core.mappers.mapper import (
    AttractorNetwork,
    CorrectedTrajectory,
    Mapper,
    MapperBatch,
    PlaceMemory,
    Recognition,
    RouteHome,
    require,
)
from albot_core.mappers.registry import (
    installed_mappers,
    make_mapper,
    make_mappers,
    mapper_spec,
)
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    Readings,
    SonarGeometry,
    SonarScan,
)

NAMES = (
    "albot0",
    "albot0-paper",
    "albot1",
    "albot1-thesis",
    "albot1-tracked",
    "association",
    "association-paper",
    "dp-slam",
    "fastslam",
    "gmapping",
    "graph-slam",
    "grid-slam",
    "hssh",
    "karto",
    "odometry",
    "ratslam",
    "ratslam-paper",
    "ratslam-scenes",
    "sahabot",
    "sahabot-wheels",
    "scan-matching",
    "tests.core.mappers.topological:topological",
    "tests.core.mappers.grid:grid",
)
LASER, SONAR = LaserGeometry(), SonarGeometry()


def echoes() -> np.ndarray:
    """What the sonars hear of the corridor's walls, a metre to either side (m)."""
    bearings, places = np.array(SONAR.bearings), np.array(SONAR.places)
    aside = 1.0 - np.sign(bearings) * places[:, 1]
    distances = aside / np.maximum(np.abs(np.sin(bearings)), 1e-6)
    return np.where(distances < SONAR.max_range, distances, np.inf)


def readings(count: int = 12) -> list[Reading]:
    """A robot driving down the middle of a corridor with niches, 2 m wide."""
    scans = []
    for k in range(count):
        side = 1.0 / np.maximum(np.abs(np.sin(LASER.bearings)), 1e-6)
        along = side * np.cos(LASER.bearings) + 0.4 * k
        ranges = np.where(np.floor(along) % 3 == 0, 1.6 * side, side)
        end = (12.0 - 0.4 * k) / np.maximum(np.cos(LASER.bearings), 1e-6)
        ranges = np.minimum(ranges, end)
        motion = np.array((0.4 if k else 0.0, 0.0, 0.0))
        scan = LaserScan(ranges=ranges, geometry=LASER)
        sonar = SonarScan(ranges=echoes(), geometry=SONAR)
        sensed = {"laser": scan, "sonar": sonar, "scene": k // 2, "compass": 0.5 + 0.01 * (k % 3)}
        scans.append(Reading(stamp=float(k), motion=motion, **sensed))
    return scans


@pytest.fixture(params=NAMES)
def name(request):
    spec = mapper_spec(request.param)
    if spec.name not in installed_mappers():
        pytest.skip(f"{spec.name} needs the extra {spec.extra}, which is not installed")
    return request.param


def led(name: str, seed: int = 0) -> Mapper:
    mapper = make_mapper(name, rng=np.random.default_rng(seed))
    for reading in readings():
        mapper.update(reading)
    return mapper


def same_state(one: Mapper, other: Mapper) -> None:
    assert one.state().keys() == other.state().keys()
    for key, array in one.state().items():
        np.testing.assert_array_equal(array, other.state()[key], err_msg=key)


def test_a_fresh_mapper_is_at_home(name):
    mapper = make_mapper(name)
    assert isinstance(mapper, Mapper)
    assert mapper.spec.name == name.rpartition(":")[2]
    estimate = mapper.estimate
    np.testing.assert_array_equal(estimate.pose, np.zeros(3))
    np.testing.assert_array_equal(estimate.home_from_robot, np.zeros(3))
    assert estimate.localised
    assert estimate.matched_reading is None
    assert mapper.snapshot().segments.shape == (0, 4)


def test_the_motion_of_the_first_reading_is_ignored(name):
    still, moved = make_mapper(name), make_mapper(name)
    first = readings(1)[0]
    still.update(first)
    moved.update(replace(first, motion=np.array((3.0, 2.0, 1.0))))
    same_state(still, moved)


def test_it_follows_the_robot_and_says_when_its_map_changes(name):
    mapper = make_mapper(name)
    versions = [mapper.estimate.map_version]
    for reading in readings():
        is_added = mapper.update(reading)
        versions.append(mapper.estimate.map_version)
        assert versions[-1] > versions[-2] if is_added else versions[-1] >= versions[-2]
    assert versions[-1] > versions[0]
    # Inexact mappers are a step off at most.
    np.testing.assert_allclose(mapper.estimate.pose, (4.4, 0, 0), atol=0.3)
    np.testing.assert_allclose(mapper.estimate.home_from_robot, (-4.4, 0, 0), atol=0.3)


def test_a_snapshot_has_the_layers_that_the_spec_names(name):
    mapper = led(name)
    layers = mapper.snapshot().layers
    assert tuple(layer.kind for layer in layers) == mapper.spec.layers
    if "segments" in mapper.spec.layers:
        segments = mapper.snapshot().segments
        assert len(segments) >= 2
        # The corridor's walls lie a metre, its niches 1.6 m, to either side.
        assert np.abs(segments[:, [1, 3]]).max() < 1.8


def test_a_snapshot_stays_as_it_is(name):
    mapper = led(name)
    snapshot = mapper.snapshot()
    before, version = map_to_geojson(snapshot), mapper.estimate.map_version
    for reading in readings():
        mapper.update(reading)
    assert map_to_geojson(snapshot) == before
    # A map of home alone stays the same far from home.
    assert (mapper.estimate.map_version == version) == name.startswith("sahabot")
    assert (map_to_geojson(mapper.snapshot()) == before) == name.startswith("sahabot")


def test_a_map_can_be_drawn_and_exported(name, tmp_path):
    mapper = led(name)
    path = tmp_path / "map.png"
    save_figure(
        map_figure(Panel(title="", snapshot=mapper.snapshot(), believed=np.zeros((2, 3)))), path
    )
    assert path.stat().st_size > 5000
    assert map_to_geojson(mapper.snapshot())["features"]


def test_two_mappers_of_a_name_agree_to_the_last_bit(name):
    same_state(led(name, 1), led(name, 1))


def test_reset_makes_a_mapper_new(name):
    mapper, fresh = led(name), led(name, 3)
    mapper.reset(np.random.default_rng(3))
    assert mapper.estimate.matched_reading is None
    for reading in readings():
        mapper.update(reading)
    same_state(mapper, fresh)


def test_a_restored_mapper_goes_on_as_if_never_stopped(name):
    whole, stopped = make_mapper(name), make_mapper(name)
    for reading in readings()[:6]:
        whole.update(reading)
        stopped.update(reading)
    resumed = make_mapper(name, rng=np.random.default_rng(99))
    resumed.restore(stopped.state())
    for reading in readings()[6:]:
        whole.update(reading)
        resumed.update(reading)
    same_state(whole, resumed)
    assert whole.estimate.map_version == resumed.estimate.map_version


def test_a_mapper_is_saved_and_loaded(name, tmp_path):
    mapper = led(name)
    save_map(mapper, tmp_path / "a.albot")
    same_state(load_map(tmp_path / "a.albot"), mapper)


def test_the_readings_are_left_as_they_were(name):
    mapper = make_mapper(name)
    for reading in readings():
        ranges, motion = reading.laser.ranges.copy(), reading.motion.copy()
        heard = reading.sonar.ranges.copy()
        mapper.update(reading)
        np.testing.assert_array_equal(reading.laser.ranges, ranges)
        np.testing.assert_array_equal(reading.sonar.ranges, heard)
        np.testing.assert_array_equal(reading.motion, motion)


def test_a_mapper_goes_to_another_process(name):
    mapper = make_mapper(name)
    twin = ForkingPickler.loads(ForkingPickler.dumps(mapper))
    assert type(twin) is type(mapper)
    same_state(twin, mapper)


def test_a_reading_without_a_sensor_that_it_needs_is_refused(name):
    mapper = make_mapper(name)
    blind = Reading(stamp=0.0, motion=np.zeros(3))
    if "laser" in mapper.spec.sensors:
        with pytest.raises(InputError, match=f"a laser scan, which {mapper.spec.name} needs"):
            mapper.update(blind)
    elif "sonar" in mapper.spec.sensors:
        with pytest.raises(InputError, match=f"sonar ranges, which {mapper.spec.name} needs"):
            mapper.update(blind)
    else:
        mapper.update(blind)


def test_a_capability_is_had_or_clearly_refused(name):
    mapper = led(name)
    kinds = RouteHome, PlaceMemory, CorrectedTrajectory, AttractorNetwork, Recognition
    expected = {
        "albot0": (True, True, False, False, False),
        "albot0-paper": (True, True, False, False, False),
        "albot1": (True, True, False, False, True),
        "albot1-thesis": (True, True, False, False, True),
        "albot1-tracked": (True, True, False, False, True),
        "association": (False, False, False, False, False),
        "association-paper": (False, False, False, False, False),
        "dp-slam": (True, False, True, False, False),
        "fastslam": (True, False, True, False, False),
        "gmapping": (True, False, True, False, False),
        "graph-slam": (True, False, True, False, True),
        "grid-slam": (True, False, True, False, False),
        "hssh": (True, True, True, False, False),
        "karto": (True, False, True, False, False),
        "odometry": (False, False, False, False, False),
        "ratslam": (True, True, True, True, True),
        "ratslam-paper": (True, True, True, True, True),
        "ratslam-scenes": (True, True, True, True, True),
        "sahabot": (True, False, False, False, False),
        "sahabot-wheels": (True, False, False, False, False),
        "scan-matching": (True, False, False, False, False),
        "topological": (False, True, False, False, False),
        "grid": (False, False, True, False, False),
    }[mapper.spec.name]
    for kind, has in zip(kinds, expected, strict=True):
        if has:
            assert require(mapper, kind) is mapper
        else:
            with pytest.raises(InputError, match=f"mapper {mapper.spec.name}: expected a mapper"):
                require(mapper, kind)
    if isinstance(mapper, RouteHome):
        assert mapper.way_home.shape == (7,)
    assert mapper.spec.has_matches == isinstance(mapper, Recognition)
    if isinstance(mapper, Recognition):
        assert mapper.place_matches(3).shape == (0, 6)
    if isinstance(mapper, PlaceMemory):
        assert all("\n" not in str(event) for event in mapper.events)
        assert mapper.place_at(len(readings()) - 1) == mapper.estimate.place
    if isinstance(mapper, CorrectedTrajectory):
        assert mapper.corrected_poses().shape == (len(readings()), 3)
    if isinstance(mapper, AttractorNetwork):
        activity = mapper.activity
        assert mapper.activity is activity  # Until it changes.
        assert activity.values.max() > 0
        assert ((activity.packet[:2] >= 0) & (activity.packet[:2] <= activity.size)).all()


def test_what_a_batch_does_single_ones_do(name):
    count = 3
    batch, singles = make_mappers(name, count), [make_mapper(name) for _ in range(count)]
    assert isinstance(batch, MapperBatch)
    assert batch.recognises_places == isinstance(singles[0], PlaceMemory)
    assert (batch.activity(0) is not None) == isinstance(singles[0], AttractorNetwork)
    added = np.zeros(count, np.int64)
    for row, single in enumerate(singles):
        batch.reset(row, np.random.default_rng(row))
        single.reset(np.random.default_rng(row))
    for number, reading in enumerate(readings()):
        rows = np.arange(count)[: 1 + number % count]
        many = Readings(
            stamps=np.full(count, reading.stamp),
            motions=np.tile(reading.motion, (count, 1)),
            laser=LASER,
            ranges=np.tile(reading.laser.ranges, (count, 1)),
            sonar=SONAR,
            echoes=np.tile(reading.sonar.ranges, (count, 1)),
            scenes=np.full(count, reading.scene),
            compasses=np.full(count, reading.compass),
        )
        batch.update(rows, many)
        for row in rows.tolist():
            added[row] += singles[row].update(reading)
    for row, single in enumerate(singles):
        estimate = single.estimate
        np.testing.assert_array_equal(batch.poses[row], estimate.pose)
        np.testing.assert_array_equal(batch.homes_in_map[row], estimate.home)
        matched = -1 if estimate.matched_reading is None else estimate.matched_reading
        batch.match_readings(np.array([row]))
        assert batch.matched_readings[row] == matched
        assert batch.is_recognised[row] == (matched >= 0)
        assert batch.is_lost[row] == (not estimate.localised)
        assert batch.map_versions[row] == estimate.map_version
        assert batch.updates[row] == estimate.updates >= added[row]
        assert batch.segment_counts[row] == estimate.segments == len(single.snapshot().segments)
        assert map_to_geojson(batch.snapshot(row)) == map_to_geojson(single.snapshot())
        twin = make_mappers(name, 1)
        twin.restore(0, batch.state(row))
        for mine, theirs in (
            (twin.poses[0], batch.poses[row]),
            (twin.is_recognised[0], batch.is_recognised[row]),
            (twin.is_lost[0], batch.is_lost[row]),
        ):
            np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize(("name", "is_looped"), [("odometry", False), ("association", True)])
def test_the_way_travelled_stands_in_where_no_way_home_is_known(name, is_looped):
    batch = make_mappers(name, 1)
    assert isinstance(batch, LoopedMappers) == is_looped
    for reading in readings():
        batch.update(
            np.zeros(1, np.int64),
            Readings(
                stamps=np.zeros(1),
                motions=reading.motion[None],
                laser=LASER,
                ranges=reading.laser.ranges[None],
            ),
        )
    batch.find_ways(np.zeros(1, np.int64))
    assert np.isnan(batch.ways_home[0, :6]).all()
    assert batch.ways_home[0, 6] == pytest.approx(4.4)
    other = make_mappers(name, 1)
    other.restore(0, batch.state(0))
    assert other.ways_home[0, 6] == batch.ways_home[0, 6]
    assert other.updates[0] == batch.updates[0]


def test_a_place_is_matched_with_a_reading_of_an_earlier_visit():
    """There and back along the corridor: the topological mapper's places are half a metre wide."""
    mapper = make_mapper("tests.core.mappers.topological:topological")
    steps = [np.array((0.4, 0, 0))] * 20 + [np.array((0, 0, np.pi))] + [np.array((0.4, 0, 0))] * 20
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3)))
    for step in steps:
        mapper.update(Reading(stamp=0.0, motion=step))
    assert mapper.estimate.matched_reading == 0
    assert require(mapper, PlaceMemory).place_at(0) == mapper.estimate.place == 0
