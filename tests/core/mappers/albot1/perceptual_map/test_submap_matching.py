"""Views are matched with what is remembered: landmarks as a slow search finds them, and the pose
where the odometer is far off."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import relative, wrap_angle
from albot_core.mappers.albot1.config import Albot1Config, Albot1Limits
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.perceptual_map.near_walls import tabulate
from albot_core.mappers.albot1.perceptual_map.submap import make_match_buffers
from albot_core.mappers.albot1.perceptual_map.submap_matching import (
    POINT_SPACING,
    beams_wanted,
    match_landmarks,
)
from albot_core.matching.lines import moved_ends
from albot_core.sensing.beam_model import BeamModel, variance_across
from albot_core.sensing.reading import LaserGeometry, Reading
from albot_core.sensing.view import CORNER, NO_EDGE
from tests.core.mappers.albot1.rows import Rows, rows_of, some_surfaces
from tests.core.scenes import FURNITURE, ROOM, scan_from

OURS = Albot1Config()


def slow_match(
    seen: Rows, expected: Rows, correction: np.ndarray, limits: Albot1Limits
) -> list[tuple[int, int]]:
    """Of each surface seen the nearest landmark's row and end; -1 where none is near."""
    about, found = (np.cos(correction[2]), np.sin(correction[2])), []
    for row, row_ends in zip(*seen, strict=True):
        ends = moved_ends(row, correction, *about)
        near = [(limits.landmark_gap, -1, 0)]
        for q, (wall, wall_ends) in enumerate(zip(*expected, strict=True)):
            apart = abs(wrap_angle(wall[5] - row[5] - correction[2]))
            short = min(row[4], wall[4]) < limits.landmark_length
            if apart >= limits.landmark_angle or short:
                continue
            for end in range(2):
                if row_ends[end] != NO_EDGE and wall_ends[end] != NO_EDGE:
                    gap = np.subtract(ends, wall[:4])[2 * end : 2 * end + 2]
                    near.append((float(np.hypot(*gap)), q, end))
        found.append(min(near)[1:])
    return found


def matched(
    seen: Rows, expected: Rows, correction: np.ndarray, limits: Albot1Limits
) -> tuple[int, np.ndarray]:
    """What the mapper matches: how many, and the row and end of each."""
    count = len(expected[0])
    buffers = make_match_buffers(len(seen[0]), count)
    buffers.slots[:count] = np.arange(count)
    tabulate(expected[0], buffers.table)
    moved = correction, np.cos(correction[2]), np.sin(correction[2])
    found = match_landmarks(seen[1], seen[0], expected[1], count, *moved, limits, buffers)
    return found, buffers.landmarks


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from([5.0, 30.0, 180.0, 400.0]))
def test_the_nearest_landmark_is_matched(seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    config = Albot1Config(landmark_angle=np.radians(angle), landmark_length=1.0)
    surfaces = some_surfaces(8, 2.0, rng)
    seen = rows_of(surfaces + rng.normal(0, 0.08, surfaces.shape), rng)
    expected = rows_of(surfaces, rng)
    correction = rng.normal(0, (0.05, 0.05, 0.03))
    found, landmarks = matched(seen, expected, correction, config.limits)
    slow = slow_match(seen, expected, correction, config.limits)
    assert found == sum(row >= 0 for row, _ in slow)
    assert [(row, end if row >= 0 else 0) for row, end in landmarks.tolist()] == slow


@pytest.mark.parametrize(("turn", "count"), [(4.99, 1), (5.01, 0)])
def test_surfaces_turned_5_degrees_are_not_one(turn: float, count: int) -> None:
    limits = replace(Albot1Config(), landmark_gap=0.4).limits
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    rng, corners = np.random.default_rng(0), np.full((1, 2), CORNER, np.int8)
    seen = rows_of(np.array([[0.0, 0.0, cos, sin]]), rng)[0], corners
    expected = rows_of(np.array([[0.0, 0.0, 1.0, 0.0]]), rng)[0], corners
    assert matched(seen, expected, np.zeros(3), limits)[0] == count


@pytest.mark.parametrize("degrees", [-40.0, -15.0, 0.0, 25.0])
def test_the_pose_is_found_though_the_odometer_is_far_off(degrees: float) -> None:
    walls, path = np.concatenate((ROOM, FURNITURE)), np.array([[0.0, 0, 0], [0.6, 0.2, 0.5]])
    mapper = Albot1()
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=scan_from(path[0], walls)))
    motion = path[1] + np.array((0.2, -0.15, np.radians(degrees)))
    mapper.update(Reading(stamp=1.0, motion=motion, laser=scan_from(path[1], walls)))
    off = relative(path[1], mapper.estimate.pose)
    assert np.hypot(*off[:2]) < 0.03
    assert abs(np.degrees(off[2])) < 1.0


