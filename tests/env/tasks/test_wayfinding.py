"""Ways over the ground, home and to what is not covered, against ways known in closed form."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.geometry.poses import relative
from albot_core.planning.grid_search import (
    BLOCKED,
    FREE,
    STEP,
    UNKNOWN,
    search_grid,
    trace_path,
)
from albot_core.planning.occupancy_grid import OccupancyGridConfig
from albot_core.sensing.reading import LaserGeometry
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.coverage_kernels import CoverageGrid, is_covered
from albot_env.tasks.core.observation import HOMING_PARTS, ObservationConfig
from albot_env.tasks.core.onward_kernels import find_onward
from albot_env.tasks.core.wayfinding import WayfindingConfig, empty_occupancy, with_occupancy
from albot_env.tasks.core.wayfinding_kernels import (
    OccupancyGrids,
    occupancy_of,
    tell_way,
)
from albot_env.tasks.explore.env import ExploreEnv
from albot_env.tasks.explore.task import ExploreConfig
from albot_env.tasks.homing.task import HomingConfig
from tests.core.scenes import scan_from
from tests.env.tasks.oracles import Coverage, Wayfinding

CONFIG = WayfindingConfig()
ANY = np.inf
"""A known way so long that any other is worth leaving it for."""
NEW = "shortcut", "path", "onward"
STILL, HALF_TURN = np.zeros(3), np.array((0.0, 0.0, np.pi))
UNKNOWN_WAY = np.array((*6 * (np.nan,), np.inf))
FAR_WALL = np.array(((30.0, -30.0, 30.0, 30.0),))
ALL_ROUND = LaserGeometry(beams=361, first_bearing=-np.pi, spacing=2 * np.pi / 360)


class Robot:
    """One that sees walls exactly, covers what it sees, and finds its ways."""

    def __init__(self, config: WayfindingConfig = CONFIG, extent: float = 20.0) -> None:
        self.ways = Wayfinding(config, CoverageConfig(), extent)
        self.ground = Coverage(CoverageConfig(), extent)

    def look(
        self,
        pose,
        walls=FAR_WALL,
        home=(0.0, 0.0),
        motion=STILL,
        laser=None,
        known=UNKNOWN_WAY,
    ) -> None:
        """Look once from a pose x, y, heading."""
        at = np.array(pose, float)
        scan = scan_from(at, walls, laser)
        self.ground.follow(motion, at, scan)
        self.ways.follow(motion, at, scan, np.array((*home, 0.0)), self.ground, known)

    def look_again(self, pose, walls=FAR_WALL, home=(0.0, 0.0), motion=STILL, laser=None) -> None:
        """Come to a pose, and look from there until the next search is over."""
        for k in range(CONFIG.every + 1):
            self.look(pose, walls, home, motion if k == 0 else STILL, laser)


def _seen(pose, walls=FAR_WALL, home=(0.0, 0.0)) -> Robot:
    """One that has looked once."""
    robot = Robot()
    robot.look(pose, walls, home)
    return robot


@given(st.floats(-9, 9), st.floats(-9, 9), st.floats(-np.pi, np.pi))
@settings(deadline=None, max_examples=40)
def test_over_open_ground_it_leads_straight_home(x: float, y: float, heading: float) -> None:
    point = _seen((x, y, heading)).ways.shortcut(ANY)
    away, ahead = np.hypot(x, y), point - (x, y)
    assert np.hypot(*ahead) <= CONFIG.ahead + 2 * CONFIG.cell
    if away > 2 * CONFIG.ahead:
        # Steps lead along eight directions: where it bends is a matter of chance.
        turned = np.arctan2(*ahead[::-1]) - np.arctan2(-y, -x)
        assert np.cos(turned) > np.cos(np.radians(46))
    if away < CONFIG.ahead - 2 * CONFIG.cell:
        assert point.tolist() == [0.0, 0.0]


def test_a_known_way_is_left_where_it_is_so_much_longer() -> None:
    ways = _seen((8.0, 0.0, np.pi)).ways
    assert np.isnan(ways.shortcut(8.0 * CONFIG.worth - 0.3)).all()
    assert np.isfinite(ways.shortcut(8.0 * CONFIG.worth + 0.3)).all()


def test_it_leads_round_the_end_of_a_wall_in_view() -> None:
    """From (5, 0) to home the way past the wall's end (2.5, 3) is √(2.5² + 3²) twice."""
    walls = np.array((*FAR_WALL, (2.5, -7.5, 2.5, 3.0)))
    ways = _seen((5.0, 0.0, np.pi), walls).ways
    around = 2 * np.hypot(2.5, 3.0 + 0.25 + CONFIG.clearance)
    assert np.isnan(ways.shortcut(0.9 * around * CONFIG.worth)).all()
    x, y = ways.shortcut(1.25 * around * CONFIG.worth)
    assert x > 2.4
    assert y > 1.5


