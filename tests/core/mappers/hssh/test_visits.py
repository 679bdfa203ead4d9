"""What HSSH takes for evidence that two visits were to the same place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import transform_points, transform_segments
from albot_core.mappers.hssh.alignment import align, rigid_fit
from albot_core.mappers.hssh.config import HsshConfig, PlaceConfig
from albot_core.mappers.hssh.layout import frames_of, gateways_of
from albot_core.mappers.hssh.topological_map import TopologicalMap
from albot_core.mappers.hssh.topological_map import Visit as Numbered
from albot_core.mappers.hssh.visit import Visit
from albot_core.mappers.hssh.visits import Visits

# The gateways of a room between (0, 0) and (4, 4): its two doors, east and west.
DOORS = np.array(((4.0, 1.5, 4.0, 2.5), (0.0, 2.5, 0.0, 1.5)))
SIDE = np.linspace(0.0, 4.0, 21)
WALLS = np.concatenate([
    np.stack((SIDE, np.zeros(21)), axis=1),
    np.stack((SIDE, np.full(21, 4.0)), axis=1),
])  # fmt: skip
BOTH = ((0, 0), (1, 1))


def visit(
    way: float = 0.0,
    *,
    unknown: tuple[int, ...] = (0,),
    walls: np.ndarray = WALLS,
    offset: tuple[float, float] = (0.0, 0.0),
) -> Visit:
    """A visit to the room after some way, with the odometry off by an offset."""
    return Visit(
        entered=int(way),
        way=way,
        arrived=1,
        left=0,
        middle=np.array((2.0, 2.0)) + offset,
        gateways=DOORS + np.tile(offset, 2),
        unknown=unknown,
        surface=walls + offset,
        open_ground=np.empty((0, 2)),
    )


def judged(
    earlier: Visit, later: Visit, common: tuple, *, closes_loop: bool, **places: float
) -> bool:
    """Whether the later visit can be to the place of the earlier one."""
    visits = Visits(HsshConfig(places=PlaceConfig(**places)))
    visits.begin(earlier)
    visits.begin(later)
    return visits.judge(0, common, closes_loop)


def test_a_room_seen_again_is_the_same():
    assert judged(visit(), visit(50.0), BOTH, closes_loop=True)
    assert judged(visit(), visit(50.0), BOTH, closes_loop=False)


@pytest.mark.parametrize("closes_loop", [True, False])
def test_places_not_seen_whole_need_common_walls(closes_loop):
    few, none = WALLS[:4], WALLS[:0]
    for walls in (few, none):
        later = visit(50.0, walls=walls)
        assert not judged(visit(), later, BOTH, closes_loop=closes_loop)
        assert judged(visit(), later, BOTH, closes_loop=closes_loop, evidence=0)
        # By the stars alone, as an experiment asks.
        assert judged(visit(), later, BOTH, closes_loop=closes_loop, overlap=0.0)
        whole = visit(unknown=()), visit(50.0, unknown=(), walls=walls)
        assert judged(*whole, BOTH, closes_loop=closes_loop)


def test_one_common_gateway_closes_no_loop_between_places_not_seen_whole():
    assert not judged(visit(), visit(50.0), BOTH[:1], closes_loop=True)
    whole = visit(unknown=()), visit(50.0, unknown=())
    assert judged(*whole, BOTH[:1], closes_loop=True)


@pytest.mark.parametrize("closes_loop", [True, False])
def test_the_odometer_errs_so_far_only(closes_loop):
    # 1 m, and 5 % of 50 m.
    assert judged(visit(), visit(50.0, offset=(3.4, 0.0)), BOTH, closes_loop=closes_loop)
    off = visit(50.0, offset=(3.6, 0.0))
    assert not judged(visit(), off, BOTH, closes_loop=closes_loop)
    assert judged(visit(), off, BOTH, closes_loop=closes_loop, drift=np.inf)


@settings(max_examples=20, deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1), st.integers(1, 30))
def test_a_rigid_fit_finds_the_pose_back(x, y, turn, count):
    points = np.random.default_rng(count).normal(size=(count + 1, 2))
    true = np.array((x, y, turn))
    pose, error = rigid_fit(points, transform_points(true, points))
    np.testing.assert_allclose(pose, true, atol=1e-9)
    assert error == pytest.approx(0.0, abs=1e-9)


def test_a_rigid_fit_leaves_what_no_pose_removes():
    # Two points 2 m apart onto two that are 4 m apart: 1 m is left at either end.
    pose, error = rigid_fit(np.array(((-1.0, 0.0), (1.0, 0.0))), np.array(((0.0, 1), (0.0, 5))))
    np.testing.assert_allclose(pose, (0.0, 3.0, np.pi / 2), atol=1e-9)
    assert error == pytest.approx(1.0)


def test_local_maps_are_laid_on_one_another_by_their_walls():
    """The gateways are seen 5 cm off; the walls put it right."""
    walls = np.concatenate((WALLS, WALLS[:, ::-1]))  # All four sides.
    true = np.array((0.3, -0.2, 0.1))
    later = visit(walls=transform_points(true, walls))
    later = later._replace(gateways=transform_segments(true, DOORS) + 0.05)
    found = align(later, visit(walls=walls), BOTH, 0.2)
    np.testing.assert_allclose(transform_points(found.pose, later.surface), walls, atol=1e-6)
    assert (found.overlap, found.evidence) == (1.0, 2 * len(walls))
    assert found.error == pytest.approx(0.0, abs=1e-9)


def test_a_wall_on_free_ground_contradicts_and_one_on_unknown_ground_does_not():
    more = np.stack((np.full(6, 2.0), np.linspace(1.0, 3.0, 6)), axis=1)
    later = visit(walls=np.concatenate((WALLS, more)))
    blind = align(later, visit(), BOTH, 0.2)
    assert (blind.overlap, blind.evidence) == (1.0, 2 * len(WALLS))
    found = align(later, visit()._replace(open_ground=more[:4].copy()), BOTH, 0.2)
    count = 2 * len(WALLS) + 4
    assert (found.overlap, found.evidence) == (pytest.approx(1 - 4 / count), count)


def test_a_later_visit_is_laid_on_the_first_one():
    """The odometry has drifted by an offset, which the layout takes back."""
    offset = (0.4, -0.3)
    visits = Visits(HsshConfig())
    visits.begin(visit())
    visits.begin(visit(50.0, offset=offset))
    star = visits.star(0)
    leaf = TopologicalMap(
        (0,), (star,), (((0, 1), (0, 0)),), (Numbered(0, (0, 1)), Numbered(0, (0, 1))), star.paths
    )
    frames = frames_of(visits, leaf)
    np.testing.assert_allclose(frames, ((0, 0, 0), (-offset[0], -offset[1], 0)), atol=1e-6)
    np.testing.assert_allclose(gateways_of(visits, leaf, frames)[0], DOORS)
