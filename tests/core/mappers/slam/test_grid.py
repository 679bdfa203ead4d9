"""The log-odds grid against a cell-by-cell oracle, its bounds, and its sharing of tiles."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.tiles import MOST_TILES, TilePool
from albot_core.sensing.reading import LaserGeometry, LaserScan
from tests.core.mappers.slam.rooms import ROOM, scan_from

CONFIG = GridConfig()
POSE = np.array((0.31, -0.22, 0.4))


def one_beam(length: float, bearing: float = 0.0) -> LaserScan:
    geometry = LaserGeometry(beams=2, first_bearing=bearing, spacing=1e-12)
    return LaserScan(ranges=np.array((length, np.inf)), geometry=geometry)


def shares(grid: LogOddsGrid) -> dict[tuple[int, int], float]:
    """Probability by column and row from the map's origin, of the cells that are known."""
    layer = grid.layer()
    column, row = np.round(layer.origin[:2] / layer.resolution).astype(int)
    known = np.argwhere(np.isfinite(layer.occupancy))
    return {(c + column, r + row): float(layer.occupancy[r, c]) for r, c in known.tolist()}


def test_a_beam_frees_the_cells_that_it_crosses_and_marks_the_one_where_it_ends():
    grid = LogOddsGrid(CONFIG)
    grid.integrate(np.array((0.02, 0.02, 0.0)), one_beam(1.0))
    known = shares(grid)
    assert set(known) == {(k, 0) for k in range(21)}
    assert all(known[k, 0] == pytest.approx(0.4) for k in range(20))
    assert known[20, 0] == pytest.approx(0.7)


def test_the_cells_crossed_are_those_that_a_fine_walk_along_the_beam_meets():
    rng = np.random.default_rng(5)
    for _ in range(50):
        pose = np.array((*rng.uniform(-3, 3, 2), 0.0))
        bearing, length = rng.uniform(-np.pi, np.pi), rng.uniform(0.1, 8)
        grid = LogOddsGrid(CONFIG)
        grid.integrate(pose, one_beam(length, bearing))
        along = np.linspace(0, length, 20001)[:, None] * (np.cos(bearing), np.sin(bearing))
        walked = set(map(tuple, np.floor((pose[:2] + along) / 0.05).astype(int).tolist()))
        # The walk misses what the beam only touches at a corner.
        assert len(walked ^ set(shares(grid))) <= 1
        assert max(shares(grid).values()) == pytest.approx(0.7)


def test_cells_of_one_scan_count_once_and_those_of_many_up_to_the_bounds():
    grid = LogOddsGrid(CONFIG)
    grid.integrate(POSE, scan_from(POSE))
    assert set(np.round(list(shares(grid).values()), 3)) == {0.4, 0.7}
    for _ in range(30):
        grid.integrate(POSE, scan_from(POSE))
    values = np.array(list(shares(grid).values()))
    assert values.min() == pytest.approx(0.12)
    assert values.max() == pytest.approx(0.97)
    middles = (np.array([cell for cell, share in shares(grid).items() if share > 0.9]) + 0.5) * 0.05
    off = [min(abs(x + 4), abs(x - 5), abs(y + 3), abs(y - 4), abs(x - 1)) for x, y in middles]
    assert max(off) <= 0.05
    assert len(off) > 100


def test_beyond_its_reach_a_beam_only_frees_and_without_a_return_it_does_nothing():
    grid = LogOddsGrid(GridConfig(reach=2.0))
    grid.integrate(np.zeros(3), one_beam(5.0))
    known = shares(grid)
    assert max(known.values()) < 0.5
    assert max(column for column, _ in known) in (39, 40)
    empty = LogOddsGrid(CONFIG)
    empty.integrate(np.zeros(3), one_beam(np.inf))
    empty.integrate(np.zeros(3), one_beam(0.0))
    assert not shares(empty)
    assert empty.layer().occupancy.shape == (0, 0)


