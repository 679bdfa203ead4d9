"""The search of a whole map, and the evidence, against slow and obvious versions of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_points
from albot_core.localisation.config import EvidenceConfig, LocaliserConfig
from albot_core.localisation.evidence import EXPLAINED, ratios_of, weigh_poses
from albot_core.localisation.known_map import CELL, FREE, UNKNOWN, WALL, KnownMap
from albot_core.localisation.search import find_poses, keep_apart, search_map
from albot_core.maps.layers import EMPTY_MAP, MapSnapshot, OccupancyGridLayer, SegmentsLayer
from albot_core.matching.scan_points import matched_points
from tests.core.localisation.buildings import BUILDING, TOUR, snapshot
from tests.core.mappers.slam.rooms import scan_from

CONFIG = LocaliserConfig()
KNOWN = KnownMap(snapshot(BUILDING, TOUR), CONFIG)
POSES = np.array(((2.0, 2.0, 0.3), (6.6, 5.5, -2.0), (12.0, 5.2, 1.5), (3.0, 6.5, 3.0)))


def points_at(pose: np.ndarray) -> np.ndarray:
    points, _ = matched_points(scan_from(pose, BUILDING), 8.0, 0.15)
    return points


@pytest.mark.parametrize("pose", POSES)
def test_the_true_pose_is_among_the_best(pose):
    """One scan of a corner may fit another corner as well: what the second look is for."""
    found, scores = search_map(KNOWN, points_at(pose), math.radians(3), 0.4, 50, (0.5, 0.35))
    assert (np.diff(scores) <= 0).all() and scores[0] > 0.7
    off = np.hypot(*(found - pose)[:, :2].T)
    turn = np.abs((found[:, 2] - pose[2] + np.pi) % (2 * np.pi) - np.pi)
    right = np.flatnonzero((off < 0.2) & (turn < math.radians(3)))
    assert len(right) and scores[right[0]] > scores[0] - 0.03


def test_it_finds_the_poses_that_trying_each_one_finds():
    points, headings = points_at(POSES[0])[::3], 24
    field = KNOWN.coarse
    least = int(0.55 * 255 * len(points))
    found, sums = find_poses(
        field.finest, KNOWN.blocks, KNOWN.is_open_block, KNOWN.is_open,
        field.config.cell, points, headings, least,
    )  # fmt: skip
    expected = {}
    for h in range(headings):
        turned = transform_points(np.array((0.0, 0.0, 2 * np.pi * h / headings)), points)
        shift = np.floor(turned / field.config.cell + 0.5).astype(int)
        for row, column in np.argwhere(KNOWN.is_open):
            total = int(field.finest[row + shift[:, 1], column + shift[:, 0]].astype(int).sum())
            if total >= least:
                expected[int(column), int(row), h] = total
    assert len(expected) > 3
    assert expected == {tuple(k): s for k, s in zip(found.tolist(), sums.tolist(), strict=True)}


def test_with_too_many_poses_the_best_are_kept():
    points = np.array(((1.0, 0.0), (1.2, 0.1)))  # Fits at every wall.
    found, scores = search_map(KNOWN, points, math.radians(3), 0.0, 10, (0.0, 0.0))
    assert len(found) == 10 and scores[-1] > 0.9


def test_no_points_are_found_nowhere():
    found, scores = search_map(KNOWN, np.empty((0, 2)), 0.1, 0.4, 10, (0.5, 0.3))
    assert found.shape == (0, 3) and scores.shape == (0,)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_poses_that_are_kept_are_apart_and_all_others_are_near_one(seed):
    poses = np.random.default_rng(seed).uniform((0, 0, -3.1), (2, 2, 3.1), (40, 3))
    kept = keep_apart(poses, 0.5, 0.6, 40)

    def is_near(one: np.ndarray, other: np.ndarray) -> bool:
        turn = abs((one[2] - other[2] + np.pi) % (2 * np.pi) - np.pi)
        return bool(np.hypot(*(one - other)[:2]) < 0.5 and turn < 0.6)

    for k in range(len(poses)):
        before = [j for j in kept if j < k]
        assert (k in kept) == (not any(is_near(poses[j], poses[k]) for j in before))


def slow_evidence(pose: np.ndarray, points: np.ndarray, config: EvidenceConfig) -> tuple:
    """The evidence by its definition, beam by beam, looking for walls every centimetre."""
    ground, total, known, explained = KNOWN.ground, 0.0, 0, 0

    def cell_at(point):
        column, row = np.floor((point - ground.corner) / CELL).astype(int)
        rows, columns = ground.kinds.shape
        if 0 <= row < rows and 0 <= column < columns:
            return ground.kinds[row, column], int(ground.distances[row, column])
        return UNKNOWN, 100

    for end in transform_points(pose, points):
        length, met, passed = math.dist(end, pose[:2]), False, False
        for at in np.arange(0.1, length - 0.3, 0.1):
            _, away = cell_at(pose[:2] + at / length * (end - pose[:2]))
            passed |= met and away >= 25
            met |= away <= 5
        kind, away = cell_at(end)
        if passed:
            total, known = total + config.through - config.bias, known + 1
        elif away <= EXPLAINED or kind != UNKNOWN:
            near = (
                config.explained * config.gain * math.exp(-0.5 * (away / 100 / config.sigma) ** 2)
            )
            total += math.log(1 - config.explained + near) - config.bias
            known, explained = known + 1, explained + (away <= EXPLAINED)
    return min(1.0, config.beams / len(points)) * total, explained / max(known, 1)


def test_evidence_is_what_its_definition_says():
    config, points = EvidenceConfig(), points_at(POSES[1])
    rng = np.random.default_rng(3)
    poses = np.concatenate((POSES, rng.uniform((0.5, 0.5, -3), (13.5, 8.5, 3), (20, 3))))
    evidence, shares = weigh_poses(KNOWN.ground, poses, points, np.zeros(2), config)
    for k, pose in enumerate(poses):
        expected, share = slow_evidence(pose, points, config)
        assert evidence[k] == pytest.approx(expected, abs=1e-9)
        assert shares[k] == pytest.approx(share)
    assert np.argmax(evidence) == 1 and shares[1] > 0.95


def test_beams_over_unknown_ground_say_nothing():
    far = np.array(((1000.0, 1000.0, 0.0),))
    evidence, shares = weigh_poses(
        KNOWN.ground, far, points_at(POSES[0]), np.zeros(2), EvidenceConfig()
    )
    assert evidence[0] == 0.0 and shares[0] == 0.0


def test_a_beam_counts_less_the_farther_it_ends_from_a_wall():
    assert (np.diff(ratios_of(EvidenceConfig())) <= 0).all()


def test_ground_seen_up_to_the_first_wall_is_free():
    ground = KNOWN.ground
    for point, kind in (((2, 2), FREE), ((5, 0.02), WALL), ((10.75, 6.8), UNKNOWN)):
        column, row = np.floor((np.array(point) - ground.corner) / CELL).astype(int)
        assert ground.kinds[row, column] == kind


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_grid_gives_the_same_walls_as_its_segments(turn):
    ground, resolution = KNOWN.ground, 0.1
    kinds = ground.kinds[: len(ground.kinds) // 2 * 2, : ground.kinds.shape[1] // 2 * 2]
    parts = kinds.reshape(len(kinds) // 2, 2, -1, 2)
    occupancy = np.full(parts.shape[::2], np.nan, np.float32)
    occupancy[(parts == FREE).any(axis=(1, 3))] = 0.1
    occupancy[(parts == WALL).any(axis=(1, 3))] = 0.9
    origin = np.array((*ground.corner, 0.0))
    turned = np.array((*transform_points(np.array((3.0, -2.0, turn)), origin[None, :2])[0], turn))
    layer = OccupancyGridLayer(origin=turned, resolution=resolution, occupancy=occupancy)
    known = KnownMap(MapSnapshot(layers=(layer,)), CONFIG)
    pose = np.array((*transform_points(np.array((3.0, -2.0, turn)), POSES[:1, :2])[0], 0.3 + turn))
    found, _ = search_map(known, points_at(POSES[0]), math.radians(3), 0.4, 50, (0.5, 0.35))
    assert np.hypot(*(found[0] - pose)[:2]) < 0.25


@pytest.mark.parametrize(
    "empty", [EMPTY_MAP, MapSnapshot(layers=(SegmentsLayer(segments=np.empty((0, 4))),))]
)
def test_a_map_without_walls_is_refused(empty):
    with pytest.raises(InputError, match=r"office\.albot: expected a map with walls"):
        KnownMap(empty, CONFIG, source="office.albot")


def test_a_map_larger_than_any_building_is_refused():
    walls = np.array(((0, 0, 900, 0), (0, 5, 900, 5)), float)
    with pytest.raises(InputError, match="a map of at most 400 m"):
        KnownMap(MapSnapshot(layers=(SegmentsLayer(segments=walls),)), CONFIG)
