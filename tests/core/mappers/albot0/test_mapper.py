"""Albot0 on its way through a row of rooms and home, and what it does with bad input."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.mappers.albot0.config import Albot0Config
from albot_core.mappers.albot0.localisation import LocalisationConfig
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.paths import SAMPLE, PathConfig
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, PlaceMemory, require
from albot_core.sensing.reading import Reading, SonarGeometry, SonarScan
from tests.core.mappers.albot0.sonar_scenes import driven, readings, row_of_rooms

WALLS, BOUNDS = row_of_rooms()
WAY = driven((0.5, 0.0), (36.5, 0.0), (0.5, 0.0))
OUTWARD = int(np.argmax(WAY[:, 0] >= 36.5)) + 1
TAKEN = readings(WALLS, WAY)
PAPER = Albot0Config(localisation=LocalisationConfig(cues=("distance", "orientation")))
LETTER = Albot0Config.paper()
EXTENT = Albot0Config(localisation=LocalisationConfig(cues=("extent", "orientation")))


def led(count: int, config: Albot0Config | None = None) -> Albot0:
    mapper = Albot0(config)
    for reading in TAKEN[:count]:
        mapper.update(reading)
    return mapper


def true_place(x: float) -> int:
    """The part of the row of rooms that the robot is in."""
    return int(np.searchsorted(BOUNDS[1:-1], x))


def test_on_the_way_out_each_room_and_corridor_is_an_asr():
    mapper = led(OUTWARD)
    graph = mapper.snapshot().place_graph
    assert [node.label for node in graph.nodes] == ["A0", "A1", "A2", "A3", "A4"]
    begins = [node.pose[0] + 0.5 for node in graph.nodes]
    np.testing.assert_allclose(begins[1:], BOUNDS[1:-1], atol=0.8)
    assert graph.links == ((0, 1), (1, 2), (2, 3), (3, 4))
    assert graph.current == mapper.estimate.place == 4
    assert graph.home == 0
    assert not mapper.is_returning
    assert mapper.estimate.matched_reading is None
    for edge in graph.edges:
        assert graph.edges[edge.reverse].reverse == graph.edges.index(edge)


def test_the_place_of_a_reading_is_the_asr_where_it_was_taken():
    mapper = led(OUTWARD)
    places = np.array([mapper.place_at(k) for k in range(OUTWARD)])
    assert places[0] == 0
    assert places[-1] == 4
    changes = 1 + np.flatnonzero(np.diff(places))
    begins = [0.5 + node.pose[0] for node in mapper.snapshot().place_graph.nodes[1:]]
    np.testing.assert_allclose(WAY[changes, 0], begins, atol=0.15)


def test_the_surfaces_are_the_walls():
    surfaces = led(OUTWARD).snapshot().segments
    begins, ends = 0.5 + surfaces[:, 0::2].min(axis=1), 0.5 + surfaces[:, 0::2].max(axis=1)
    # A step half in a room and half in a corridor is as wide as their mean.
    is_between = ((begins[:, None] < BOUNDS) & (ends[:, None] > BOUNDS)).any(axis=1)
    across = np.unique(np.abs(surfaces[~is_between, 1]).round(6))
    np.testing.assert_allclose(across, (1.0, 3.0), atol=1e-6)  # 4 m is as far as the sonars reach.


def test_the_robot_notices_that_it_has_turned_round():
    noticed = next(k for k in range(OUTWARD, len(TAKEN)) if led(k).is_returning)
    assert 36.5 - WAY[noticed - 1, 0] < 0.6
    assert led(noticed).estimate.place == 4
    config = Albot0Config(paths=PathConfig(detects_return=False))
    assert not led(len(TAKEN), config).is_returning


@pytest.mark.parametrize("is_told", [True, False])
def test_on_the_way_home_it_knows_in_which_asr_it_is(is_told):
    mapper = led(OUTWARD, EXTENT)
    if is_told:
        mapper.begin_return()
    right = []
    for pose, reading in zip(WAY[OUTWARD:], TAKEN[OUTWARD:], strict=True):
        if mapper.update(reading) and mapper.is_returning:
            assert mapper.confidences.max() <= 1.0
            right.append(mapper.estimate.place == true_place(pose[0]))
            matched = mapper.estimate.matched_reading
            if matched is not None:
                assert mapper.estimate.localised
                assert true_place(WAY[matched, 0]) == mapper.estimate.place
    assert np.mean(right) > 0.8
    assert mapper.estimate.place == 0
    assert mapper.estimate.localised


def test_by_the_papers_cue_it_believes_in_an_asr_from_its_middle_to_the_middle_of_the_next():
    mapper = led(OUTWARD, PAPER)
    middles = [sum(pair) / 2 for pair in pairwise(BOUNDS)]
    right = []
    for pose, reading in zip(WAY[OUTWARD:], TAKEN[OUTWARD:], strict=True):
        if mapper.update(reading) and mapper.is_returning:
            lagging = min(int(np.searchsorted(middles, pose[0])), 4)
            right.append(mapper.estimate.place == lagging)
    assert np.mean(right) > 0.8


def test_at_the_border_of_two_asrs_it_is_not_sure():
    events = led(len(TAKEN)).events
    borders = [event for event in events if not event.is_sure]
    assert all("border" in str(event) for event in borders)
    assert len(str(events[0]).splitlines()) == 1


def test_a_second_way_home_begins_with_all_that_was_driven_as_the_way_out():
    mapper = led(len(TAKEN))
    before = mapper.snapshot().place_graph
    mapper.begin_return()
    assert len(mapper.snapshot().place_graph.nodes) > len(before.nodes)
    assert mapper.estimate.place == len(mapper.snapshot().place_graph.nodes) - 1


def test_a_way_out_of_a_single_asr():
    """A corridor: there is only one place to be in."""
    mapper = Albot0()
    taken = readings(WALLS, driven((0.5, 0.0), (7.0, 0.0), (0.5, 0.0)))
    for reading in taken:
        mapper.update(reading)
        assert mapper.estimate.place == 0
        assert mapper.estimate.localised
    assert mapper.is_returning
    np.testing.assert_array_equal(mapper.confidences.shape, (1,))
    assert require(mapper, PlaceMemory).place_at(3) == 0


def test_a_robot_that_has_gone_nowhere_is_at_home():
    mapper = led(1)
    mapper.begin_return()
    assert not mapper.is_returning
    assert mapper.estimate.place == 0


def test_who_was_told_to_return_does_not_turn_round_again():
    """It comes back to its start, and turns there to go out again."""
    mapper = led(OUTWARD)
    mapper.begin_return()
    steps = len(mapper.geometric_maps[0].steps.lines)
    taken = readings(WALLS, driven((0.0, 0.0), (36.5, 0.0), (0.5, 0.0), (6.0, 0.0)))
    for reading in taken[OUTWARD:]:
        mapper.update(reading)
    assert mapper.is_returning
    assert len(mapper.geometric_maps[0].steps.lines) == steps


def test_the_way_home_leads_back_along_the_way_out():
    mapper = led(OUTWARD + 100)
    point = mapper.way_home[POINT]
    assert WAY[OUTWARD + 99, 0] - 3.0 < point[0] < WAY[OUTWARD + 99, 0]
    np.testing.assert_allclose(point[1], 0.0, atol=0.2)  # The corridor is 2 m wide.
    line = mapper.way_home[EXIT]
    assert line[0] == pytest.approx(line[2], abs=0.2)  # Across the way.
    assert np.isnan(led(len(TAKEN)).way_home[EXIT]).all()  # At home there is no exit before home.


def test_the_sonars_of_readings_are_needed():
    with pytest.raises(InputError, match="sonar ranges, which albot0 needs"):
        Albot0().update(Reading(stamp=0.0, motion=np.zeros(3), laser=None))


def test_a_world_without_walls_is_one_asr():
    mapper = Albot0()
    for reading in readings(WALLS + np.array((0, 90, 0, 90)), WAY[:200]):
        mapper.update(reading)
    assert len(mapper.snapshot().segments) == 0
    assert len(mapper.snapshot().place_graph.nodes) == 1


@pytest.mark.parametrize("count", [0, 1, 20, OUTWARD, OUTWARD + 100, len(TAKEN)])
def test_a_restored_mapper_goes_on_as_if_never_stopped(count):
    whole, resumed = led(count), Albot0()
    resumed.restore(whole.state())
    for reading in TAKEN[count : count + 60]:
        whole.update(reading)
        resumed.update(reading)
        assert whole.estimate.place == resumed.estimate.place
    for name, array in whole.state().items():
        np.testing.assert_array_equal(array, resumed.state()[name], err_msg=name)
    assert [str(event) for event in whole.events] == [str(event) for event in resumed.events]


STATE = led(OUTWARD + 100).state()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("pose", np.full(3, np.nan)),
        ("counts", np.array((1, 1, 1, 1))),
        ("counts", np.array((600, 1, 3, 1))),
        ("rng", np.zeros(5, np.uint64)),
        ("trail.past", STATE["trail.past"][1:]),
        ("trail.past", np.full_like(STATE["trail.past"], np.inf)),
        ("trail.weights", np.zeros_like(STATE["trail.weights"])),
        ("trail.lines", 2.0 * STATE["trail.lines"]),
        ("out.lines", np.full_like(STATE["out.lines"], 1e12)),
        ("out.lines", np.zeros_like(STATE["out.lines"])),
        ("out.widths", np.zeros_like(STATE["out.widths"])),
        ("out.echoes", np.full_like(STATE["out.echoes"], 1e9)),
        ("out.readings", STATE["out.readings"][::-1].copy()),
        ("home.lines", STATE["home.lines"][:1]),
        ("weights", np.array((0.9, 0.9))),
        ("weights", np.array((1.0,))),
        ("confidences", np.ones(2)),
        ("beliefs", np.full_like(STATE["beliefs"], 99)),
        ("beliefs", STATE["beliefs"][:0]),
        ("path.before", np.zeros(2)),
        ("path.samples", np.full((2, SAMPLE), 0.5)),
    ],
)
def test_a_damaged_state_is_refused(name, value):
    with pytest.raises(InputError):
        Albot0().restore(STATE | {name: value})


def check_confidences(mapper: Albot0) -> None:
    """The confidences are within [0, 1], and everything that is remembered is a number."""
    confidences = mapper.confidences
    assert ((confidences >= 0) & (confidences <= 1 + 1e-9)).all()
    for name, array in mapper.state().items():
        if name != "rng":
            assert np.isfinite(array.astype(np.float64)).all(), name


def test_a_journey_of_a_single_path_is_one_asr():
    mapper = Albot0()
    taken = readings(WALLS, driven((0.5, 0.0), (2.5, 0.0), (0.5, 0.0)))
    for reading in taken[:20]:
        mapper.update(reading)
    mapper.begin_return()
    assert mapper.geometric_maps[0].steps.begins.sum() == 1
    for reading in taken[20:]:
        mapper.update(reading)
    mapper.end_path()
    np.testing.assert_array_equal(mapper.confidences.shape, (1,))
    assert mapper.estimate.place == 0
    assert mapper.estimate.localised
    check_confidences(mapper)


def test_a_journey_without_surfaces_is_one_asr():
    mapper = Albot0()
    for reading in readings(np.empty((0, 4)), driven((0.0, 0.0), (9.0, 0.0), (0.0, 0.0))):
        mapper.update(reading)
    mapper.end_path()
    assert mapper.is_returning
    assert len(mapper.snapshot().segments) == 0
    np.testing.assert_array_equal(mapper.confidences.shape, (1,))
    assert mapper.estimate.place == 0
    check_confidences(mapper)


def test_the_way_home_may_be_sensed_by_another_robots_sonars():
    sides = SonarGeometry(bearings=(np.pi / 2, -np.pi / 2), places=((0.0, 0.1), (0.0, -0.1)))
    mapper = led(OUTWARD)
    mapper.begin_return()
    for reading in TAKEN[OUTWARD:]:
        scan = SonarScan(ranges=np.full(2, 0.9), geometry=sides)
        mapper.update(Reading(stamp=reading.stamp, motion=reading.motion, sonar=scan))
    mapper.end_path()
    assert mapper.estimate.place == 0
    check_confidences(mapper)


def moved_at(turned: int, jump: tuple[float, float, float]) -> list[Reading]:
    """The readings, of a robot whose odometer goes on in another frame after it turned round."""
    taken = list(TAKEN)
    motion = compose(np.array(jump, np.float64), taken[turned].motion)
    taken[turned] = replace(taken[turned], motion=motion)
    return taken


@settings(max_examples=5, deadline=None)
@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(-3.1, 3.1))
def test_the_paper_knows_its_asr_in_whatever_frame_it_comes_home(x, y, turn):
    """Nothing is carried over but the ASRs."""
    confidences = []
    for taken in (TAKEN, moved_at(OUTWARD, (x, y, turn))):
        mapper = Albot0(LETTER)
        for number, reading in enumerate(taken):
            if number == OUTWARD:
                mapper.begin_return()
            mapper.update(reading)
        mapper.end_path()
        confidences.append([event.confidence for event in mapper.events])
        assert np.isinf(mapper.way_home[TRAVEL])
        assert all(event.kept is None for event in mapper.events)
    # A path of 0.1 m steps is 3 m long, but for rounding: it ends at the same reading.
    np.testing.assert_allclose(*confidences, atol=1e-9)


@pytest.mark.parametrize("jump", [(0, 0, np.pi), (3, -5, np.pi / 2), (2, 1, -0.6), (0, 0, 0)])
def test_ours_finds_the_frame_of_the_way_home(jump):
    """It says so, and knows its ASR; where nothing is lost, it says that."""
    mapper, taken, right = Albot0(), moved_at(OUTWARD, jump), []
    for number, reading in enumerate(taken):
        if number == OUTWARD:
            mapper.begin_return()
        if mapper.update(reading) and mapper.is_returning:
            right.append(abs(mapper.estimate.place - true_place(WAY[number, 0])) <= 1)
    mapper.end_path()
    is_lost = any(jump)
    kept = mapper.events[-1].kept
    assert kept is not None
    assert (kept < 0.05) == is_lost
    assert ("found anew" in str(mapper.events[-1])) == is_lost
    assert np.mean(right) > 0.9
    assert mapper.estimate.place == 0
    check_confidences(mapper)


def test_a_frame_that_is_lost_without_echoes_is_defined():
    mapper = Albot0()
    taken = readings(np.empty((0, 4)), driven((0.0, 0.0), (9.0, 0.0), (0.0, 0.0)))
    for number, reading in enumerate(taken):
        if number == 91:
            mapper.begin_return()
            motion = compose(np.array((5.0, 5.0, 2.0)), reading.motion)
            mapper.update(replace(reading, motion=motion))
        else:
            mapper.update(reading)
    mapper.end_path()
    check_confidences(mapper)


def test_the_cue_way_needs_a_trail():
    with pytest.raises(InputError, match="other cues than way, which needs a trail"):
        Albot0Config(trail=None)
