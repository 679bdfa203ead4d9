"""The laser: its errors, and the ray kernel against pymunk's own ray query and laws of ranges."""

from __future__ import annotations

import math

import numpy as np
import pymunk
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.stats import kstest

from albot_benchmarks.laser import floor_plan, measure_laser
from albot_core.errors import InputError
from albot_core.geometry.poses import compose, transform_segments
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import PIONEER_3DX, LaserConfig, RayCaster
from albot_env.sim.noise import normal_table
from albot_env.sim.physics import PhysicsSpace
from albot_env.sim.ray_casting import measure_ranges
from albot_maps.world import World

GEOMETRY = LaserGeometry(beams=20_000, spacing=1e-4, max_range=30.0)


def sensed(true_range: float, place: int = 0, **errors: float) -> np.ndarray:
    config = LaserConfig(geometry=GEOMETRY, **errors)
    ranges = np.empty(20_000)
    measure_ranges(
        np.full(20_000, true_range),
        np.uint64(1),
        place,
        normal_table(config.range_noise),
        config.dropout_threshold,
        GEOMETRY.max_range,
        np.empty(20_000, np.uint64),
        ranges,
    )
    return ranges


def test_ranges_scatter_by_the_noise_about_the_truth() -> None:
    ranges = sensed(5.0, range_noise=0.01, dropout=0.0)
    assert ranges.mean() == pytest.approx(5.0, abs=5e-4)
    assert ranges.std() == pytest.approx(0.01, rel=0.05)


def test_the_errors_are_normal_and_no_two_readings_share_them() -> None:
    one, other = (sensed(5.0, k * 20_000, range_noise=0.01, dropout=0.0) for k in range(2))
    assert kstest((one - 5.0) / 0.01, "norm").pvalue > 0.01
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.03
    assert abs(np.corrcoef(one[1:], one[:-1])[0, 1]) < 0.03


def test_beams_drop_out_at_the_rate_asked_for() -> None:
    ranges = sensed(5.0, range_noise=0.0, dropout=0.03)
    assert np.isinf(ranges).mean() == pytest.approx(0.03, rel=0.15)
    assert (ranges[np.isfinite(ranges)] == 5.0).all()


def test_noise_makes_no_range_negative_and_none_longer_than_the_reach() -> None:
    near = sensed(0.001, range_noise=0.01, dropout=0.0)
    assert near.min() == 0.0
    far = sensed(29.995, range_noise=0.01, dropout=0.0)
    assert far[np.isfinite(far)].max() < 30.0
    assert np.isinf(far).any()


def test_where_nothing_is_nothing_is_sensed() -> None:
    assert np.isinf(sensed(np.inf, range_noise=0.01, dropout=0.01)).all()


@pytest.mark.parametrize(
    ("field", "value"), [("range_noise", -1.0), ("range_noise", np.nan), ("dropout", 1.5)]
)
def test_impossible_errors_are_refused(field: str, value: float) -> None:
    with pytest.raises(InputError, match=f"LaserConfig.{field}: expected"):
        LaserConfig(**{field: value})


def test_the_simulated_beams_are_rays() -> None:
    with pytest.raises(InputError, match="beam_width 0"):
        LaserConfig(geometry=LaserGeometry(beam_width=0.01))


def test_the_benchmark_measures_three_sizes() -> None:
    rows = measure_laser(0.05)
    assert [row["segments"] for row in rows] == [60, 200, 1000]
    for row in rows:
        assert row["ratio_to_pymunk"] == row["us_per_scan_pymunk"] / row["us_per_scan"]
        assert min(row.values()) > 0


MILLIMETRE = 1e-3
FINE = LaserGeometry(beams=361, spacing=math.pi / 360)
ALL_ROUND = LaserGeometry(beams=360, first_bearing=-math.pi, spacing=math.pi / 180, max_range=8.0)
FULL_TURN = LaserGeometry(beams=361, first_bearing=-math.pi, spacing=math.pi / 180, max_range=8.0)
OFF_CENTRE = LaserGeometry(beams=90, first_bearing=0.3, mount=(0.1, -0.05, 0.7))


def poses_about(
    walls: np.ndarray, margin: float, count: int, rng: np.random.Generator
) -> np.ndarray:
    """So many poses by chance, up to a margin (m) beyond the walls."""
    low = walls.reshape(-1, 2).min(axis=0) - margin
    high = walls.reshape(-1, 2).max(axis=0) + margin
    return np.column_stack((rng.uniform(low, high, (count, 2)), rng.uniform(-4, 4, count)))


def oracle(
    space: PhysicsSpace, geometry: LaserGeometry, pose: np.ndarray, tilt: float
) -> np.ndarray:
    """Ranges by pymunk's query, every beam turned by `tilt`."""
    x, y, heading = compose(pose, np.array(geometry.mount)).tolist()
    ranges = np.full(geometry.beams, np.inf)
    for k, bearing in enumerate((heading + geometry.bearings + tilt).tolist()):
        end = x + 1e3 * math.cos(bearing), y + 1e3 * math.sin(bearing)
        hit = space.space.segment_query_first((x, y), end, 0.0, pymunk.ShapeFilter())
        if hit is not None and hit.alpha * 1e3 < geometry.max_range:
            ranges[k] = hit.alpha * 1e3
    return ranges


def disagreements(walls: np.ndarray, geometry: LaserGeometry, poses: np.ndarray) -> tuple[int, int]:
    """How many beams differ from the oracle by more than 1 mm, and how many do so for no reason.

    A reason is that a millionth of a radian decides: at a wall's end, at the end of the reach,
    or along a wall.
    """
    space = PhysicsSpace(walls, PIONEER_3DX)
    scans = RayCaster(walls, geometry).scan_batch(poses)
    differing = wrong = 0
    for scan, pose in zip(scans, poses, strict=True):
        differs = ~close(scan, oracle(space, geometry, pose, 0.0))
        if differs.any():
            either = [oracle(space, geometry, pose, tilt) for tilt in (-1e-6, 0.0, 1e-6)]
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
