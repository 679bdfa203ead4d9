"""Regions by split and merge: closed forms, oracles and laws."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import transform_segments
from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.regions import RegionConfig, Regions, split_journey
from albot_core.mappers.albot0.split_and_merge import (
    StepMeasures,
    homogeneity,
    measure_from,
    measure_until,
    regularisation,
    residual,
)
from albot_core.mappers.albot0.steps import ECHOES, Steps

CONFIG = RegionConfig()
LEAST = CONFIG.constants


def steps_of(lines: np.ndarray, widths: np.ndarray, path: int = 3) -> Steps:
    """Steps with the ground to either side; a robot path begins every few steps."""
    return Steps(
        lines=lines,
        widths=widths,
        walled=np.ones((len(lines), 2), np.bool_),
        begins=np.arange(len(lines)) % path == 0,
        readings=np.arange(len(lines)),
        echoes=np.zeros((len(lines), ECHOES, 2)),
    )


def split(lines: np.ndarray, widths: np.ndarray, path: int = 3) -> Regions:
    """The regions of such steps."""
    steps = steps_of(lines, widths, path)
    ground = Ground()
    ground.add(steps.swaths)
    return split_journey(steps.lines, widths.sum(axis=1), steps.begins, ground, CONFIG)


def measures_of(lines: np.ndarray, widths: np.ndarray) -> StepMeasures:
    """What split and merge works on."""
    steps, ground = steps_of(lines, widths), Ground()
    ground.add(steps.swaths)
    starts, faces, areas = ground.index
    lengths, seen = np.hypot(*(lines[:, 2:] - lines[:, :2]).T), np.zeros(len(areas) + 1, np.int64)
    return StepMeasures(
        lines, lengths, widths.sum(axis=1), steps.begins, starts, faces, areas, seen
    )


def letter(lines: np.ndarray, widths: np.ndarray, path: int = 3) -> Regions:
    """The regions of such steps by the letter of the paper."""
    steps, ground = steps_of(lines, widths, path), Ground()
    ground.add(steps.swaths)
    across = widths.sum(axis=1)
    return split_journey(steps.lines, across, steps.begins, ground, RegionConfig.paper())


def along(widths: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Steps of 1 m along the x axis, with so much ground across."""
    x, halves = np.arange(len(widths), dtype=np.float64), 0.5 * np.array(widths)
    zero = np.zeros_like(x)
    return np.stack((x, zero, x + 1, zero), axis=1), np.stack((halves, halves), axis=1)


def test_by_the_letter_a_width_is_an_area_by_the_line_from_entry_to_exit():
    """Out along 6 m and back along 3: half as long, so twice as wide."""
    x = np.array((0, 1, 2, 3, 4, 5, 6, 5, 4, 3), float)
    zero = np.zeros(9)
    lines = np.stack((x[:-1], zero, x[1:], zero), axis=1)
    measures = measures_of(lines, np.ones((9, 2)))
    measured = np.empty((2, 9))
    measure_from(measures, RegionConfig.paper().constants, 0, 9, measured)
    np.testing.assert_allclose(measured[1, [2, 5, 8]], (2.0, 2.0, 4.0), atol=0.05)
    measure_until(measures, RegionConfig.paper().constants, 0, 9, measured)
    np.testing.assert_allclose(measured[1, 0], 4.0, atol=0.05)


def test_by_the_letter_no_region_is_smaller_than_a_max():
    """A doorway of 0.9 m² between two rooms is a region of ours, and none of the paper's."""
    widths = [6.0] * 6 + [0.9] + [6.0] * 6
    assert split(*along(widths)).splits.tolist() == [0, 6, 7, 13]
    assert letter(*along(widths)).splits.tolist() == [0, 13]
    assert letter(*along([2.0] * 12 + [6.0] * 6)).splits.tolist() == [0, 12, 18]


def straight(widths: list[float]) -> Regions:
    """Steps of 1 m along the x axis, with so much ground across."""
    x = np.arange(len(widths), dtype=np.float64)
    zero = np.zeros_like(x)
    halves = 0.5 * np.array(widths)
    return split(np.stack((x, zero, x + 1, zero), axis=1), np.stack((halves, halves), axis=1))


