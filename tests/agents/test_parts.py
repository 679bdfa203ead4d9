"""The parts of the gap explorer against hand-drawn scenes and slow answers."""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_agents.scripted.driving import decode_observation
from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.planning.explorer import StallDetector
from albot_core.planning.gap_explorer import CandidateGoals, find_gaps
from albot_core.planning.grid_search import (
    BLOCKED,
    FREE,
    TARGET,
    search_grid,
    trace_path,
)
from albot_core.planning.occupancy_grid import OccupancyGrid
from albot_core.planning.occupancy_grid_kernels import straight_is_free
from albot_core.planning.percept import Percept
from albot_core.planning.steering import (
    DIRECTIONS,
    SteeringConfig,
    admissible_command,
    free_distances,
    least_distance,
    steer,
)
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim import RayCaster
from albot_env.tasks.core.observation import ObservationConfig
from tests.env.conftest import drive

LASER = LaserGeometry()
WALL_WITH_DOOR = np.array(((2, -4, 2, 0.5), (2, 1.5, 2, 4), (5, -4, 5, 4)), float)
"""A wall 2 m ahead with a doorway of 1 m, and another wall 3 m behind it."""


def _points(walls: np.ndarray, pose: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    ranges = RayCaster(walls, LaserGeometry()).scan(np.array(pose, float))
    return np.minimum(ranges, 30.0)[:, None] * LASER.directions


def _percept(walls: np.ndarray, pose: tuple[float, float, float] = (0, 0, 0)) -> Percept:
    ranges = RayCaster(walls, LaserGeometry()).scan(np.array(pose, float))
    return Percept(
        ranges=np.minimum(ranges, 30.0),
        laser=LASER,
        pose=np.array(pose, float),
        motion=np.zeros(3),
    )


def test_a_doorway_is_a_gap_with_its_width_and_its_middle() -> None:
    doors = find_gaps(_points(WALL_WITH_DOOR), narrowest=0.6, reach=3.0)
    assert len(doors) == 2  # Once from either jamb.
    for door in doors:
        assert door.width == pytest.approx(1.0, abs=0.1)
        assert door.centre == pytest.approx((2.0, 1.0), abs=0.1)
        assert door.outward == pytest.approx((1.0, 0.0), abs=0.1)
        assert door.beyond(0.5) == pytest.approx((2.5, 1.0), abs=0.15)


def test_what_the_robot_cannot_pass_is_no_gap() -> None:
    assert not find_gaps(_points(WALL_WITH_DOOR), narrowest=1.2, reach=3.0)
    assert not find_gaps(_points(WALL_WITH_DOOR), narrowest=0.6, reach=1.5)


@given(st.floats(0.3, 1.5), st.floats(-0.4, 0.4))
@settings(deadline=None)
def test_a_long_wall_beside_the_robot_has_no_gap(aside: float, heading: float) -> None:
    """At a grazing angle its range jumps from beam to beam."""
    walls = np.array(((-50, aside, 50, aside), (-50, -1.5, 50, -1.5)), float)
    gaps = find_gaps(_points(walls, (0, 0, heading)), narrowest=0.6, reach=6.5)
    assert not gaps


@given(st.floats(-np.pi, np.pi), st.floats(0.5, 4))
@settings(deadline=None)
def test_free_ways_touch_nothing(bearing: float, distance: float) -> None:
    """A disc that goes its free way in any direction stays clear of a post."""
    post = np.array(((distance * np.cos(bearing), distance * np.sin(bearing)),))
    way = free_distances(np.repeat(post, 3, axis=0), 0.3)
    for direction, length in zip(DIRECTIONS, way, strict=True):
        for share in (0.25, 0.5, 0.75, 0.999):
            step = share * min(length, 10.0)
            at = step * np.array((np.cos(direction), np.sin(direction)))
            assert np.hypot(*(post[0] - at)) >= 0.3 - 1e-6 or distance < 0.3


def test_steering_goes_to_what_is_ahead_and_turns_to_what_is_not() -> None:
    nothing = _points(np.array(((40, -1, 40, 1),), float))
    speed, turn = steer(nothing, np.array((3.0, 0.0)))
    assert speed > 0.9
    assert turn == 0
    for side in (-1.0, 1.0):
        speed, turn = steer(nothing, np.array((-1.0, side)))
        assert speed == 0
        assert np.sign(turn) == side
        _, turn = steer(nothing, np.array((2.0, 0.5 * side)))
        assert np.sign(turn) == side


def test_steering_slows_before_a_wall_and_never_drives_into_it() -> None:
    speeds = [
        float(steer(_points(np.array(((x, -3, x, 3),), float)), np.array((9.0, 0.0)))[0])
        for x in (6.0, 1.3, 0.5, 0.34)
    ]
    assert speeds[0] > speeds[1] > speeds[2] == speeds[3] == 0


def test_the_least_distance_while_braking_is_the_stopping_distance() -> None:
    """A robot at v that brakes at a stands after v² / 2a; one step more at v before that."""
    wall = np.array(((3.0, 0.0),))
    for speed in (0.2, 0.5, 1.0):
        least = least_distance(wall, (speed, 0.0), (speed, 0.0), 0.33, 1.0, 0.1)
        assert 3.0 - least == pytest.approx(0.1 * speed + speed**2 / 2, abs=0.015)
    assert least_distance(wall, (0.0, 2.0), (0.0, 2.0), 0.33, 1.0, 0.1) == pytest.approx(3.0)


def test_the_robot_holds_back_before_a_wall_and_not_before_nothing() -> None:
    ahead = np.array((1.0, 0.0))
    fast, slow = np.array((0.1, 0.0, 0.0)), np.zeros(3)
    wall = _points(np.array(((0.75, -3, 0.75, 3),), float))
    assert admissible_command(ahead, wall, fast)[0] < 0.8
    assert np.array_equal(admissible_command(ahead, wall, slow), ahead)
    far = _points(np.array(((9.0, -3, 9.0, 3),), float))
    assert np.array_equal(admissible_command(ahead, far, fast), ahead)


def test_steering_settings_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"SteeringConfig\.clearance"):
        SteeringConfig(clearance=-1.0)