def _way(x: float, y: float, length: float) -> np.ndarray:
    """A known way home with its next point."""
    return np.array((*4 * (np.nan,), x, y, length))


def _path(known: np.ndarray, walls=FAR_WALL) -> np.ndarray:
    """The point ahead on the path home of one that has looked once from (5, 0)."""
    robot = Robot()
    robot.look((5.0, 0.0, np.pi), walls, known=known)
    return robot.ways.path


def test_the_path_is_the_known_way_or_a_shortcut_that_is_worth_it() -> None:
    np.testing.assert_array_equal(_path(_way(5.0, 2.0, 5.0 * CONFIG.worth - 0.3)), (5.0, 2.0))
    x, y = _path(_way(5.0, 2.0, 5.0 * CONFIG.worth + 0.3))
    assert x < 3.0
    assert abs(y) < 0.5


def test_without_a_known_way_and_near_home_the_path_is_the_shortest() -> None:
    np.testing.assert_array_equal(_path(UNKNOWN_WAY), _path(_way(5.0, 2.0, 50.0)))
    np.testing.assert_array_equal(_path(_way(np.nan, np.nan, 2.0)), _path(UNKNOWN_WAY))


def test_the_path_leads_round_what_stands_before_the_known_way() -> None:
    """The next point, (4, 0), is behind a wall that ends 1.5 m to the right."""
    walls = np.array((*FAR_WALL, (4.5, -7.5, 4.5, 1.5)))
    point = _path(_way(4.0, 0.0, 4.0), walls)
    assert point[1] > 0.8
    barred = _path(_way(100.0, 0.0, 4.0))  # Off the grid: only the point itself is known.
    np.testing.assert_array_equal(barred, (100.0, 0.0))


def _look_at_barred_way(robot: Robot, searches: int, length: float) -> np.ndarray:
    """The path after some searches; a wall is before the known way, which leads on at its left."""
    walls = np.array((*FAR_WALL, (4.5, -4.2, 4.5, 4.0)))
    for _ in range(searches * CONFIG.every):
        robot.look((5.0, 0.0, np.pi), walls, (0.0, 8.0), known=_way(3.0, -1.0, length))
    return robot.ways.path


def test_a_known_way_that_is_barred_is_left_until_the_robot_has_come_farther_on_it() -> None:
    """Past the wall's other end it is some 10 m home: so long a shortcut is not worth it."""
    robot = Robot()
    along = _look_at_barred_way(robot, 9, 11.0)
    shortcut = robot.ways.shortcut(ANY)
    assert along[1] < -1.0
    assert shortcut[1] > 1.0
    np.testing.assert_array_equal(_look_at_barred_way(robot, 1, 11.0), shortcut)
    np.testing.assert_array_equal(_look_at_barred_way(robot, 5, 10.6), shortcut)
    np.testing.assert_array_equal(_look_at_barred_way(robot, 1, 10.4), along)


def test_what_bars_the_way_is_remembered_until_it_is_seen_to_be_gone() -> None:
    wall, home = np.array(((2.5, -9.0, 2.5, 9.0),)), (6.0, 0.0)
    facing, averted = np.array((1.0, 0.0, 0.0)), np.array((1.0, 0.0, np.pi))
    robot = Robot()
    robot.look(facing, wall, home)
    barred = robot.ways.shortcut(ANY)
    robot.look_again(averted, FAR_WALL, home, HALF_TURN)
    np.testing.assert_array_equal(robot.ways.shortcut(ANY), barred)
    assert abs(barred[1]) > 1.0
    robot.look_again(facing, FAR_WALL, home, HALF_TURN)
    assert abs(robot.ways.shortcut(ANY)[1]) < 0.3


def test_a_belief_that_jumps_begins_an_empty_grid() -> None:
    wall, home = np.array(((2.5, -9.0, 2.5, 9.0),)), (6.0, 0.0)
    here, there = np.array((1.0, 0.0, 0.0)), np.array((1.0, 1.0, np.pi))
    stayed, jumped = _seen(here, wall, home), _seen(here, wall, home)
    stayed.look_again(there, FAR_WALL, home, relative(here, there))
    jumped.look_again(there, FAR_WALL, home)
    assert abs(stayed.ways.shortcut(ANY)[1] - 1.0) > 0.8
    assert abs(jumped.ways.shortcut(ANY)[1] - 1.0) < 0.8