@pytest.mark.parametrize("off", [(0.5, -0.4, 60.0), (-0.5, 0.5, -55.0), (0.0, 0.55, 8.0)])
def test_motions_farther_off_are_found_where_no_match_is_sure(
    off: tuple[float, float, float],
) -> None:
    walls, path = np.concatenate((ROOM, FURNITURE)), np.array([[0.0, 0, 0], [0.6, 0.2, 0.5]])
    mapper = Albot1()
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=scan_from(path[0], walls)))
    motion = path[1] + np.array((*off[:2], np.radians(off[2])))
    mapper.update(Reading(stamp=1.0, motion=motion, laser=scan_from(path[1], walls)))
    error = relative(path[1], mapper.estimate.pose)
    assert np.hypot(*error[:2]) < 0.03
    assert abs(np.degrees(error[2])) < 1.0


def test_without_an_odometer_the_views_tell_the_motion() -> None:
    walls = np.concatenate((ROOM, FURNITURE))
    path = np.array([[0.0, 0, 0], [0.6, 0.2, 0.5], [0.9, 0.3, -0.4], [0.2, -0.3, -1.3]])
    mapper = Albot1()
    for stamp, pose in enumerate(path):
        laser = scan_from(pose, walls)
        mapper.update(Reading(stamp=float(stamp), motion=np.zeros(3), laser=laser))
        error = relative(pose, mapper.estimate.pose)
        assert np.hypot(*error[:2]) < 0.05
        assert abs(np.degrees(error[2])) < 1.0


@pytest.mark.parametrize("misread", [None, 15])
def test_without_an_odometer_a_robot_goes_on_in_a_bare_corridor_as_it_came(
    misread: int | None,
) -> None:
    # The laser sees ahead only: from the twelfth view on nothing but two walls without an end.
    corridor = [(-3.0, -1.0, 90.0, -1.0), (90.0, 1.2, -3.0, 1.2)]
    posts = [(x, y, x, y + 0.5 * (1 if y < 0 else -1)) for x in (2.0, 4.0) for y in (-1.0, 1.2)]
    walls = np.array(corridor + [post[end:] + post[:end] for post in posts for end in (0, 2)])
    rng, mapper, step, believed = np.random.default_rng(0), Albot1(), 0.3, []
    for k in range(30):
        scan = scan_from(np.array((step * k, 0.0, 0.0)), walls)
        if k == misread:
            scan = scan_from(np.array((0.0, 0.0, 0.4)), ROOM)
        laser = replace(scan, ranges=scan.ranges + rng.normal(0, 0.005, scan.ranges.shape))
        mapper.update(Reading(stamp=0.3 * k, motion=np.zeros(3), laser=laser))
        believed.append(mapper.estimate.pose.copy())
    steps = [relative(a, b)[0] for a, b in pairwise(believed)]
    settled = steps[12 if misread is None else misread + 2 :]
    assert settled == pytest.approx([step] * len(settled), abs=0.1)


@pytest.mark.parametrize("degrees", [1.0, 2.0])
@pytest.mark.parametrize(("aside", "ahead"), [(1.0, 0.0), (1.0, 6.0), (3.0, -4.0)])
def test_a_point_of_a_wall_counts_by_the_beams_that_meet_the_wall_around_it(
    aside: float, ahead: float, degrees: float
) -> None:
    around = np.arctan2(aside, ahead + np.array((-0.5, 0.5)) * POINT_SPACING)
    counted = abs(np.diff(around)[0]) / np.radians(degrees)
    model, square = BeamModel(np.radians(degrees), 0.0, True), ahead**2 + aside**2
    known = variance_across(square, aside, model) / square / beams_wanted(square, aside, model)
    assert known == pytest.approx(counted, rel=0.02)


def heading_along_a_bent_wall(config: Albot1Config) -> float:
    """Where a robot believes to head that drives straight past a wall bent by a 30 m radius (°)."""
    along = np.arange(0.0, 22.1, 0.25)
    walls = []
    for y in (np.full_like(along, 1.0), -1.0 - np.maximum(along - 4.0, 0.0) ** 2 / 60.0):
        corners = np.stack((along, y), axis=1)
        walls.append(np.concatenate((corners[:-1], corners[1:]), axis=1))
    mapper, laser = Albot1(config), LaserGeometry(max_range=8.0)
    for k in range(8):
        scan = scan_from(np.array((1.0 + k, 0.0, 0.0)), np.concatenate(walls), laser)
        motion = np.array((min(k, 1), 0.0, 0.0))
        mapper.update(Reading(stamp=float(k), motion=motion, laser=scan))
    return float(np.degrees(mapper.estimate.pose[2]))


def test_a_bent_wall_turns_the_robot_less_where_it_is_broken() -> None:
    config = Albot1Config()
    unbroken = replace(config, view=replace(config.view, bend_significance=0.0))
    assert heading_along_a_bent_wall(unbroken) > 1.5
    assert abs(heading_along_a_bent_wall(config)) < 0.8
