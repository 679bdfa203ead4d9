"""Gateways and stars of drawn floors, whose right answer can be told by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from albot_core.mappers.hssh.clearance import distances, sealed
from albot_core.mappers.hssh.gateways import (
    FREE,
    WALL,
    GatewayConfig,
    Ground,
    find_gateways,
    line_across,
)
from albot_core.mappers.hssh.perceptual_map import LocalPerceptualMap, states_of
from albot_core.mappers.hssh.region import Region, continuations, region_around
from albot_core.mappers.hssh.skeleton import thinned
from albot_core.mappers.hssh.star import ENDS, Star
from albot_core.mappers.slam.grid import GridConfig
from albot_core.mappers.slam.tiles import log_odds_at
from tests.core.mappers.hssh.floors import (
    BLOCK,
    CORNER,
    CROSS,
    DOOR_IN_CORRIDOR,
    ROOMS,
    TEE,
    ground_of,
    walls_of,
)
from tests.core.mappers.slam.rooms import reading_from

CONFIG = GatewayConfig()


def seen_from(ground: Ground, *at: float) -> Region:
    region = region_around(ground, find_gateways(ground, CONFIG), np.array(at))
    assert region is not None
    return region


def star_of(region: Region) -> Star:
    return Star(*continuations(region.gateways, CONFIG.straight))


def same(gateways: np.ndarray, *expected: tuple[float, ...]) -> None:
    """In circular order, to a cell or two; where the order begins is open."""
    wanted = np.array(expected, float)
    assert len(gateways) == len(wanted)
    errors = [np.abs(np.roll(gateways, k, axis=0) - wanted).max() for k in range(len(wanted))]
    assert min(errors) < 0.21


def test_a_door_is_the_gateway_of_two_rooms():
    ground = ground_of(ROOMS)
    left, right = seen_from(ground, 1, 1), seen_from(ground, 7, 1)
    same(left.gateways, (4.1, 1.5, 4.1, 2.5))
    same(right.gateways, (4.1, 2.5, 4.1, 1.5))
    assert star_of(left) == star_of(right) == Star(ENDS)
    assert left.clearance == pytest.approx(2.0, abs=0.11)
    np.testing.assert_allclose(left.peak, (2, 2), atol=0.11)
    assert not left.inside[right.inside].any()


def test_two_corridors_cross_in_a_place_with_four_gateways():
    region = seen_from(ground_of(CROSS), 0, 0)
    same(
        region.gateways,
        (-1, -1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1), (-1, 1, -1, -1),
    )  # fmt: skip
    assert star_of(region) == Star(2, 3, 0, 1)
    # Half the diagonal of the crossing.
    assert region.clearance == pytest.approx(np.sqrt(2), abs=0.11)


@pytest.mark.parametrize(("floor", "kind"), [(TEE, Star(ENDS, 2, 1)), (CORNER, Star(ENDS, ENDS))])
def test_the_stars_of_junctions(floor, kind):
    assert star_of(seen_from(ground_of(floor), 0, 0)).kind == kind.kind


def test_a_piece_of_corridor_between_two_corners_is_a_path():
    ground = ground_of(BLOCK)
    assert seen_from(ground, 5, 0).is_path(CONFIG)
    assert not seen_from(ground, 0, 0).is_path(CONFIG)


def test_a_door_in_the_side_of_a_corridor_is_no_junction():
    """The corridor with its doors is one place: it hardly widens at a door."""
    region = seen_from(ground_of(DOOR_IN_CORRIDOR), -4, 0)
    same(region.gateways, (2, 1.1, 1, 1.1))


def test_a_room_without_a_gateway():
    ground = ground_of(((0, 0, 4, 3),))
    region = seen_from(ground, 1, 1)
    assert region.gateways.shape == (0, 4)
    assert star_of(region) == Star()
    assert not region.is_path(CONFIG)


def test_no_ground_at_all():
    ground = Ground(np.zeros((5, 5), np.int8), np.zeros(2), 0.1)
    narrows = find_gateways(ground, CONFIG)
    assert narrows.gateways.shape == (0, 4)
    assert region_around(ground, narrows, np.array((0.2, 0.2))) is None
    assert region_around(ground, narrows, np.array((9.0, -9.0))) is None


def test_a_gap_is_a_gateway_only_within_the_widths():
    narrow = ((0, 0, 4, 4), (4, 1.8, 4.2, 2.1), (4.2, 0, 8.2, 4))
    assert not len(find_gateways(ground_of(narrow), CONFIG).gateways)
    assert len(find_gateways(ground_of(narrow), GatewayConfig(narrowest=0.2)).gateways) == 1
    assert not len(find_gateways(ground_of(ROOMS), GatewayConfig(widest=0.8)).gateways)


@settings(max_examples=12, deadline=None)
@given(st.sampled_from((ROOMS, CROSS, TEE)), st.floats(-np.pi, np.pi), st.data())
def test_a_turned_world_has_the_same_star(floor, turn, data):
    """The star is that of the place: whichever way the world is turned, and the grid lies."""
    offset = data.draw(st.floats(0, 0.1))
    straight, turned = ground_of(floor), ground_of(floor, turn, offset)
    at = np.array((2.0, 2.0) if floor is ROOMS else (0.0, 0.0))
    cos, sin = np.cos(turn), np.sin(turn)
    spun = np.array((cos * at[0] - sin * at[1], sin * at[0] + cos * at[1]))
    one, other = seen_from(straight, *at), seen_from(turned, *spun)
    assert star_of(one).kind == star_of(other).kind
    assert other.clearance == pytest.approx(one.clearance, abs=0.15)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.3, 0.999))
def test_distances_are_those_of_scipy(seed, share):
    free = np.random.default_rng(seed).random((31, 44)) < share
    free[0] = False
    expected = ndimage.distance_transform_edt(free)
    np.testing.assert_allclose(distances(free), expected, atol=1e-4)


def test_the_ground_is_that_of_the_grid_around_the_robot():
    """Over many tiles, and beyond those that are known."""
    perceived = LocalPerceptualMap(GridConfig(cell=0.1, reach=8.0), half=5.0)
    pose = np.array((2.0, 1.7, 0.4))
    perceived.integrate(pose, reading_from(pose, np.zeros(3), walls_of(ROOMS)).laser)
    ground = perceived.ground(np.array((6.25, 6.15, 0.0)), island=0.0)
    assert ground.states.shape == (103, 103)
    columns, rows = np.meshgrid(*(np.arange(103) for _ in range(2)))
    low = np.rint(ground.corner / 0.1).astype(int)
    grid = perceived.grid
    for i, j in zip(rows.ravel(), columns.ravel(), strict=True):
        odds = log_odds_at(grid.pool.arrays, grid.index, grid.corner, low[1] + i, low[0] + j)
        is_inside = 0 < i < 102 and 0 < j < 102
        assert ground.states[i, j] == is_inside * ((odds > 0) * WALL + (odds < 0) * FREE)
    assert {0, FREE, WALL} == set(ground.states.ravel().tolist())


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 0.6), st.integers(0, 9))
def test_islands_are_the_small_pieces_of_scipy(seed, share, island):
    """Small pieces that hang together by corners, but not with the border, are free."""
    rng = np.random.default_rng(seed)
    belief = np.where(rng.random((24, 31)) < share, rng.choice((0.0, 1.0), (24, 31)), -1.0)
    expected = np.pad(np.select((belief < 0, belief > 0), (1, 2), 0), 1)
    pieces = ndimage.label(expected != FREE, np.ones((3, 3)))[0]
    for k, box in enumerate(ndimage.find_objects(pieces), start=1):
        sides = [side.stop - side.start for side in box]
        if k != pieces[0, 0] and max(sides) <= island:
            expected[pieces == k] = FREE
    np.testing.assert_array_equal(states_of(belief.astype(np.float32), island), expected)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_a_skeleton_keeps_the_connections_of_the_ground(seed):
    """As many pieces, and as many holes; and no block of four cells is left to thin."""
    blobs = ndimage.gaussian_filter(np.random.default_rng(seed).random((50, 60)), 2.5)
    free = blobs > np.median(blobs)
    free[0] = free[-1] = False
    free[:, 0] = free[:, -1] = False
    kept = thinned(distances(free))
    assert not (kept & ~free).any()
    eight = np.ones((3, 3))
    assert ndimage.label(kept, eight)[1] == ndimage.label(free, eight)[1]
    assert ndimage.label(~kept)[1] == ndimage.label(~free)[1]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.02, 0.4))
def test_a_gateway_runs_between_the_nearest_walls_of_both_sides(seed, share):
    """Of cells at one distance the first of the grid counts."""
    rng = np.random.default_rng(seed)
    states = np.where(rng.random((21, 25)) < share, WALL, FREE).astype(np.int8)
    states[[0, -1]] = states[:, [0, -1]] = WALL
    clearance = distances(states == FREE)
    row, column = np.argwhere(clearance > 0)[rng.integers((clearance > 0).sum())]
    reach = int(2.0 * clearance[row, column]) + 3
    to = np.argwhere(states == WALL) - (row, column)
    to = to[(np.abs(to) <= reach).all(axis=1)]
    lengths = np.hypot(*to.T)
    one = to[lengths.argmin()]
    behind = to[to @ one < -0.5 * lengths * np.hypot(*one)]
    expected = (-1, -1, -1, -1)
    if len(behind):
        other = behind[np.hypot(*behind.T).argmin()]
        expected = (row + one[0], column + one[1], row + other[0], column + other[1])
    assert line_across(states, clearance, row, column) == expected


def test_a_skeleton_has_no_arms_into_the_corners_of_a_room():
    clearance = distances(ground_of(((0, 0, 8, 4),)).states == FREE)
    kept = thinned(clearance)
    assert clearance[kept].min() > 0.8 * clearance.max()


def test_a_narrow_with_the_place_on_both_sides_is_no_gateway():
    """Between a pillar and the wall; round the other side the room is wide."""
    room = ((0, 0, 4.9, 10), (5.1, 0, 10, 10), (4.9, 0, 5.1, 1), (4.9, 3, 5.1, 10))
    ground = ground_of(room)
    assert len(find_gateways(ground, CONFIG).gateways) > 0
    assert not len(seen_from(ground, 1, 5).gateways)


def test_the_region_is_the_ground_on_the_robots_side():
    ground = ground_of(ROOMS)
    region = seen_from(ground, 1, 1)
    assert region.inside.sum() == pytest.approx(1600, rel=0.01)
    assert (ground.states[region.inside] == FREE).all()


def test_no_skeleton_leads_through_a_thin_wall_aslant():
    """The wall is a chain of cells that touch by their corners."""
    free = np.ones((30, 30), np.bool_)
    free[0] = free[-1] = False
    free[:, 0] = free[:, -1] = False
    free[np.arange(30), np.arange(30)] = False
    assert ndimage.label(thinned(distances(free)), np.ones((3, 3)))[1] == 1
    assert ndimage.label(thinned(distances(sealed(free))), np.ones((3, 3)))[1] == 2
    states = np.where(free, FREE, 2).astype(np.int8)
    assert not len(find_gateways(Ground(states, np.zeros(2), 0.1), CONFIG).gateways)
