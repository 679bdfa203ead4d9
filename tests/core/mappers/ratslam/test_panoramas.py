"""Panoramas: what a laser saw of late, known again from the same place whichever way it looks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, transform_points
from albot_core.geometry.types import Segments
from albot_core.mappers.ratslam.config import PanoramaConfig, RatSlamConfig
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.mappers.ratslam.motions import after, before, beyond
from albot_core.mappers.ratslam.panorama_kernels import compare_turned
from albot_core.mappers.ratslam.panoramas import Panoramas
from tests.core.mappers.ratslam.corridor import CORRIDOR, SQUARE, drive, scan, there_and_back

NOWHERE = (0.0, 0.0, 0.0)
MOTIONS = st.tuples(*[st.floats(-10, 10)] * 3)


def spin(
    place: tuple[float, float],
    heading: float,
    walls: Segments = SQUARE,
    known: Panoramas | None = None,
) -> Panoramas:
    """Look round on the spot, and end with this heading; with the templates of another robot."""
    panoramas, turn = Panoramas(PanoramaConfig()), np.radians(30.0)
    for k in range(-12, 1):
        laser = scan(walls, np.array((*place, heading + k * turn)))
        panoramas.look(laser, (0.0, 0.0, turn), -1, NOWHERE)
    if known is not None:
        theirs = {key: rows for key, rows in known.state().items() if key.startswith("templates")}
        panoramas._set_state(panoramas.state() | theirs)
    return panoramas


def home(walls: Segments = SQUARE) -> Panoramas:
    """One that has learned the view at the origin."""
    panoramas = spin((0.0, 0.0), 0.0, walls)
    assert panoramas.learn() == 0
    return panoramas


@given(MOTIONS, MOTIONS)
def test_motions_are_composed_and_taken_apart(first, last):
    whole = after(first, last)
    np.testing.assert_allclose(before(whole, last), first, atol=1e-9)
    np.testing.assert_allclose(beyond(first, whole), last, atol=1e-9)
    np.testing.assert_allclose(
        relative(compose(np.array(first), np.array(last)), np.array(whole)), 0.0, atol=1e-9
    )


@pytest.mark.parametrize("degrees", [0.0, 90.0, 180.0, 270.0, 33.0])
def test_a_square_room_is_one_view_at_every_heading(degrees):
    heading = np.radians(degrees)
    panoramas = spin((0.0, 0.0), heading, known=home())
    (seen,) = panoramas.matched_views((), np.ones(1, np.bool_))
    assert seen.view == 0
    assert seen.score > 0.95
    np.testing.assert_allclose(seen.offset[:2], 0.0, atol=0.02)
    off = (seen.offset[2] - heading + np.pi) % (2 * np.pi) - np.pi
    assert abs(off) < np.radians(0.5)


@settings(max_examples=15)
@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(-np.pi, np.pi))
def test_a_view_tells_where_the_robot_is_in_it(x, y, heading):
    panoramas = spin((x, y), heading, CORRIDOR, home(CORRIDOR))
    guess = (x + 0.2, y - 0.2, heading + 0.1)
    (seen,) = panoramas.matched_views([(0, guess)], np.zeros(1, np.bool_))
    np.testing.assert_allclose(seen.offset, (x, y, heading), atol=0.05)


def test_another_room_is_not_that_view():
    panoramas = spin((5.0, 0.0), 0.0, CORRIDOR, home())
    assert panoramas.matched_views((), np.ones(1, np.bool_)) == []


def test_profiles_are_compared_over_all_turns():
    rng = np.random.default_rng(0)
    bins, overlap = 12, 6
    for _ in range(30):
        mine, theirs = rng.integers(0, 800, (2, bins)).astype(np.int32)
        seen, known = (rng.random((2, bins)) < 0.8).astype(np.int32)
        differences, turns = np.empty((1, 2)), np.empty((1, 2), np.int64)
        compare_turned(
            (np.tile(mine, 2), np.tile(seen, 2)),
            (np.tile(theirs, 2)[np.newaxis], np.tile(known, 2)[np.newaxis]),
            1,
            overlap,
            differences,
            turns,
        )
        brute = np.full(bins, np.inf)
        for turn in range(bins):
            both = (seen * np.roll(known, -turn)).astype(bool)
            if both.sum() >= overlap:
                brute[turn] = np.abs(mine - np.roll(theirs, -turn))[both].mean()
        assert differences[0, 0] == pytest.approx(brute.min())
        if np.isfinite(brute.min()):
            assert brute[turns[0, 0]] == brute.min()


def test_the_odometer_is_set_right_by_what_is_seen():
    panoramas, config = home(CORRIDOR), PanoramaConfig()
    laser = scan(CORRIDOR, np.array((0.3, 0.1, 0.2)))
    moved, offset, score = panoramas.look(laser, (0.35, 0.05, 0.3), 0, NOWHERE)
    assert score > 0.9
    np.testing.assert_allclose(moved, (0.3, 0.1, 0.2), atol=0.01)
    np.testing.assert_allclose(offset, moved, atol=1e-9)
    # What is seen is not believed where it is far from what the odometer says.
    far = config.max_deviation + config.max_deviation_share
    motion = (0.3, 0.1, 0.2 + 1.6 * far)
    moved, _, score = home(CORRIDOR).look(laser, motion, 0, NOWHERE)
    assert moved == motion
    assert score == 0.0


@pytest.mark.parametrize(("scale", "bias"), [(1.0, 0.0), (1.05, 0.03), (0.95, -0.03)])
def test_a_corridor_driven_both_ways_is_one_representation(scale, bias):
    """The laser sees 180°: on the way back it shows the other half of each place."""
    truth, mapper = there_and_back(), RatSlam(RatSlamConfig())
    counts, wrong, numbers = [], 0, set()
    for k, reading in enumerate(drive(CORRIDOR, truth, np.random.default_rng(0), scale, bias)):
        mapper.update(reading)
        counts.append(mapper.experiences.count)
        matched = mapper.estimate.matched_reading
        wrong += matched is not None and np.hypot(*(truth[k] - truth[matched])[:2]) > 1.5
        matches = mapper.place_matches(3)
        assert matches[:1, 5].tolist() == [] if matched is None else [matched]
        for there in truth[matches[:, 5].astype(int)]:
            assert np.hypot(*(truth[k] - there)[:2]) < 1.7
        assert ((matches[:, 0] >= mapper.config.experiences.min_score) & (matches[:, 0] <= 1)).all()
        numbers.add(len(matches))
    middle = len(truth) // 2
    assert counts[middle] >= 8
    assert counts[-1] <= counts[middle] + 2
    assert wrong == 0
    assert {0, 1, 2} <= numbers
    assert mapper.estimate.matched_reading is not None
    assert truth[mapper.estimate.matched_reading, 0] < 1.0
    # Home is the first experience, and the way there was measured twice.
    np.testing.assert_allclose(mapper.estimate.pose[:2], truth[-1, :2], atol=0.15)
    assert mapper.way_home[6] < 1.0
    poses = mapper.corrected_poses()
    assert np.sqrt(((poses - truth)[:, :2] ** 2).sum(axis=1).mean()) < 0.15 + 18 * abs(scale - 1)


@settings(max_examples=4)
@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-np.pi, np.pi)))
def test_a_world_that_is_moved_and_turned_has_the_same_map(frame):
    truth = there_and_back(4.0, 0.2)
    ends = transform_points(np.array(frame), CORRIDOR.reshape(-1, 2)).reshape(-1, 4)
    moved = compose(np.array(frame), truth)
    one, other = RatSlam(RatSlamConfig()), RatSlam(RatSlamConfig())
    for mapper, walls, path in ((one, CORRIDOR, truth), (other, ends, moved)):
        for reading in drive(walls, path, np.random.default_rng(0)):
            mapper.update(reading)
    assert one.experiences.count == other.experiences.count
    # Beams on the edge between two directions fall to either side by rounding.
    off = relative(one.corrected_poses(), other.corrected_poses())
    assert np.abs(off).max() < 0.02


def test_a_state_that_no_mapper_made_is_refused():
    mapper = RatSlam(RatSlamConfig())
    for reading in drive(CORRIDOR, there_and_back(3.0), np.random.default_rng(0)):
        mapper.update(reading)
    state = mapper.state()
    RatSlam(RatSlamConfig()).restore(state)
    for name, wrong in (
        ("scans.count", 400),
        ("scans.points", np.nan),
        ("templates.ranges", -1.0),
        ("templates.known", 2),
        ("templates.points", np.inf),
        ("experiences.view", 0),
    ):
        damaged = {key: array.copy() for key, array in state.items()}
        damaged[name][:] = wrong
        with pytest.raises(InputError):
            RatSlam(RatSlamConfig()).restore(damaged)
    for column, name in enumerate(("view", "cell")):
        damaged = {key: array.copy() for key, array in state.items()}
        damaged["waiting"][-1, column] = 10**6
        with pytest.raises(InputError, match=rf"waiting: .* {name}s in"):
            RatSlam(RatSlamConfig()).restore(damaged)
    fewer = {k: a[:-1] if k.startswith("templates") else a for k, a in state.items()}
    with pytest.raises(InputError, match="templates: expected one an experience"):
        RatSlam(RatSlamConfig()).restore(fewer)


def test_bins_divide_the_circle():
    with pytest.raises(InputError, match=r"PanoramaConfig.bins: expected a divisor of 180"):
        PanoramaConfig(bins=50)
