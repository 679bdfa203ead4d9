"""Graph SLAM around a loop of corridors whose truth is known, and its graph against false edges."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("gtsam", reason="gtsam is not installed: the extra slam brings it")

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.mappers import registry
from albot_core.mappers.mapper import POINT, TRAVEL
from albot_core.mappers.registry import make_mapper
from albot_core.mappers.slam.graph_slam import Closure, GraphSlam
from albot_core.mappers.slam.graph_slam_config import ClosureConfig, GraphSlamConfig
from albot_core.mappers.slam.pose_graph import PoseGraph, invert_symmetric
from albot_core.maps.layers import OccupancyGridLayer
from tests.core.mappers.slam.rooms import reading_from


def _box(x: float, y: float, width: float, height: float) -> list[tuple[float, ...]]:
    return [
        (x, y, x + width, y),
        (x + width, y, x + width, y + height),
        (x + width, y + height, x, y + height),
        (x, y + height, x, y),
    ]


RING = np.array(
    [
        *_box(0, 0, 16, 12),
        *_box(2.5, 2.5, 11, 7),
        # Cupboards along the walls, so that no two stretches of corridor look the same.
        *_box(3.0, 0.0, 0.8, 0.4),
        *_box(9.0, 0.0, 1.5, 0.3),
        *_box(15.6, 3.0, 0.4, 1.2),
        *_box(11.0, 11.5, 1.0, 0.5),
        *_box(4.0, 11.6, 0.5, 0.4),
        *_box(0.0, 7.0, 0.3, 0.9),
    ],
    float,
)
"""A ring of corridors 2.5 m wide."""


def laps(count: float, step: float = 0.4) -> np.ndarray:
    """Poses of a robot that drives around the ring."""
    corners = np.array(((1.25, 1.25), (14.75, 1.25), (14.75, 10.75), (1.25, 10.75)))
    poses = [np.array((1.25, 1.25, 0.0))]
    for k in range(int(4 * count)):
        bearing = k * np.pi / 2
        way = corners[(k + 1) % 4] - corners[k % 4]
        length = np.hypot(*way)
        if k:
            poses += [np.array((*corners[k % 4], bearing - np.pi / 2 + t)) for t in (0.5, 1.1)]
        for along in np.arange(0.0 if k else step, length - 0.2, step):
            poses.append(np.array((*(corners[k % 4] + along * way / length), bearing)))
    return np.array(poses)


POSES = laps(1.5)


def drive(mapper: GraphSlam, poses: np.ndarray, seed: int, turn: float, scale: float) -> None:
    """Lead a mapper along poses by an odometer that errs."""
    rng = np.random.default_rng(seed)
    for k, pose in enumerate(poses):
        motion = np.zeros(3) if k == 0 else relative(poses[k - 1], pose)
        motion[:2] *= rng.uniform(1 - scale, 1 + scale)
        motion[2] += rng.uniform(-turn, turn)
        mapper.update(reading_from(pose, motion, RING))


@pytest.fixture(scope="module")
def driven() -> GraphSlam:
    mapper = GraphSlam()
    drive(mapper, POSES, 0, np.radians(15), 0.1)
    return mapper


def off(poses: np.ndarray) -> np.ndarray:
    """Distances of poses from the truth (m)."""
    return np.hypot(*(poses - relative(POSES[0], POSES))[:, :2].T)


def test_the_loop_is_closed_and_all_poses_are_corrected(driven):
    assert driven.graph.closures > 5
    assert off(driven.corrected_poses()).max() < 0.1
    estimate = driven.estimate
    assert off(estimate.pose[None].repeat(len(POSES), 0))[-1] < 0.1
    # It knows that it is where it was a lap ago.
    there = POSES[estimate.matched_reading]
    assert np.hypot(*(there - POSES[-1])[:2]) < 0.6


def test_a_match_is_a_closure_at_the_same_place(driven):
    matches = driven.place_matches(3)
    assert matches.shape == (1, 6)
    score, probability, ambiguity, *place, reading = matches[0]
    assert reading == driven.estimate.matched_reading
    assert score > ClosureConfig().response
    assert 0.05 < probability <= 1.0
    assert ambiguity == 0.0
    there = relative(POSES[0], POSES[int(reading)])
    assert np.hypot(*(there[:2] - place)) < 0.1
    resumed = GraphSlam()
    resumed.restore(driven.state())
    np.testing.assert_array_equal(resumed.place_matches(3), matches)


def test_the_probability_is_that_of_a_chi_square_test(monkeypatch):
    """Of errors of three dimensions, the estimate's and the closure's, in closed form."""
    spreads, deviations = [], PoseGraph.deviations
    monkeypatch.setattr(
        PoseGraph, "deviations", lambda *a: spreads.append(deviations(*a)) or spreads[-1]
    )
    mapper, rng = (
        GraphSlam(GraphSlamConfig(surprise=1e9, most_waiting=10**6)),
        np.random.default_rng(0),
    )
    probabilities = []
    for k, pose in enumerate(POSES):
        motion = relative(POSES[max(k - 1, 0)], pose) * rng.uniform(0.9, 1.1, 3)
        mapper.update(reading_from(pose, motion, RING))
        if not len(matches := mapper.place_matches(1)):
            continue
        graph, (spread, turn) = mapper.graph, spreads[-1]
        found = compose(graph.poses[graph.ends[-1][0]], graph.motions[-1])
        off = relative(found, graph.poses[-1])
        estimate = np.diag((spread**2 / 2, spread**2 / 2, turn**2))
        errors = estimate + np.linalg.inv(graph.information[-1])
        x = float(off @ np.linalg.solve(errors, off))
        tail = math.erfc(math.sqrt(x / 2)) + math.sqrt(2 * x / math.pi) * math.exp(-x / 2)
        assert matches[0, 1] == pytest.approx(tail)
        probabilities.append(tail)
    assert len(probabilities) > 20
    assert np.quantile(probabilities, 0.05) > 0.05


def test_the_ambiguity_is_that_of_another_closure_that_puts_the_robot_elsewhere(driven):
    mapper = GraphSlam()
    mapper.restore(driven.state())
    here, beside, away = np.zeros(3), np.array((0.3, 0.0, 2.0)), np.array((4.0, 0.0, 0.0))
    mapper._match_places(
        [
            Closure(keyframe=4, pose=here, distance=0.2, response=0.9, probability=0.8),
            Closure(keyframe=9, pose=beside, distance=0.4, response=0.8, probability=0.7),
            Closure(keyframe=12, pose=away, distance=2.0, response=0.95, probability=0.25),
            Closure(keyframe=15, pose=away, distance=0.1, response=0.7, probability=0.1),
        ]
    )
    matches = mapper.place_matches(3)
    keyframes = driven.state()["keyframes.reading"]
    assert matches[:, 5].tolist() == keyframes[[4, 9, 15]].tolist()
    np.testing.assert_array_equal(
        matches[:, :3], ((0.9, 0.8, 0.25), (0.8, 0.7, 0.25), (0.7, 0.1, 0.8))
    )
    assert len(mapper.place_matches(1)) == 1


def test_a_loop_closed_from_another_place_matches_no_reading():
    closures = replace(ClosureConfig(), same_place=1e-3)
    mapper = GraphSlam(replace(GraphSlamConfig(), closures=closures))
    drive(mapper, POSES, 0, np.radians(15), 0.1)
    assert mapper.graph.closures > 5
    assert mapper.estimate.matched_reading is None


def test_the_grid_is_drawn_of_the_corrected_poses(driven):
    layer = driven.snapshot().layer(OccupancyGridLayer)
    centres = layer.centres(0.65)
    walls = compose(POSES[0], np.c_[centres, np.zeros(len(centres))])
    ends = RING[:, 2:] - RING[:, :2]
    share = ((walls[:, None, :2] - RING[:, :2]) * ends).sum(-1) / (ends**2).sum(-1)
    nearest = RING[:, :2] + np.clip(share, 0, 1)[..., None] * ends
    away = np.hypot(*np.moveaxis(walls[:, None, :2] - nearest, -1, 0)).min(axis=1)
    assert len(away) > 500
    assert np.quantile(away, 0.95) < 0.1


def test_a_snapshot_searches_the_likeliest_poses_once(monkeypatch):
    config = GraphSlamConfig(closures=ClosureConfig(behind=20), most_waiting=1000)
    mapper = GraphSlam(config)
    drive(mapper, POSES[:-5], 1, np.radians(2), 0.02)
    assert mapper._waiting > 3
    searched, search = [], PoseGraph.optimum
    monkeypatch.setattr(PoseGraph, "optimum", lambda graph: searched.append(1) or search(graph))
    for _ in range(2):
        nodes = mapper.snapshot().place_graph.nodes
    assert len(searched) == 1
    np.testing.assert_array_equal([node.pose for node in nodes], search(mapper.graph))
    for pose, motion in zip(POSES[-5:], relative(POSES[-6:-1], POSES[-5:]), strict=True):
        mapper.update(reading_from(pose, motion, RING))
    nodes = mapper.snapshot().place_graph.nodes
    assert len(searched) == 2
    np.testing.assert_array_equal([node.pose for node in nodes], search(mapper.graph))


def test_the_graph_has_a_node_for_each_keyframe_and_the_way_home_follows_the_corridors(driven):
    graph = driven.snapshot().place_graph
    assert len(graph.nodes) == driven.estimate.updates
    assert len(graph.edges) == len(driven.graph.ends)
    away = np.hypot(*(POSES[-1] - POSES[0])[:2])
    way = driven.way_home
    assert away < way[TRAVEL] < 30.0
    assert away > 15.0
    assert np.isfinite(way[POINT]).all()


def test_it_is_the_same_each_time_and_goes_on_after_a_restart():
    config = GraphSlamConfig(closures=ClosureConfig(behind=20), most_waiting=3)
    whole, stopped = GraphSlam(config), GraphSlam(config)
    drive(whole, POSES[:110], 1, 0.1, 0.0)
    drive(stopped, POSES[:110], 1, 0.1, 0.0)
    resumed = make_mapper("graph-slam", config=config)
    resumed.restore(stopped.state())
    for mapper in (whole, resumed):
        drive(mapper, POSES[110:], 2, 0.1, 0.0)
    assert whole.graph.closures > 3
    for name, array in whole.state().items():
        np.testing.assert_array_equal(array, resumed.state()[name], err_msg=name)


def test_the_more_closures_there_are_the_more_may_wait(monkeypatch):
    counts, optimum = [], PoseGraph.optimum
    monkeypatch.setattr(PoseGraph, "optimum", lambda graph: counts.append(1) or optimum(graph))
    for share in (0.0, 1.0):
        counts.clear()
        closures = ClosureConfig(behind=20)
        mapper = GraphSlam(
            GraphSlamConfig(closures=closures, most_waiting=1, waiting_share=share, surprise=1000.0)
        )
        drive(mapper, laps(1.6), 1, 0.02, 0.02)
        if share == 0.0:
            assert len(counts) == mapper.graph.closures > 10
        else:
            # Half of all wait each time.
            assert 1 <= len(counts) <= np.log2(mapper.graph.closures) + 1


def loop_graph(
    rng: np.random.Generator, cauchy: float = 1.0, dcs: float = 5.0
) -> tuple[PoseGraph, np.ndarray]:
    """Three laps of a circle by a drifting odometer, and true closures between the laps."""
    turn = 2 * np.pi / 60
    true = [np.zeros(3)]
    graph = PoseGraph(cauchy, dcs)
    graph.add_pose(np.zeros(3))
    slip = np.diag((0.03, 0.03, 0.02))
    for k in range(1, 180):
        true.append(compose(true[-1], np.array((0.5, 0.0, turn))))
        motion = compose(np.array((0.5, 0.0, turn)), slip @ rng.normal(size=3))
        graph.add_pose(compose(graph.poses[-1], motion))
        graph.add(k - 1, k, motion, np.linalg.inv(slip @ slip), closes=False)
    seen = np.diag((0.02, 0.02, 0.01))
    for k in range(60, 180, 2):
        motion = compose(relative(true[k - 60], true[k]), seen @ rng.normal(size=3))
        graph.add(k - 60, k, motion, np.linalg.inv(seen @ seen), closes=True)
    return graph, np.array(true)


def add_false(graph: PoseGraph, share: float, rng: np.random.Generator) -> None:
    """Add closures between any poses that say anything, as surely as the true ones."""
    for _ in range(round(share * graph.closures)):
        source, target = sorted(rng.choice(len(graph.poses), 2, replace=False).tolist())
        motion = rng.uniform(-1, 1, 3) * (5, 5, np.pi)
        graph.add(source, target, motion, np.diag((2500.0, 2500.0, 10000.0)), closes=True)


def rmse(poses: np.ndarray, true: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((poses - true)[:, :2] ** 2, axis=1))))


@pytest.mark.parametrize("seed", range(5))
def test_a_tenth_of_false_closures_is_survived(seed):
    graph, true = loop_graph(np.random.default_rng(seed))
    before, undisturbed = rmse(graph.poses, true), rmse(graph.optimum(), true)
    assert undisturbed < 0.7 * before
    add_false(graph, 0.1, np.random.default_rng(100 + seed))
    assert rmse(graph.optimum(), true) < 1.05 * undisturbed + 1e-3


def test_with_kernels_so_wide_that_they_are_none_it_is_not():
    graph, true = loop_graph(np.random.default_rng(0), 1e9, 1e9)
    undisturbed = rmse(graph.optimum(), true)
    add_false(graph, 0.1, np.random.default_rng(100))
    assert rmse(graph.optimum(), true) > 3 * undisturbed


def test_spreads_grow_along_the_way_and_fall_where_a_loop_is_closed():
    graph = PoseGraph(1.0, 5.0)
    graph.poses = np.array([(float(k), 0.0, 0.0) for k in range(6)])
    step = np.diag((100.0, 100.0, 400.0))
    for k in range(5):
        graph.add(k, k + 1, np.array((1.0, 0.0, 0.0)), step, closes=False)
    far, last = graph.spreads(5)
    np.testing.assert_allclose(far, np.arange(5, -1, -1) * (0.02 + 25 / 400))
    position, heading = graph.deviations(5, 0, last)
    # Five steps' slips, and their turns at the levers to pose 0.
    assert position**2 == pytest.approx(5 * 0.02 + sum(k * k for k in range(1, 5)) / 400)
    assert heading**2 == pytest.approx(5 / 400)
    graph.add(0, 5, np.array((5.0, 0.0, 0.0)), 100 * step, closes=True)
    far, last = graph.spreads(5)
    assert far[0] == pytest.approx(0.01 * (0.02 + 25 / 400))
    assert graph.deviations(5, 0, last)[1] ** 2 == pytest.approx(1 / 40000)


def test_without_gtsam_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(registry, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"graph-slam: .*the extra `slam` brings.*found no gtsam"):
        make_mapper("graph-slam")
    with pytest.raises(InputError, match=r"mapper karto: .*the extra `peers` brings .*yag_slam"):
        make_mapper("karto")
    assert not {"graph-slam", "karto"} & set(registry.installed_mappers())
    assert "scan-matching" in registry.installed_mappers()


def test_another_laser_is_refused():
    mapper = GraphSlam()
    reading = reading_from(POSES[0], np.zeros(3), RING)
    mapper.update(reading)
    geometry = replace(reading.laser.geometry, max_range=20.0)
    other = replace(reading, laser=replace(reading.laser, geometry=geometry))
    with pytest.raises(InputError, match="the same laser at each reading"):
        mapper.update(other)


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("counts", lambda a: a * (0, 1, 1, 1) - (2, 0, 0, 0), "counts: expected version"),
        ("counts", lambda a: a + np.array((0, 0, 0, 1)), "beams"),
        ("matches.keyframe", lambda a: a + 1000, "matches.keyframe"),
        ("matches.shares", lambda a: a + 1.0, "matches.shares"),
        ("edges.ends", lambda a: a + 1000, "edges.ends"),
        ("edges.ends", lambda a: a[:, ::-1], "growing pairs"),
        ("edges.information", lambda a: -a, "positive definite"),
        ("edges.closes", lambda a: ~a, "an edge from each keyframe"),
        ("readings.followed", lambda a: a[::-1], "never fall"),
        ("keyframes.reading", lambda a: a + 10**6, "to less than"),
        ("laser", lambda a: -a, "laser"),
    ],
)
def test_a_damaged_state_is_refused(driven, name, damage, message):
    state = driven.state()
    state[name] = damage(state[name])
    with pytest.raises(InputError, match=message):
        GraphSlam().restore(state)


def test_wrong_thresholds_are_refused():
    with pytest.raises(InputError, match=r"GraphSlamConfig\.dcs"):
        GraphSlamConfig(dcs=-1.0)
    with pytest.raises(InputError, match=r"ClosureConfig\.near"):
        ClosureConfig(near=0.0)
    assert "gtsam" in sys.modules


def test_symmetric_matrices_are_inverted():
    rng = np.random.default_rng(8)
    for _ in range(20):
        root = rng.normal(size=(3, 3))
        matrix = root @ root.T + 1e-3 * np.eye(3)
        inverse = invert_symmetric(matrix)
        np.testing.assert_allclose(inverse @ matrix, np.eye(3), atol=1e-8)
        np.testing.assert_array_equal(inverse, inverse.T)
