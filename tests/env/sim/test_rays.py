"""The ray kernel against pymunk's own ray query, and laws that ranges obey."""

from __future__ import annotations

import math

import numpy as np
import pymunk
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from albot_benchmarks.laser import floor_plan
from albot_core.geometry.poses import compose, transform_segments
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import PIONEER_3DX, RayCaster
from albot_env.sim.physics import PhysicsSpace
from albot_maps.world import World
from tests.env.sim.whereabouts import poses_about

MILLIMETRE = 1e-3
FINE = LaserGeometry(beams=361, spacing=math.pi / 360)
ALL_ROUND = LaserGeometry(beams=360, first_bearing=-math.pi, spacing=math.pi / 180, max_range=8.0)
FULL_TURN = LaserGeometry(beams=361, first_bearing=-math.pi, spacing=math.pi / 180, max_range=8.0)
OFF_CENTRE = LaserGeometry(beams=90, first_bearing=0.3, mount=(0.1, -0.05, 0.7))


def oracle(
    floor: PhysicsSpace, geometry: LaserGeometry, pose: np.ndarray, tilt: float
) -> np.ndarray:
    """Ranges by pymunk's query, every beam turned by `tilt`."""
    x, y, heading = compose(pose, np.array(geometry.mount)).tolist()
    ranges = np.full(geometry.beams, np.inf)
    for k, bearing in enumerate((heading + geometry.bearings + tilt).tolist()):
        end = x + 1e3 * math.cos(bearing), y + 1e3 * math.sin(bearing)
        hit = floor.space.segment_query_first((x, y), end, 0.0, pymunk.ShapeFilter())
        if hit is not None and hit.alpha * 1e3 < geometry.max_range:
            ranges[k] = hit.alpha * 1e3
    return ranges


def disagreements(walls: np.ndarray, geometry: LaserGeometry, poses: np.ndarray) -> tuple[int, int]:
    """How many beams differ from the oracle by more than 1 mm, and how many do so for no reason.

    A reason is that a millionth of a radian decides: at a wall's end, at the end of the reach,
    or along a wall.
    """
    floor = PhysicsSpace(walls, PIONEER_3DX)
    scans = RayCaster(walls, geometry).scan_batch(poses)
    differing = wrong = 0
    for scan, pose in zip(scans, poses, strict=True):
        differs = ~close(scan, oracle(floor, geometry, pose, 0.0))
        if differs.any():
            either = [oracle(floor, geometry, pose, tilt) for tilt in (-1e-6, 0.0, 1e-6)]
            nearest, farthest = np.min(either, axis=0), np.max(either, axis=0)
            between = (scan >= nearest - MILLIMETRE) & (scan <= farthest + MILLIMETRE)
            at_reach = np.abs(np.minimum(scan, nearest) - geometry.max_range) < MILLIMETRE
            differing += int(differs.sum())
            wrong += int((differs & ~(between | at_reach | close(scan, nearest))).sum())
    return differing, wrong


