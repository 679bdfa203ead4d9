"""RatSLAM as a whole: round a square, and where its input is bad."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.evaluation.trajectory import align
from albot_core.geometry.poses import compose, transform_points
from albot_core.mappers.ratslam.config import (
    CorrectionConfig,
    PoseCellConfig,
    RatSlamConfig,
)
from albot_core.mappers.ratslam.events import RELOCALISED, SEEDED
from albot_core.mappers.ratslam.mapper import RatSlam
from albot_core.mappers.registry import make_mapper
from albot_core.maps.layers import PlaceGraph, TrajectoryLayer
from albot_core.sensing.reading import Reading
from tests.core.mappers.ratslam.lap import STEP, lead, readings, true_laps

LAPS = 6


def scenes(**parts) -> RatSlam:
    mapper = make_mapper("ratslam-scenes", config=replace(RatSlamConfig.scenes(), **parts))
    assert isinstance(mapper, RatSlam)
    return mapper


def error(mapper: RatSlam, truth: np.ndarray) -> float:
    """Root mean squared distance of the experiences from where they were made (m)."""
    at = truth[mapper.experiences.experiences.rows("reading"), :2]
    poses = mapper.experiences.poses[:, :2]
    off = transform_points(align(poses, at), poses) - at
    return float(np.sqrt((off**2).sum(axis=1).mean()))


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return true_laps(LAPS)


@pytest.mark.parametrize("degrees", [0.0, 1.5, 3.0, 6.0, -6.0, 7.5])
def test_a_loop_closes_under_a_bias(truth, degrees):
    """At 7.5 °/s a lap of 48 s is a whole turn too much."""
    bias = np.radians(degrees)
    mapper, uncorrected = scenes(), scenes(correction=CorrectionConfig(passes=0))
    for each in (mapper, uncorrected):
        lead(each, truth, bias, false=0.05)
    assert error(mapper, truth) < 0.5
    if degrees:
        assert error(uncorrected, truth) > 5 * error(mapper, truth)
    if degrees not in (0.0, 7.5):  # With whole turns a lap the pose cells meet themselves.
        assert sum(event.kind == RELOCALISED for event in mapper.events) >= LAPS // 2
    # The heading turns once a lap as it does in truth.
    assert np.ptp(mapper.experiences.poses[:, 2]) < 3 * np.pi


def test_what_waits_to_be_learned_is_forgotten_where_it_is_relocalised(truth):
    """It was learned about cells where the robot was not."""
    mapper, relocalised = scenes(), 0
    for reading in readings(truth[: 2 * len(truth) // LAPS], 0.05, np.random.default_rng(0)):
        known = len(mapper.events)
        mapper.update(reading)
        if any(event.kind == RELOCALISED for event in mapper.events[known:]):
            relocalised += 1
            assert (mapper.state()["waiting_numbers"][:, 1] == mapper._position.way).all()
    assert relocalised


def test_the_map_stops_growing(truth):
    mapper, counts = scenes(), []
    rng = np.random.default_rng(0)
    for k, reading in enumerate(readings(truth, np.radians(3.0), rng)):
        mapper.update(reading)
        if k % (len(truth) // LAPS) == 0:
            counts.append(mapper.experiences.count)
    assert counts[3] > 20
    assert mapper.experiences.count - counts[3] <= 2


def test_what_it_recognises_was_there(truth):
    mapper = scenes()
    rng, claims = np.random.default_rng(0), []
    for k, reading in enumerate(readings(truth, np.radians(1.5), rng, 0.05)):
        mapper.update(reading)
        matched = mapper.estimate.matched_reading
        if matched is not None:
            claims.append(np.hypot(*(truth[k] - truth[matched])[:2]))
    assert len(claims) > 0.5 * len(truth)
    assert np.mean(np.array(claims) < 1.5) > 0.98


def test_matches_are_the_active_experiences_of_earlier_visits(truth):
    mapper, restored = scenes(), scenes()
    stream = readings(truth[: len(truth) // 2], np.radians(1.5), np.random.default_rng(0), 0.05)
    matched = 0
    for k, reading in enumerate(stream):
        mapper.update(reading)
        matches, estimate = mapper.place_matches(3), mapper.estimate
        if estimate.matched_reading is None:
            assert not len(matches)
            continue
        assert matches[0, 5] == estimate.matched_reading
        np.testing.assert_array_equal(matches[:, 0], 1.0)
        assert matches[0, 1] == pytest.approx(mapper.packet.share)
        assert (matches[:, 1] + matches[:, 2] <= 1.0 + 1e-9).all()
        made = mapper.corrected_poses()[estimate.matched_reading]
        np.testing.assert_allclose(matches[0, 3:5], made[:2])
        if (matched := matched + 1) % 50 == 1:
            restored.restore(mapper.state())
            np.testing.assert_array_equal(restored.place_matches(3), matches, err_msg=str(k))
    assert matched > 100


def test_a_wrong_scene_now_and_then_moves_nothing(truth):
    right, misled = scenes(), scenes()
    lead(right, truth, 0.0)
    lead(misled, truth, 0.0, false=0.05)
    assert error(misled, truth) < error(right, truth) + 0.1


def test_the_way_home_is_the_quickest(truth):
    mapper = scenes()
    lap = len(truth) // LAPS
    lead(mapper, truth[: lap + 3 * lap // 4], 0.0)
    way = mapper.way_home
    assert np.isnan(way[:4]).all()
    assert way[6] == pytest.approx(5.0, abs=1.2)  # On over the last side, not back over three.
    ahead = way[4:6] - mapper.estimate.pose[:2]
    assert 1.0 < np.hypot(*ahead) < 4.0
    assert np.hypot(*way[4:6]) < np.hypot(*mapper.estimate.pose[:2])
    corner = transform_points(mapper.estimate.pose, np.zeros(2))
    assert mapper.way_to(corner)[6] < 1.0
    opposite = compose(np.array((0.0, 0.0, 0.0)), np.array((5.0, 5.0, 0.0)))[:2]
    assert mapper.way_to(opposite)[6] == pytest.approx(5.0, abs=0.3)


def test_its_map_is_places_transitions_and_the_way(truth):
    mapper = scenes()
    lead(mapper, truth[: len(truth) // 3], 0.0)
    graph = mapper.snapshot().layer(PlaceGraph)
    way = mapper.snapshot().layer(TrajectoryLayer)
    assert graph is not None
    assert way is not None
    assert len(graph.nodes) == mapper.experiences.count
    assert len(graph.edges) == mapper.experiences.links.count
    assert (graph.home, graph.current) == (0, mapper.estimate.place)
    assert np.abs(way.poses[:, 2]).max() <= np.pi
    assert [edge.time for edge in graph.edges] == mapper.experiences.links.rows("time").tolist()
    assert sum(edge.time or 0.0 for edge in graph.edges) > 10.0
    for edge in graph.edges[:5]:
        end = compose(graph.node(edge.source).pose, edge.motion)
        np.testing.assert_allclose(end[:2], graph.node(edge.target).pose[:2], atol=0.5)


def test_corrected_poses_are_those_of_the_readings(truth):
    mapper = scenes()
    lead(mapper, truth, np.radians(3.0))
    poses = mapper.corrected_poses()
    off = transform_points(align(poses[:, :2], truth[:, :2]), poses[:, :2]) - truth[:, :2]
    assert np.sqrt((off**2).sum(axis=1).mean()) < 0.5
    np.testing.assert_allclose(poses[-1], mapper.estimate.pose, atol=1e-9)


def test_it_goes_on_as_if_never_stopped_after_it_was_relocalised(truth):
    whole, resumed = scenes(), scenes()
    stream = list(readings(truth, np.radians(6.0), np.random.default_rng(0), 0.05))
    half = len(stream) // 2
    for reading in stream[:half]:
        whole.update(reading)
    assert whole.events
    resumed.restore(whole.state())
    for reading in stream[half:]:
        whole.update(reading)
        resumed.update(reading)
    for name, array in whole.state().items():
        np.testing.assert_array_equal(resumed.state()[name], array, err_msg=name)
    assert resumed.events == whole.events
    assert all(str(event).startswith("reading ") for event in whole.events)


def straight(mapper: RatSlam, scene, count: int = 300, step: float = 0.1) -> None:
    for k in range(count):
        motion = np.array((step, 0.0, 0.0))
        mapper.update(Reading(stamp=0.1 * k, motion=motion, scene=scene(k)))


@pytest.mark.parametrize(("scene", "views"), [(lambda k: None, 0), (lambda k: k // 10, 30)])
def test_without_any_scene_seen_before_it_integrates_its_path(scene, views):
    mapper = scenes()
    straight(mapper, scene)
    np.testing.assert_allclose(mapper.estimate.pose, (29.9, 0, 0), atol=1e-6)
    assert mapper.views == views
    assert mapper.estimate.matched_reading is None
    assert not mapper.events


@pytest.mark.parametrize("pace", [0.0, -0.1])
def test_stamps_that_stand_still_or_run_backwards_are_survived(pace, truth):
    mapper = scenes()
    for k, reading in enumerate(readings(truth[: len(truth) // 2], 0.0, np.random.default_rng(0))):
        mapper.update(replace(reading, stamp=pace * k))
    assert (mapper.experiences.links.rows("time") >= 0).all()
    assert np.isfinite(mapper.way_home[6])
    assert error(mapper, truth) < 0.5


def test_one_scene_alone_takes_it_nowhere():
    """The view tires; the path is integrated. It is shorter than the network is wide."""
    mapper = scenes()
    straight(mapper, lambda k: 7, 120)
    np.testing.assert_allclose(mapper.estimate.pose, (11.9, 0, 0), atol=0.05)
    assert not mapper.events
    assert mapper.views == 1


def test_without_odometry_it_stays():
    mapper = scenes()
    straight(mapper, lambda k: k // 10, step=0.0)
    np.testing.assert_array_equal(mapper.estimate.pose, np.zeros(3))
    assert mapper.experiences.count == 1


@pytest.mark.parametrize("step", [5.0, 1e6, 1e150])
def test_motion_faster_than_the_network_is_wide_is_survived(step):
    mapper = scenes()
    straight(mapper, lambda k: k // 3, 60, step)
    assert all(
        np.isfinite(array).all() for name, array in mapper.state().items() if "time" not in name
    )


def test_a_network_that_dies_is_seeded_and_says_so():
    mapper = scenes(pose_cells=PoseCellConfig(global_inhibition=0.5))
    straight(mapper, lambda k: k // 10, 30)
    assert mapper.events
    assert {event.kind for event in mapper.events} == {SEEDED}
    assert "seeded anew" in str(mapper.events[0])
    np.testing.assert_allclose(mapper.estimate.pose, (2.9, 0, 0), atol=0.5)


def test_times_of_transitions_are_those_of_the_stamps(truth):
    mapper = scenes()
    lead(mapper, truth[:60], 0.0)
    assert mapper.experiences.links.rows("time").sum() == pytest.approx(
        STEP * (mapper.experiences.experiences.rows("reading")[-1]), abs=STEP
    )


def test_a_config_that_cannot_be_is_refused():
    with pytest.raises(InputError, match=r"RatSlamConfig.ahead: expected a positive number"):
        RatSlamConfig(ahead=0.0)
    with pytest.raises(InputError, match=r"config, correction.rate: expected a number within"):
        make_mapper("ratslam", config={"correction": {"rate": 1.0}})
    for part, field, value in (("correction", "form", "slow"), ("sees", "", "sonar")):
        with pytest.raises(InputError, match=f"mapper ratslam, config, {part}"):
            make_mapper("ratslam", config={part: {field: value} if field else value})