def _slow_search(grid: np.ndarray, start: tuple[int, int], radius: int) -> np.ndarray:
    """Dijkstra's search, cell by cell, over cells whose disc meets no blocked one."""
    size = len(grid)
    blocked = np.argwhere(grid == BLOCKED)
    ways = np.full(grid.shape, -1)
    queue = [(0, start)]
    while queue:
        way, (row, column) = heappop(queue)
        if ways[row, column] >= 0:
            continue
        ways[row, column] = way
        for r in range(row - 1, row + 2):
            for c in range(column - 1, column + 2):
                border = radius + 1
                if not (border <= r < size - border and border <= c < size - border):
                    continue
                near = (r - start[0]) ** 2 + (c - start[1]) ** 2 <= (radius + 1) ** 2
                apart = ((blocked - (r, c)) ** 2).sum(axis=1)
                clear = grid[r, c] == FREE and not (apart <= radius**2).any()
                if clear or (near and grid[r, c] != BLOCKED):
                    step = 5 if r == row or c == column else 7
                    slow = clear and (apart <= (radius + 1) ** 2).any()
                    heappush(queue, (way + (2 * step if slow else step), (r, c)))
    return ways


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=40)
def test_the_search_finds_the_shortest_ways(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid = rng.choice(np.array((0, FREE, BLOCKED), np.int8), (24, 24), p=(0.05, 0.9, 0.05))
    start = (int(rng.integers(3, 21)), int(rng.integers(3, 21)))
    grid[start] = FREE
    before = np.empty(grid.shape, np.int64)
    ways, _ = search_grid(grid, start, (2.0, 3.0), before, False, (-1, -1))
    assert np.array_equal(ways, _slow_search(grid, start, 2))
    for row, column in np.argwhere(ways > 0):
        r, c = divmod(int(before[row, column]), 24)
        step = 5 if r == row or c == column else 7
        assert ways[row, column] - ways[r, c] in (step, 2 * step)
        assert max(abs(r - row), abs(c - column)) == 1


@given(st.integers(0, 2**32 - 1), st.booleans())
@settings(deadline=None, max_examples=40)
def test_a_search_with_an_end_finds_the_shortest_way_there(
    seed: int, unknown_is_free: bool
) -> None:
    rng = np.random.default_rng(seed)
    grid = rng.choice(np.array((0, FREE, BLOCKED), np.int8), (24, 24), p=(0.1, 0.85, 0.05))
    start, goal = (tuple(rng.integers(3, 21, 2).tolist()) for _ in range(2))
    grid[start] = FREE
    before, settings = np.empty(grid.shape, np.int64), ((2.0, 3.0), unknown_is_free)
    all_ways, end = _search(grid, start, before, *settings, (-1, -1))
    assert end == (-1, -1)
    ways, end = _search(grid, start, before, *settings, goal)
    assert end == (goal if all_ways[goal] >= 0 else (-1, -1))
    if end == goal:
        cells = trace_path(ways, before, goal)
        assert (tuple(cells[0]), tuple(cells[-1])) == (start, goal)
        assert (np.abs(np.diff(cells, axis=0)).max(axis=1, initial=1) == 1).all()
        assert (ways[tuple(cells.T)] == all_ways[tuple(cells.T)]).all()
    wanted = (rng.random(grid.shape) < 0.03) & (grid == FREE)
    wanted[start] = False
    ways, end = _search(np.where(wanted, np.int8(TARGET), grid), start, before, *settings, (-1, -1))
    clear = _slow_search(np.where(grid == 0, FREE, grid) if unknown_is_free else grid, start, 2)
    near = np.hypot(*(np.indices(grid.shape) - np.array(start)[:, None, None])) <= 3
    reached = np.sort(clear[wanted & (clear >= 0) & ~near])
    if len(reached) and not (wanted & near).any():
        assert wanted[end]
        assert ways[end] == reached[0]


def _search(
    grid: np.ndarray,
    start: tuple[int, int],
    before: np.ndarray,
    radii: tuple[float, float],
    unknown_is_free: bool,
    goal: tuple[int, int],
) -> tuple[np.ndarray, tuple[int, int]]:
    ways, end = search_grid(grid, start, radii, before, unknown_is_free, goal)
    return ways, (int(end[0]), int(end[1]))


def test_a_straight_way_is_free_or_not() -> None:
    grid = np.full((40, 40), FREE, np.int8)
    grid[20, 25] = BLOCKED
    assert not straight_is_free(grid, (20, 5), (20, 35), 2, False)
    assert straight_is_free(grid, (15, 5), (15, 35), 2, False)
    assert straight_is_free(grid, (20, 5), (20, 20), 2, False)


def test_the_grid_finds_the_way_through_the_doorway() -> None:
    grid, percept = OccupancyGrid(), _percept(WALL_WITH_DOOR)
    grid.integrate(percept)
    ways = grid.shortest_paths(percept.pose)
    behind = np.array((3.5, 1.6))
    route = grid.route(ways, behind)
    assert route[0] == pytest.approx((0, 0), abs=0.1)
    assert np.hypot(*(route[-1] - behind)) < 0.75
    crossing = route[np.abs(route[:, 0] - 2.0).argmin()]
    assert crossing[1] == pytest.approx(1.0, abs=0.25)
    assert np.hypot(*np.diff(route, axis=0).T).max() < 0.15
    assert grid.length(ways, behind) == pytest.approx(4.0, abs=1.0)
    assert grid.length(ways, np.array((9.0, 0.0))) == np.inf
    assert not len(grid.route(ways, np.array((9.0, 0.0))))


def test_the_grid_grows_where_the_robot_goes_far() -> None:
    grid = OccupancyGrid()
    far = _percept(WALL_WITH_DOOR + np.tile((300.0, -200.0), 2), (300.0, -200.0, 0.0))
    grid.integrate(far)
    ways = grid.shortest_paths(far.pose)
    assert grid.length(ways, np.array((301.2, -200.0))) == pytest.approx(1.2, abs=0.6)


def test_candidates_are_kept_until_covered_and_not_twice() -> None:
    candidates, grid, far = CandidateGoals(), OccupancyGrid(), np.array((9.0, 9.0, 0.0))
    places = np.array(((1.0, 1.0), (1.2, 1.1), (3.0, 1.0)))
    candidates.add(places, places)
    candidates.add(places, places)
    assert candidates.goals == pytest.approx(np.array(((1.0, 1.0), (3.0, 1.0))))
    goal = candidates.goals[1]
    assert candidates.holds(goal)
    candidates.give_up(goal)
    candidates.add(places, places)
    assert candidates.goals == pytest.approx(np.array(((1.0, 1.0),)))
    candidates.readmit()
    candidates.add(places, places)
    assert len(candidates.goals) == 2
    candidates.drop_covered(grid, far)
    assert len(candidates.goals) == 2
    grid.integrate(_percept(WALL_WITH_DOOR))
    candidates.drop_covered(grid, far)
    assert candidates.goals == pytest.approx(np.array(((3.0, 1.0),)))
    candidates.drop_covered(grid, np.array((3.1, 1.0, 0.0)))
    assert not len(candidates.goals)


def test_ground_is_covered_where_it_is_in_view_and_near() -> None:
    grid = OccupancyGrid()
    grid.integrate(_percept(WALL_WITH_DOOR))
    ahead, far, behind, hidden, wall, beyond = (
        (1.5, 0.05),
        (3.0, 1.2),
        (-1.0, 0.0),
        (2.5, -1.0),
        (2.05, 0.0),
        (900.0, 0.0),
    )
    places = np.array((ahead, far, behind, hidden, wall, beyond))
    assert (grid.uncovered_share(places) == 0).tolist() == [True, False, False, False, True, False]


def test_obstacles_near_by_are_remembered() -> None:
    grid, percept = OccupancyGrid(), _percept(WALL_WITH_DOOR)
    grid.integrate(percept)
    things = grid.obstacles(np.array((1.8, 0.0, 0.0)), 1.0)
    assert len(things) > 8
    assert things[:, 0] == pytest.approx(2.05, abs=0.11)
    assert np.abs(things[:, 1]).max() <= 1.1


def test_a_stall_is_detected_on_the_spot_and_on_long_ways() -> None:
    stall, here = StallDetector(), np.zeros(3)
    stall.start(100.0)
    assert [stall.update(here) for _ in range(46)] == [False] * 45 + [True]
    stall.start(1.0)
    walk = [stall.update(np.array((0.2 * k, 0, 0))) for k in range(200)]
    assert walk.index(True) == 140
    assert stall.recovery_command() is None
    stall.start_recovery(np.random.default_rng(0))
    turning = [stall.recovery_command() for _ in range(13)]
    assert turning[-1] is None
    assert all(
        action is not None and action[0] == 0 and abs(action[1]) == 1.0 for action in turning[:-1]
    )


def test_percepts_undo_the_observation(make_env) -> None:
    env = make_env(odometer="ideal")
    for observation, info in drive(env, 40)[::10]:
        percept = decode_observation(observation, ObservationConfig())
        start = np.array((2.0, 2.0, 0.0))
        assert percept.pose == pytest.approx(relative(start, info["pose"]), abs=0.02)
        assert percept.ranges.min() > 0.2
        assert percept.motion[:2] == pytest.approx(np.zeros(2), abs=0.12)
        back = percept.to_robot(percept.to_map(np.array(((1.0, 2.0),))))
        assert back == pytest.approx(np.array(((1.0, 2.0),)))