@given(st.lists(st.tuples(*3 * (st.floats(-4, 4),)), min_size=1, max_size=3))
@settings(deadline=None, max_examples=20)
def test_what_is_drawn_is_in_the_part_that_is_searched(poses: list) -> None:
    robot = Robot()
    for pose in poses:
        robot.look_again(pose, _square(5.0), laser=ALL_ROUND)
    occupancy = robot.ways._occupancy
    rows, columns = np.nonzero(occupancy_of(occupancy, 0))
    (top, left), (bottom, right) = occupancy.drawn[0]
    assert top <= rows.min() <= rows.max() < bottom
    assert left <= columns.min() <= columns.max() < right


SEARCH = replace(CONFIG, first=3.0, last=12.0, sight=1.2).search(0.25)
"""A search that widens its range often."""


def _rooms(seed: int) -> tuple[OccupancyGrids, CoverageGrid]:
    """A known ground of free, blocked and unseen blocks of cells, of which much is covered."""
    rng = np.random.default_rng(seed)
    occupancy = with_occupancy(empty_occupancy(1), 0, CONFIG.side(8.0))
    cells = occupancy_of(occupancy, 0)
    coarse = rng.choice((FREE, UNKNOWN, BLOCKED), (len(cells) // 4 + 1,) * 2, p=(0.86, 0.07, 0.07))
    first, last = rng.integers(0, len(cells) // 2, 2), rng.integers(len(cells) // 2, len(cells), 2)
    drawn = slice(first[0], last[0]), slice(first[1], last[1])
    cells[drawn] = np.kron(coarse, np.ones((4, 4), np.int8))[drawn]
    occupancy.drawn[0] = first, last
    occupancy.beliefs[0] = (*rng.uniform(-6, 6, 2), 0.0)
    ground = Coverage(CoverageConfig(), 10.0)
    for _ in range(rng.integers(0, 150)):
        at = np.array((*rng.uniform(-9, 9, 2), 0.0))
        ground.add(at, scan_from(at, FAR_WALL, ALL_ROUND))
    return occupancy, ground.ground


def _plainly(occupancy: OccupancyGrids, covered: CoverageGrid) -> np.ndarray:
    """The way onward: to the best of all cells, searched in the first range in which it lies."""
    cells, shares = occupancy_of(occupancy, 0), _new_shares(occupancy_of(occupancy, 0), covered)
    start = np.floor(occupancy.beliefs[0, 1::-1] / SEARCH.cell + 1e-6).astype(int) + len(cells) // 2
    found = {}
    for around in (SEARCH.first, SEARCH.last):
        low = np.maximum(start - int(around / SEARCH.cell), 0)
        high = np.minimum(start + int(around / SEARCH.cell) + 1, len(cells))
        box = slice(low[0], high[0]), slice(low[1], high[1])
        before = np.empty(cells[box].shape, np.int64)
        part, here = cells[box].copy(), tuple(start - low)
        ways, _ = search_grid(part, here, SEARCH.radii, before, False, (-1, -1))
        gains = shares[box] / (ways / STEP * SEARCH.cell + SEARCH.stay) * (ways >= 0)
        end = np.unravel_index(gains.argmax(), gains.shape)
        way = np.array((np.nan, np.nan, np.inf))
        if gains[end] > 0:
            route = trace_path(ways, before, end)
            tell_way(part, tuple(low), len(cells) // 2, route, SEARCH, way)
            way[2] = ways[end] / STEP * SEARCH.cell
        found[around] = gains[end], way
    return next(way for gain, way in found.values() if gain == found[SEARCH.last][0])


def _new_shares(cells: np.ndarray, covered: CoverageGrid) -> np.ndarray:
    """The share of the points around each cell that are new, and in sight of it."""
    side, extent = len(cells), covered.sides[0] / 2 * covered.cell
    middles = (np.arange(side) - side // 2 + 0.5) * SEARCH.cell
    inside = abs(middles) < extent
    new = [[not is_covered(covered, 0, x, y) for x in middles] for y in middles]
    new, open_ = np.array(new) & np.outer(inside, inside), cells != BLOCKED
    margin = int(np.round(SEARCH.sight / SEARCH.cell))
    new, open_ = np.pad(new, margin), np.pad(open_, margin)
    shares, is_candidate = np.zeros(cells.shape), np.zeros(cells.shape)
    is_candidate[::2, ::2] = 1
    for offset in np.mgrid[-2:3, -2:3].reshape(2, -1).T:
        end = np.round(offset * SEARCH.sight / 2 / SEARCH.cell).astype(int)
        count = max(1, *abs(end))
        seen = _shifted(new, end, side)
        for k in range(1, count + 1):
            seen &= _shifted(open_, np.round(end * k / count).astype(int), side)
        shares += seen
    return shares / 25 * is_candidate


def _shifted(padded: np.ndarray, by: np.ndarray, side: int) -> np.ndarray:
    """What lies so many rows and columns from each cell."""
    row, column = by + (len(padded) - side) // 2
    return padded[row : row + side, column : column + side].copy()


@given(st.integers(0, 100_000))
@settings(deadline=None, max_examples=25)
def test_the_way_onward_leads_to_the_largest_gain_of_all(seed: int) -> None:
    occupancy, covered = _rooms(seed)
    find_onward(occupancy, 0, SEARCH, covered)
    np.testing.assert_array_equal(occupancy.onwards[0], _plainly(occupancy, covered))


def _square(half: float) -> np.ndarray:
    corners = half * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)), float)
    return np.hstack((corners[:-1], corners[1:]))


def test_where_all_is_barred_there_is_no_way() -> None:
    robot = Robot()
    robot.look(STILL, _square(1.0), (5.0, 0.0), laser=ALL_ROUND)
    assert np.isnan(robot.ways.shortcut(ANY)).all()
    assert np.isnan(robot.ways.onward).all()


def test_home_inside_a_wall_is_come_near_to() -> None:
    wall = np.array(((0.0, -9.0, 0.0, 9.0),))
    point = _seen((2.0, 0.0, np.pi), wall, (0.05, 0.0)).ways.shortcut(ANY)
    np.testing.assert_allclose(point, (0.05, 0.0), atol=0.7)


@pytest.mark.parametrize("x", [19.5, 22.0, 26.5, 26.9, 400.0])
def test_at_the_edge_of_the_grid_and_beyond_there_is_no_way_out_of_bounds(x: float) -> None:
    """A grid for maps of 20 m reaches 27 m; nothing is drawn where a scan would leave it.

    From 22 m ground is still in sight that a map of 20 m has.
    """
    robot = _seen((x, 0.0, np.pi))
    assert np.isfinite(robot.ways.shortcut(ANY)).all() == (x < 26.8)
    assert np.isfinite(robot.ways.onward).all() == (x < 20.0 + CONFIG.sight + CONFIG.cell)


@given(st.floats(-9, 9), st.floats(-9, 9), st.floats(-np.pi, np.pi))
@settings(deadline=None, max_examples=30)
def test_over_open_ground_the_way_on_ends_where_covered_ground_does(
    x: float, y: float, heading: float
) -> None:
    """Ground is covered as far as 2 m, and beside it the laser shows none."""
    ahead = _seen((x, y, heading)).ways.onward - (x, y)
    cell = CoverageConfig().cell
    assert np.hypot(*ahead) <= CoverageConfig().radius + 2 * cell
    assert np.cos(heading) * ahead[0] + np.sin(heading) * ahead[1] > -cell


def test_the_way_on_leads_through_the_only_door() -> None:
    """All of a small room is covered at a look but what lies beyond its door, ahead."""
    room = [(-0.5, -0.2, 1.6, -0.2), (-0.5, 1.8, 1.6, 1.8), (-0.5, -0.2, -0.5, 1.8)]
    room += [(1.6, -0.2, 1.6, 0.3), (1.6, 1.3, 1.6, 1.8)]
    robot = Robot()
    robot.look((0.0, 0.8, 0.0), np.array((*room, (5.0, -9.0, 5.0, 9.0))), laser=ALL_ROUND)
    x, y = robot.ways.onward
    assert x > 1.3  # Before or in the door: it is narrow, and not to be gone to from afar.
    assert 0.3 < y < 1.3


@pytest.mark.parametrize(("last", "is_found"), [(16.0, True), (8.0, False)])
def test_ground_not_covered_is_looked_for_farther_and_farther(last, is_found) -> None:
    """It has come 12 m along a corridor; what it has not covered lies where it set out."""
    sides = ((-1.5, 0.77, 13.0, 0.77), (-1.5, -0.77, 13.0, -0.77))
    corridor = np.array((*sides, (13.0, -0.77, 13.0, 0.77)))
    robot = Robot(replace(CONFIG, first=4.0, last=last))
    step, at = np.array((0.3, 0.0, 0.0)), np.zeros(3)
    robot.look(at, corridor, laser=ALL_ROUND)
    for _ in range(38):
        at = at + step
        robot.look(at, corridor, motion=step, laser=ALL_ROUND)
    robot.look_again(at, corridor)
    x, y = robot.ways.onward
    assert np.isfinite(x) == is_found
    if is_found:
        assert x < at[0] - 1.0
        assert abs(y) < 0.7


@pytest.mark.parametrize(
    ("stay", "end", "leads_ahead"),
    [(3.0, 12.0, True), (0.01, 12.0, False), (3.0, 4.9, False)],
    ids=["much new ground", "the nearest first", "nothing but slivers"],
)
def test_the_way_on_leads_past_slivers_as_long_as_there_is_more(stay, end, leads_ahead) -> None:
    """In a hall it has been 3 m ahead, and is back near two corners that it has not quite seen."""
    hall = [(-2.2, -1.27, end, -1.27), (-2.2, 1.27, end, 1.27)]
    hall += [(x, -1.27, x, 1.27) for x in (-2.2, end)]
    walls, robot = np.array(hall), Robot(replace(CONFIG, stay=stay))
    at = np.zeros(3)
    robot.look(at, walls, laser=ALL_ROUND)
    for step in (0.3, -0.3):
        for _ in range(10):
            motion = np.array((step, 0.0, 0.0))
            at = at + motion
            robot.look(at, walls, motion=motion, laser=ALL_ROUND)
    robot.look_again(at, walls)
    x, y = robot.ways.onward
    assert (x > 1.0) == leads_ahead
    assert abs(y) < 1.2


@pytest.mark.parametrize(
    "wrong",
    [
        {"worth": 0.9}, {"worth": np.nan}, {"every": 0}, {"cell": 0.0}, {"comfort_clearance": 0.02},
        {"margin": 0.5}, {"first": 0.3}, {"last": 7.0},
        {"sight": 0.0}, {"stay": 0.0},
    ],
)  # fmt: skip
def test_settings_that_are_none_are_refused(wrong) -> None:
    with pytest.raises(InputError, match=rf"WayfindingConfig\.{next(iter(wrong))}"):
        WayfindingConfig(**wrong)
    with pytest.raises(InputError, match=r"OccupancyGridConfig\.comfort_clearance"):
        OccupancyGridConfig(comfort_clearance=0.02)


def test_a_batch_shows_what_a_single_one_shows() -> None:
    observation_config = replace(ObservationConfig(), parts=(*HOMING_PARTS, *NEW), laser_sectors=12)
    settings = {"world": "random:office:8", "config": HomingConfig(observations=observation_config)}
    batch = gymnasium.make_vec("Albot/Homing-v0", 2, "vector_entry_point", **settings)
    singles = [gymnasium.make("Albot/Homing-v0", **settings) for _ in range(2)]
    rows, _ = batch.reset(seed=33)
    alone = [env.reset(seed=33 + i)[0] for i, env in enumerate(singles)]
    rng = np.random.default_rng(0)
    shown = []
    for _ in range(120):
        np.testing.assert_array_equal(rows, alone)
        parts = observation_config.split_rows(rows)
        shown.append([parts[name][:, 3].copy() for name in NEW])
        actions = rng.uniform((0.1, -0.8, -1), (0.7, 0.8, -0.9), (2, 3)).astype(np.float32)
        rows, *_ = batch.step(actions)
        alone = [env.step(action)[0] for env, action in zip(singles, actions, strict=True)]
    shortcut, path, onward = np.swapaxes(shown, 0, 1)
    assert set(np.unique(shortcut)) == {-1.0, 1.0}
    assert (path == 1.0).all()
    assert (onward == 1.0).all()


@pytest.mark.parametrize("mapper", ["albot1", "none"])
def test_a_new_episode_begins_with_an_empty_sketch(two_rooms, mapper) -> None:
    config = ExploreConfig(observations=ObservationConfig(parts=("laser", *NEW)))
    driven, fresh = (ExploreEnv(two_rooms, mapper=mapper, config=config) for _ in range(2))
    driven.reset(seed=3)
    for _ in range(60):
        driven.step(np.array((0.5, 0.2, -1), np.float32))
    seen = [[env.reset(seed=7)[0]] for env in (driven, fresh)]
    for env, observations in zip((driven, fresh), seen, strict=True):
        observations += [env.step(np.array((0.4, -0.1, -1), np.float32))[0] for _ in range(30)]
    np.testing.assert_array_equal(*seen)