def close(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where two scans agree within a millimetre, or both see nothing."""
    with np.errstate(invalid="ignore"):
        return (np.abs(a - b) < MILLIMETRE) | (np.isinf(a) & np.isinf(b))


@pytest.mark.parametrize("geometry", [LaserGeometry(), FINE, ALL_ROUND, FULL_TURN, OFF_CENTRE])
@pytest.mark.parametrize("segments", [60, 200])
def test_it_agrees_with_pymunk_in_floor_plans(segments: int, geometry: LaserGeometry) -> None:
    rng = np.random.default_rng(segments)
    walls = floor_plan(segments, rng)
    poses = poses_about(walls, 2.0, 150, rng)
    differing, wrong = disagreements(walls, geometry, poses)
    assert differing <= 1
    assert wrong == 0


quarter_metres = st.integers(-12, 12).map(lambda n: n / 4)
points = st.tuples(quarter_metres, quarter_metres)
segments = st.tuples(points, points).filter(lambda s: s[0] != s[1]).map(lambda s: (*s[0], *s[1]))
wall_sets = st.lists(segments, min_size=1, max_size=12).map(lambda s: np.array(s, dtype=float))
headings = st.one_of(
    st.integers(-4, 4).map(lambda n: n * math.pi / 4), st.floats(-math.pi, math.pi)
)


@settings(deadline=None, max_examples=300)
@given(walls=wall_sets, origin=points, heading=headings)
@example(walls=np.array([[0.0, 0.0, 0.25, 0.0]]), origin=(-1.5, 0.0), heading=math.pi / 4)
def test_it_agrees_with_pymunk_where_walls_cross_touch_and_line_up(
    walls: np.ndarray, origin: tuple[float, float], heading: float
) -> None:
    """On a grid of quarter metres beams run along walls and origins lie on them."""
    if min(distances(walls, origin)) == 0.0:
        # Standing on a wall is the one thing that is left open: no robot can.
        origin = (origin[0] + 0.0625, origin[1] + 0.0371)
    _, wrong = disagreements(walls, LaserGeometry(), np.array([[*origin, heading]]))
    assert wrong == 0


def distances(walls: np.ndarray, origin: tuple[float, float]) -> list[float]:
    """Distance of a point from every wall."""
    a, e = walls[:, :2] - origin, walls[:, 2:] - walls[:, :2]
    along = np.clip(-(a * e).sum(axis=1) / (e * e).sum(axis=1), 0, 1)
    near = a + along[:, None] * e
    return np.hypot(near[:, 0], near[:, 1]).tolist()


@settings(deadline=None, max_examples=100)
@given(
    walls=wall_sets,
    pose=st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3)).map(np.array),
    frame=st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)).map(np.array),
)
def test_moving_world_and_robot_together_changes_no_range(
    walls: np.ndarray, pose: np.ndarray, frame: np.ndarray
) -> None:
    # Rounding may turn a robot on a wall's line, which sees it edge-on, to either side.
    assume(min(line_distances(walls, pose)) > MILLIMETRE)
    geometry = LaserGeometry(beams=13, spacing=0.25, first_bearing=-1.4142)
    here = RayCaster(walls, geometry)
    moved = RayCaster(transform_segments(frame, walls), geometry).scan(compose(frame, pose))
    either = [here.scan(compose(pose, np.array([0, 0, tilt]))) for tilt in (-1e-6, 0.0, 1e-6)]
    assert (moved >= np.min(either, axis=0) - MILLIMETRE).all()
    assert (moved <= np.max(either, axis=0) + MILLIMETRE).all()


def line_distances(walls: np.ndarray, pose: np.ndarray) -> list[float]:
    """Distance of a pose from the line through every wall."""
    a, e = walls[:, :2] - pose[:2], walls[:, 2:] - walls[:, :2]
    return (np.abs(a[:, 0] * e[:, 1] - a[:, 1] * e[:, 0]) / np.hypot(*e.T)).tolist()


@pytest.mark.parametrize("segments", [60, 200, 1000])
def test_lists_of_visible_walls_change_nothing(segments: int) -> None:
    rng = np.random.default_rng(segments)
    walls = floor_plan(segments, rng)
    poses = poses_about(walls, 1.0, 20000, rng)
    listed = RayCaster(walls, LaserGeometry()).scan_batch(poses)
    brute = RayCaster(walls, LaserGeometry(), indexed=False).scan_batch(poses)
    np.testing.assert_array_equal(listed, brute)


@settings(deadline=None, max_examples=200)
@given(walls=st.lists(segments, min_size=3, max_size=30).map(lambda s: np.array(s, dtype=float)))
def test_lists_of_visible_walls_change_nothing_in_tangles(walls: np.ndarray) -> None:
    """Walls on a grid of quarter metres share ends, cross, and hang together in chains."""
    rng = np.random.default_rng(len(walls))
    poses = np.column_stack((rng.uniform(-3.5, 3.5, (300, 2)), rng.uniform(-4, 4, 300)))
    listed = RayCaster(walls, ALL_ROUND).scan_batch(poses)
    np.testing.assert_array_equal(
        listed, RayCaster(walls, ALL_ROUND, indexed=False).scan_batch(poses)
    )


def test_no_beam_slips_out_between_walls_that_share_a_corner(box: World) -> None:
    rng = np.random.default_rng(0)
    around = np.linspace(0, 2 * math.pi, 60, endpoint=False)
    corners = 6 * np.column_stack((np.cos(around), np.sin(around)))
    room = np.hstack((corners, np.roll(corners, -1, axis=0)))
    poses = np.column_stack((rng.integers(-12, 13, (5000, 2)) / 3.2, rng.uniform(-4, 4, 5000)))
    # Half of the robots look exactly at a corner with one of their beams.
    aim = corners[rng.integers(0, 60, 2500)] - poses[:2500, :2]
    poses[:2500, 2] = np.arctan2(aim[:, 1], aim[:, 0])
    assert RayCaster(room, LaserGeometry()).scan_batch(poses).max() < 12.0
    straight = box.starts[0] + np.column_stack((np.zeros((8, 2)), np.arange(8) * math.pi / 4))
    assert RayCaster(box.walls, LaserGeometry()).scan_batch(straight).max() < 7.072


def test_a_wall_beyond_the_reach_returns_nothing() -> None:
    wall = np.array([[9.0, -5.0, 9.0, 5.0]])
    pose = np.zeros(3)
    assert np.isinf(RayCaster(wall, LaserGeometry(max_range=9.0)).scan(pose)).all()
    scan = RayCaster(wall, LaserGeometry(max_range=9.01)).scan(pose)
    assert scan[90] == pytest.approx(9.0, abs=1e-5)
    assert np.isfinite(scan).sum() == 5


def test_one_scan_is_a_batch_of_one() -> None:
    rng = np.random.default_rng(5)
    walls = floor_plan(60, rng)
    rays = RayCaster(walls, LaserGeometry())
    poses = np.column_stack((rng.uniform(0, 15, (50, 2)), rng.uniform(-4, 4, 50)))
    singles = np.stack([rays.scan(pose) for pose in poses])
    np.testing.assert_array_equal(rays.scan_batch(poses), singles)


def test_no_poses_give_no_scans(box: World) -> None:
    assert RayCaster(box.walls, LaserGeometry()).scan_batch(np.zeros((0, 3))).shape == (0, 181)