def wandering(seed: int, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Steps that turn this way and that, and widths beside them."""
    rng = np.random.default_rng(seed)
    turns = np.cumsum(np.where(np.arange(count) % 4 == 0, rng.uniform(-2, 2, count), 0.0))
    ways = rng.uniform(0.5, 1.0, (count, 1)) * np.stack((np.cos(turns), np.sin(turns)), axis=1)
    ends = np.concatenate((np.zeros((1, 2)), np.cumsum(ways, axis=0)))
    widths = np.repeat(rng.uniform(0.4, 4.0, (count // 8, 2)), 8, axis=0)
    return np.concatenate((ends[:-1], ends[1:]), axis=1), widths + rng.uniform(0, 0.2, (count, 2))


@pytest.mark.parametrize("room", [4, 5, 6, 8])
def test_a_room_between_two_corridors_is_a_region_of_its_own(room):
    regions = straight([2.0] * 10 + [float(room)] * room + [2.0] * 10)
    assert regions.splits.tolist() == [0, 10, 10 + room, 20 + room]
    np.testing.assert_allclose(regions.lengths, (10, room, 10))
    np.testing.assert_allclose(regions.directions, 0.0)


def test_a_room_that_is_hardly_wider_is_none():
    assert straight([2.0] * 10 + [3.0] * 5 + [2.0] * 10).splits.tolist() == [0, 25]


def test_a_split_point_is_shifted_to_the_door():
    """The robot paths that make the first split end before and after the door."""
    assert straight([2.0] * 11 + [6.0] * 7 + [2.0] * 11).splits.tolist() == [0, 11, 18, 29]


def test_a_doorway_between_two_rooms_keeps_its_split_points():
    """The corridor is not told apart from the first room. Its end is the better split point, but
    then the doorway would be in one region with a room three times as wide."""
    regions = straight([2.2] * 15 + [3.3] * 42 + [1.0] + [5.5] * 9)
    assert regions.splits.tolist() == [0, 57, 58, 67]


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_no_region_would_have_to_be_split_again(seed):
    lines, widths = wandering(seed)
    widths[np.random.default_rng(seed).integers(0, len(widths), 3)] = 0.4
    measures, regions = measures_of(lines, widths), split(lines, widths)
    before, after = np.empty((2, 2, len(lines)))
    for first, last in pairwise(regions.splits.tolist()):
        _, greatest = residual(measures, LEAST, first, last, before, after)
        assert greatest <= CONFIG.threshold


def test_ground_that_two_steps_share_counts_once():
    """To and fro along 5 m, 2 m wide: the way back adds nothing, and then there are 3 m more."""
    x = np.array((0, 1, 2, 3, 4, 5, 4, 3, 2, 1, 0, -1, -2, -3), float)
    zero = np.zeros(len(x) - 1)
    measures = measures_of(np.stack((x[:-1], zero, x[1:], zero), axis=1), np.ones((13, 2)))
    before, after = np.empty((2, 2, 13))
    for _ in range(2):  # Each sum begins anew.
        residual(measures, LEAST, 0, 13, before, after)
        once = [2, 4, 6, 8, 10, 10, 10, 10, 10, 10, 12, 14, 16]
        np.testing.assert_allclose(before[0], once, atol=0.05)
        back = [16, 16, 16, 16, 16, 16, 14, 12, 10, 8, 6, 4, 2]
        np.testing.assert_allclose(after[0], back, atol=0.05)
        np.testing.assert_allclose((before[1], after[1]), 2.0)


def test_equation_1_by_hand():
    """Widths of 2 m and 6 m. The smaller area is 12 m², so r = 1/(1+e^(-12/4+3)) - 1."""
    r = 1 / (1 + math.exp(0)) - 1
    expected = 3.0 + 0.2 * 1.7 * r
    assert homogeneity(12.0, 2.0, 30.0, 6.0, LEAST) == pytest.approx(expected)
    assert homogeneity(30.0, 6.0, 12.0, 2.0, LEAST) == pytest.approx(expected)


def corridor(*headings: float, leg: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Steps of 1 m along a corridor 2 m wide, so many in each direction."""
    turned = np.repeat(headings, leg)
    ways = np.stack((np.cos(turned), np.sin(turned)), axis=1)
    ends = np.concatenate((np.zeros((1, 2)), np.cumsum(ways, axis=0)))
    return np.hstack((ends[:-1], ends[1:])), np.ones((len(ways), 2))


@pytest.mark.parametrize("path", [2, 3, 7, 10])
@pytest.mark.parametrize("turn", [math.pi / 2, -math.pi / 2, 2.0, -2.0, math.pi])
def test_corridors_are_parted_where_they_bend(turn, path):
    """Wherever the robot paths end; where a third one follows, twice; where it turns round, too."""
    assert split(*corridor(0.3, 0.3 + turn), path).splits.tolist() == [0, 10, 20]
    there = split(*corridor(0.3, 0.3 + turn, 0.3), path)
    assert there.splits.tolist() == [0, 10, 20, 30]


@pytest.mark.parametrize("path", [2, 3, 7, 10])
def test_corridors_are_parted_where_the_robot_cuts_the_corner(path):
    headings = np.repeat((0.0, 0.25 * math.pi, 0.5 * math.pi), (10, 2, 10))
    lines, widths = corridor(*headings, leg=1)
    splits = split(lines, widths, path).splits.tolist()
    assert len(splits) == 3
    assert 10 <= splits[1] <= 12


def test_a_corridor_that_hardly_bends_is_one_region():
    assert split(*corridor(0.0, 0.8)).splits.tolist() == [0, 20]


@pytest.mark.parametrize("legs", [(5, 5), (12, 3)])
def test_short_or_wide_pieces_are_no_corridors(legs):
    """They are 2 m wide and 5 m long, or 3 m."""
    lines, widths = corridor(0.0, 0.5 * math.pi, leg=12)
    kept = np.r_[12 - legs[0] : 12 + legs[1]]
    assert split(lines[kept], widths[kept]).splits.tolist() == [0, len(kept)]


def test_equation_2_by_hand():
    assert regularisation(12.0, LEAST) == pytest.approx(-0.5)  # A = n · A_max
    assert regularisation(0.0, LEAST) == pytest.approx(1 / (1 + math.exp(3)) - 1)
    assert regularisation(1e9, LEAST) == 0.0


def zigzag(legs: int, width: float) -> tuple[np.ndarray, np.ndarray]:
    """A corridor 2 m wide, 10 m long; then to and fro in a hall, and out by a corridor again."""
    east = np.array([(k, 0.0) for k in range(11)], np.float64)
    points = [east]
    for leg in range(legs):
        side = 1.0 if leg % 2 == 0 else -1.0
        points.append(points[-1][-1] + np.array([(0.2 * k, side * k) for k in range(1, 7)]))
    points.append(points[-1][-1] + np.array([(k, 0.0) for k in range(1, 11)]))
    way = np.concatenate(points)
    widths = np.full((len(way) - 1, 2), 1.0)
    widths[10 : 10 + 6 * legs] = width / 2
    return np.hstack((way[:-1], way[1:])), widths


@pytest.mark.parametrize("legs", range(1, 9))
def test_a_large_room_is_one_region_whatever_way_the_robot_took_in_it(legs):
    """By area over length a room that is crossed to and fro is as wide as the way is crooked."""
    lines, widths = zigzag(legs, 8.0)
    assert split(lines, widths, path=6).splits.tolist() == [0, 10, 10 + 6 * legs, 20 + 6 * legs]


def test_split_points_stay_at_the_doors_beside_a_narrow_doorway():
    """A doorway of a step makes h largest where the corridor beside it is cut short."""
    corridor, hall = [1.8] * 13, [7.0] * 15
    regions = straight([6.0] * 4 + [1.2] + corridor + hall + corridor + [1.2] + [6.0] * 4)
    assert {18, 33} <= set(regions.splits.tolist())


def test_small_regions_are_held_together():
    """1.9 times as wide, and small: above θ_r by its width, below it with r."""
    wide, small = straight([2.0] * 10 + [3.8] * 10), straight([2.0] * 10 + [3.8])
    assert wide.splits.tolist() == [0, 10, 20]
    assert small.splits.tolist() == [0, 11]


def test_a_merged_region_is_as_homogeneous_as_any():
    """Parts that would each go with their neighbours: widths grow from 2 m to 5.8 m in all."""
    regions = straight([2.0] * 8 + [3.0] * 8 + [4.2] * 8 + [5.8] * 8)
    assert regions.count > 1


@pytest.mark.parametrize("seed", range(6))
def test_swaths_whose_edges_all_but_coincide_are_cut(seed: int):
    """Steps back and forth over the same ground, a hair apart."""
    rng = np.random.default_rng(seed)
    ground = Ground()
    for _ in range(60):
        x = rng.integers(0, 4) + rng.normal(0.0, 1e-9, 2)
        corners = ((x[0], 0.0), (x[0], 1.0), (x[1] + 1, 1.0), (x[1] + 1, 0.0))
        ground.add(np.array((corners,)))
    assert ground.index[2].sum() == pytest.approx(4.0, abs=0.05)


@pytest.mark.parametrize("count", [0, 1])
def test_a_journey_of_one_step_or_none(count):
    regions = straight([2.0] * count)
    assert regions.splits.tolist() == list(range(count + 1))
    assert regions.count == len(regions.lengths) == len(regions.directions) == count


def test_a_region_that_ends_where_it_began_has_a_width_and_a_direction():
    there = np.array([(0.0, k, 0.0, k + 1) for k in range(5)])
    lines = np.concatenate((there, there[::-1][:, (2, 3, 0, 1)]))
    regions = split(lines, np.full((10, 2), 2.0))
    assert regions.splits[0] == 0
    assert regions.splits[-1] == 10
    assert np.isfinite(regions.lengths).all()
    whole = Regions(splits=np.array((0, 10)), steps=lines)
    np.testing.assert_allclose(whole.lengths, 0.0)
    np.testing.assert_allclose(whole.directions, np.pi / 2)


@example(649903, 0.0, 0.0, 0.5)  # A common part that shapely gets wrong where edges coincide.
@settings(max_examples=15)
@given(st.integers(0, 10**6), st.floats(-100, 100), st.floats(-100, 100), st.floats(-3.1, 3.1))
def test_the_split_does_not_depend_on_where_the_world_lies(seed, x, y, heading):
    lines, widths = wandering(seed)
    here = split(lines, widths)
    there = split(transform_segments(np.array((x, y, heading)), lines), widths)
    np.testing.assert_array_equal(here.splits, there.splits)
    np.testing.assert_allclose(here.lengths, there.lengths, atol=1e-6)
    turned = there.directions - here.directions - heading
    np.testing.assert_allclose(np.cos(turned), 1.0, atol=1e-6)


@given(st.floats(-3.1, 3.1))
def test_of_equal_splits_the_first_counts_however_the_world_lies(heading):
    """A room between two corridors that are alike: its walls' ends are equally good splits."""
    x, zero = np.arange(24.0), np.zeros(24)
    lines = np.stack((x, zero, x + 1, zero), axis=1)
    widths = np.repeat(np.array([[1.0], [3.0], [1.0]]), 8, axis=0).repeat(2, axis=1)
    there = split(transform_segments(np.array((5.0, -3.0, heading)), lines), widths, path=24)
    np.testing.assert_array_equal(there.splits, split(lines, widths, path=24).splits)


@pytest.mark.parametrize("seed", [649903, 176789])
def test_the_ground_of_a_long_way_is_counted_once(seed):
    """With shapely's exact overlay alone, the areas are 4 and 0.6 m² too large here."""
    lines, widths = wandering(seed)
    ground = Ground()
    steps = steps_of(lines, widths)
    ground.add(steps.swaths)
    union = shapely.union_all(shapely.polygons(steps.swaths), grid_size=1e-6)
    assert ground.index[2].sum() == pytest.approx(union.area, abs=0.3)


@settings(max_examples=15)
@given(st.integers(0, 10**6))
def test_regions_cover_the_journey_one_after_the_other(seed):
    lines, widths = wandering(seed)
    regions = split(lines, widths)
    assert regions.splits[0] == 0
    assert regions.splits[-1] == len(lines)
    assert (np.diff(regions.splits) > 0).all()
    owners = [regions.of_step(step) for step in range(len(lines))]
    expected = np.repeat(np.arange(regions.count), np.diff(regions.splits))
    np.testing.assert_array_equal(owners, expected)


@settings(max_examples=15)
@given(st.integers(0, 10**6))
def test_the_ground_is_the_union_of_the_swaths(seed):
    rng = np.random.default_rng(seed)
    ground, swaths = Ground(), []
    for _ in range(12):
        corners = np.array(((0, -1), (3, -1), (3, 2), (0, 2))) * rng.uniform(0.5, 2)
        angle = rng.uniform(0, 6.3)
        turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
        swaths.append(corners @ turn.T + rng.uniform(-4, 4, 2))
        ground.add(swaths[-1][None])
    starts, faces, areas = ground.index
    for first, last in ((0, 12), (0, 5), (4, 12), (7, 8)):
        within = np.unique(faces[starts[first] : starts[last]])
        union = shapely.union_all(shapely.polygons(np.array(swaths[first:last])))
        assert areas[within].sum() == pytest.approx(union.area, rel=0.01)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("threshold", 0.9),
        ("regularisation", 1.1),
        ("centre", -1.0),
        ("smallest_area", 0.0),
        ("bend", 0.0),
    ],
)
def test_thresholds_are_checked(name, value):
    with pytest.raises(InputError, match=rf"RegionConfig\.{name}"):
        RegionConfig(**{name: value})


def test_a_swath_that_crosses_itself_is_taken_in():
    """Echoes in a narrow place make such: it covers what lies within its outline."""
    ground = Ground()
    ground.add(np.array((((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)),)))
    ground.add(np.array((((1.0, 1.0), (3.0, 3.0), (3.0, 1.0), (1.0, 3.0)),)))
    ground.add(np.array((((0.5, 0.5), (2.5, 0.5), (2.5, 2.5), (0.5, 2.5)),)))
    _, _, areas = ground.index
    assert 4.0 < areas.sum() < 9.0


@given(st.lists(st.lists(st.integers(0, 4), min_size=8, max_size=8), min_size=2, max_size=8))
def test_swaths_of_any_corners_are_taken_in(numbers):
    """They cross themselves, have spikes, are but a line or a point, or share edges."""
    ground, shapes = Ground(), []
    for each in numbers:
        corners = np.array(each, np.float64).reshape(4, 2)
        ground.add(corners[None])
        shapes.append(shapely.make_valid(shapely.polygons(corners)))
    union = shapely.union_all(np.array(shapes))
    assert ground.index[2].sum() == pytest.approx(union.area, abs=0.01 * 4 * len(numbers))
