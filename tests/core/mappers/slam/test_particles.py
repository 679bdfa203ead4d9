"""Particles against slow obvious ones: a whole map and a whole way for each."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.slam.grid import GridConfig, LogOddsGrid
from albot_core.mappers.slam.particles import Particles
from albot_core.mappers.slam.tiles import NONE
from tests.core.mappers.slam.rooms import scan_from

CONFIG = GridConfig(cell=0.1, reach=8.0)
COUNT = 5


class Obvious:
    """The same with copies of everything."""

    def __init__(self) -> None:
        self.poses = np.zeros((COUNT, 3))
        self.seen: list[list[tuple[np.ndarray, object]]] = [[] for _ in range(COUNT)]
        self.ways: list[list[np.ndarray]] = [[] for _ in range(COUNT)]

    def integrate(self, scan):
        for k in range(COUNT):
            self.seen[k].append((self.poses[k].copy(), scan))
            self.ways[k].append(self.poses[k].copy())

    def choose(self, chosen):
        self.poses = self.poses[chosen]
        self.seen = [list(self.seen[k]) for k in chosen]
        self.ways = [list(self.ways[k]) for k in chosen]

    def grid(self, k):
        grid = LogOddsGrid(CONFIG)
        for pose, scan in self.seen[k]:
            grid.integrate(pose, scan)
        return grid.log_odds()


def same_ground(one, other):
    """Two grids hold the same, however much unknown ground lies around."""
    known = []
    for cells, corner in (one, other):
        rows, columns = np.nonzero(cells)
        at = np.stack((columns, rows), axis=-1) + np.round(corner / CONFIG.cell)
        known.append((at, cells[rows, columns]))
    np.testing.assert_array_equal(known[0][0], known[1][0])
    np.testing.assert_array_equal(known[0][1], known[1][1])


def run(seed: int, steps: int = 6) -> tuple[Particles, Obvious, list[np.ndarray]]:
    """Move, look and draw anew by chance; what was chosen each time is found by the poses."""
    rng = np.random.default_rng(seed)
    ours, obvious, chosen = Particles(COUNT, CONFIG), Obvious(), []
    for step in range(steps):
        if step:
            ours.poses = ours.poses + rng.normal(size=(COUNT, 3)) * (0.3, 0.3, 0.1)
            obvious.poses = ours.poses.copy()
        scan = scan_from(np.array((0.1 * step, 0.0, 0.2 * step)))
        ours.integrate(scan)
        ours.remember()
        obvious.integrate(scan)
        if rng.random() < 0.6:
            weights = rng.dirichlet(np.full(COUNT, 0.5))
            before = ours.poses.copy()
            ours.resample(weights, rng)
            # Poses differ from each other but at first, when all are the same in all.
            same = (ours.poses[:, None] == before).all(axis=-1)
            chosen.append(np.argmax(same, axis=1))
            obvious.choose(chosen[-1])
    return ours, obvious, chosen


@pytest.mark.parametrize("seed", range(4))
def test_shared_maps_and_ways_are_as_if_each_had_its_own(seed):
    ours, obvious, _ = run(seed)
    for k in range(COUNT):
        same_ground(ours.grid(k).log_odds(), obvious.grid(k))
        np.testing.assert_array_equal(ours.trajectory(k), obvious.ways[k])


@pytest.mark.parametrize("seed", range(4))
def test_each_tile_knows_how_many_maps_have_it(seed):
    ours, _, _ = run(seed)
    uses = ours.pool.arrays.uses
    used = ours.index[ours.index != NONE]
    np.testing.assert_array_equal(uses, np.bincount(used, minlength=len(uses)))
    free = ours.pool.arrays.free[: ours.pool.arrays.free_count[0]]
    np.testing.assert_array_equal(np.sort(free), np.flatnonzero(uses == 0))


def test_the_first_map_is_shared_by_all():
    ours = Particles(30, CONFIG)
    ours.integrate(scan_from(np.zeros(3)))
    assert ours.pool.used == len(np.unique(ours.index[0])) - 1
    assert (ours.index == ours.index[0]).all()


@given(st.integers(0, 1000), st.lists(st.floats(0.0, 1.0), min_size=8, max_size=8))
@settings(max_examples=50)
def test_each_is_drawn_as_often_as_its_weight_says(seed, shares):
    """By systematic resampling that is to the whole number below or above."""
    weights = (np.array(shares) + 1e-3) / (np.array(shares) + 1e-3).sum()
    ours = Particles(8, CONFIG)
    ours.poses[:, 0] = np.arange(8)
    ours.resample(weights, np.random.default_rng(seed))
    drawn = np.bincount(ours.poses[:, 0].astype(int), minlength=8)
    assert (drawn >= np.floor(8 * weights - 1e-9)).all()
    assert (drawn <= np.ceil(8 * weights + 1e-9)).all()


def test_after_a_resampling_all_weigh_the_same():
    particles = Particles(COUNT, CONFIG)
    particles.log_weights[:] = np.log(np.arange(1.0, COUNT + 1))
    particles.resample(particles.weights(), np.random.default_rng(0))
    np.testing.assert_array_equal(particles.weights(), 1.0 / COUNT)


def test_weights_sum_to_one_however_small_they_are():
    ours = Particles(3, CONFIG)
    ours.log_weights = np.array((-5000.0, -5000.0 + np.log(3.0), -9000.0))
    np.testing.assert_allclose(ours.weights(), (0.25, 0.75, 0.0), atol=1e-12)
    np.testing.assert_allclose(ours.weights(0.0), np.full(3, 1 / 3))
    assert ours.best == 1


def test_restored_particles_share_the_same_tiles():
    ours, obvious, _ = run(1)
    state, twin = ours.state(), Particles(COUNT, CONFIG)
    twin.restore(state)
    assert twin.pool.used == ours.pool.used
    for key, array in twin.state().items():
        np.testing.assert_array_equal(array, state[key], err_msg=key)
    rng, scan = np.random.default_rng(0), scan_from(np.zeros(3))
    twin.resample(np.full(COUNT, 1 / COUNT), rng)
    twin.integrate(scan)
    obvious.integrate(scan)
    for k in range(COUNT):
        same_ground(twin.grid(k).log_odds(), obvious.grid(k))


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("particles.parents", lambda a: a + COUNT, "to less than 5"),
        ("particles.index", lambda a: np.where(a == 0, 1, a), "each of"),
        ("particles.tiles", lambda a: a + 100, "numbers from"),
        ("particles.poses", lambda a: a * np.nan, "finite numbers"),
        ("particles.corner", lambda a: a + (1 << 40), "whole numbers from"),
        ("particles.log_weights", lambda a: a[:-1], "shape"),
    ],
)
def test_arrays_that_no_particles_have_are_refused(key, change, message):
    ours, _, _ = run(1)
    state = ours.state()
    state[key] = change(state[key])
    with pytest.raises(InputError, match=f"{key}.*{message}|{message}"):
        Particles(COUNT, CONFIG).restore(state)


def test_ground_beyond_all_buildings_is_refused_before_it_is_made():
    ours = Particles(COUNT, CONFIG)
    ours.integrate(scan_from(np.zeros(3)))
    ours.remember()
    ours.poses[2, 0] = 1e5
    with pytest.raises(InputError, match="ground that fits"):
        ours.integrate(scan_from(np.zeros(3)))