def test_memory_is_that_of_the_ground_seen():
    grid = LogOddsGrid(CONFIG)
    grid.integrate(np.zeros(3), scan_from(np.zeros(3)))
    near = grid.pool.used
    # Far away, the tiles between are not made.
    grid.integrate(np.array((200.0, 150.0, 0.0)), one_beam(3.0))
    assert grid.pool.used <= near + 3
    assert np.isfinite(grid.layer().occupancy).sum() < 40 * near * 32 * 32


def test_a_jump_of_ten_kilometres_is_refused_and_leaves_the_map_as_it_was():
    grid = LogOddsGrid(CONFIG)
    grid.integrate(POSE, scan_from(POSE))
    before, size = shares(grid), grid.index.size
    with pytest.raises(InputError, match=r"occupancy grid: expected ground that fits.*found 100"):
        grid.integrate(np.array((1e4, 1e4, 0.0)), scan_from(POSE))
    assert shares(grid) == before
    assert grid.index.size == size <= MOST_TILES


def test_a_fork_shares_its_tiles_until_one_of_the_two_writes():
    pool = TilePool()
    grid = LogOddsGrid(CONFIG, pool)
    grid.integrate(POSE, scan_from(POSE))
    used, before = pool.used, shares(grid)
    twins = [grid.fork() for _ in range(30)]
    assert pool.used == used
    twins[0].integrate(POSE, one_beam(1.0))
    assert used < pool.used <= used + 2
    assert shares(grid) == shares(twins[1]) == before != shares(twins[0])
    grid.integrate(POSE, one_beam(1.0, 1.0))
    assert shares(twins[1]) == before != shares(grid)
    for one in (grid, *twins):
        one.clear()
    assert pool.used == 0
    assert not pool.arrays.uses.any()
    assert sorted(pool.arrays.free) == list(range(len(pool.arrays.free)))


def test_many_grids_of_one_pool_are_each_as_if_alone():
    rng = np.random.default_rng(6)
    pool = TilePool()
    grids, alone = [LogOddsGrid(CONFIG, pool)], [LogOddsGrid(CONFIG)]
    for _ in range(60):
        k = int(rng.integers(len(grids)))
        pose = np.array((*rng.uniform(-2, 2, 2), rng.uniform(-3, 3)))
        if rng.random() < 0.3 and len(grids) < 8:
            grids.append(grids[k].fork())
            twin = LogOddsGrid(CONFIG)
            twin.restore(alone[k].state())
            alone.append(twin)
        elif rng.random() < 0.1 and len(grids) > 1:
            grids.pop(k).clear()
            alone.pop(k)
        else:
            grids[k].integrate(pose, scan_from(pose, ROOM))
            alone[k].integrate(pose, scan_from(pose, ROOM))
    for one, other in zip(grids, alone, strict=True):
        assert shares(one) == shares(other)


def test_what_is_restored_is_the_same_ground():
    grid = LogOddsGrid(CONFIG)
    grid.integrate(POSE, scan_from(POSE))
    twin = LogOddsGrid(CONFIG)
    twin.restore(grid.state())
    assert shares(twin) == shares(grid)
    for one in (grid, twin):
        one.integrate(POSE, one_beam(2.0))
    assert shares(twin) == shares(grid)


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("grid.places", lambda a: a * 0, "each once"),
        ("grid.places", lambda a: a * 10**15, "tiles at most"),
        ("grid.places", lambda a: a[:-1], "shape"),
        ("grid.cells", lambda a: a + np.nan, "finite"),
        ("grid.cells", lambda a: a + 99, "numbers from"),
    ],
)
def test_damaged_arrays_are_refused(name, damage, message):
    grid = LogOddsGrid(CONFIG)
    grid.integrate(POSE, scan_from(POSE))
    state = grid.state()
    state[name] = damage(state[name])
    with pytest.raises(InputError, match=message):
        LogOddsGrid(CONFIG).restore(state)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"cell": 0.0}, "cell"), ({"hit": 0.3}, "hit"), ({"reach": 1e9}, "reach")],
)
def test_a_config_that_makes_no_grid_is_refused(wrong, named):
    with pytest.raises(InputError, match=rf"GridConfig\..*{named}"):
        GridConfig(**wrong)
