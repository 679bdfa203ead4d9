"""DP-SLAM 2.0's model of the laser: in closed form, and by a slow walk along the beam."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.kernels.compiled import kernel
from albot_core.mappers.slam.ancestry import make_particle_maps, order_nodes
from albot_core.mappers.slam.distributed_map import DistributedMap
from albot_core.mappers.slam.dp_slam_config import DpSlamConfig
from albot_core.mappers.slam.opacity import SLIVER, Beams, beam_likelihood
from albot_core.mappers.slam.scan_entry import enter_scan
from albot_core.mappers.slam.tiles import TILE

CONFIG = DpSlamConfig(cell=0.1, reach=5.0, prior_squares=2.0)
MODEL = CONFIG.laser_model


class OneMap:
    """The map of a single particle."""

    def __init__(self) -> None:
        self.map = DistributedMap(2, CONFIG.cell)
        self.map.reserve_tiles(np.array((-3, -3)), np.array((4, 4)))
        self.maps = make_particle_maps(20_000, 2)
        self.maps.nodes[0] = 0

    def enter(self, x: float, y: float, heading: float, length: float, *, stopped: bool) -> None:
        beams = Beams(
            directions=np.array(((1.0, 0.0),)),
            lengths=np.array((length,)),
            stopped=np.array((stopped,)),
            eye=np.zeros(2),
        )
        self.maps.rows[0] = 1
        self.map.arrays.slot[:] = 0
        nodes, lacking = order_nodes(self.map.tree), np.zeros(2, np.int64)
        seen, touched = np.zeros((20_000, 2)), np.empty(20_000, np.int32)
        pose = np.array((x, y, heading))
        while not enter_scan(
            self.map.arrays, self.map.tree, self.maps, nodes, 0, 0, pose, beams, MODEL,
            seen, touched, lacking,
        ):  # fmt: skip
            self.map.reserve_observations(*lacking.tolist())
        assert not seen.any()

    def likelihood(self, x, y, heading, measured, *, stopped=True, begin=0.0, end=None) -> float:
        self.maps.rows[0] = 1
        self.map.arrays.slot[:] = 0
        ray = (x, y, math.cos(heading), math.sin(heading))
        end = min(measured + MODEL.beyond, MODEL.reach) if end is None else end
        return _likelihood(
            self.map.arrays, self.map.tree, self.maps, 1, ray, (begin, end), measured, stopped,
            MODEL,
        )  # fmt: skip

    def squares(self) -> dict[tuple[int, int], tuple[float, float]]:
        """Beams stopped and distance by column and row."""
        beams, corner = self.map.known_by(0)
        known = np.argwhere(beams[:, :, 1] > 0)
        return {(c + corner[1], r + corner[0]): tuple(beams[r, c]) for r, c in known.tolist()}


@kernel()
def _likelihood(arrays, tree, maps, nodes, ray, section, measured, is_stopped, model):
    return beam_likelihood(
        arrays, tree, maps, nodes, 0, ray, section, measured, is_stopped, model
    )  # fmt: skip


def walked_likelihood(squares, ray, section, measured, *, stopped, model=MODEL) -> float:
    """The likelihood of a beam, by the paper's sum over the squares along it.

    P = Σ_i P(measured | stop in i) P(stop in i) Π_{j<i} (1 - P(stop in j)).
    """
    (x, y, heading), (begin, end) = ray, section
    ux, uy, cell = math.cos(heading), math.sin(heading), model.cell
    # All distances at which the beam crosses a line of the grid.
    cuts = {begin, end}
    for start, unit in ((x, ux), (y, uy)):
        if unit:
            low, high = sorted((start + begin * unit, start + end * unit))
            lines = np.arange(math.ceil(low / cell), math.floor(high / cell) + 1) * cell
            cuts |= {t for t in ((line - start) / unit for line in lines) if begin < t < end}
    passed, total = 1.0, 0.0
    ordered = sorted(cuts)
    for one, other in pairwise(ordered):
        if other - one <= SLIVER:
            continue
        middle = 0.5 * (one + other)
        key = math.floor((x + middle * ux) / cell), math.floor((y + middle * uy) / cell)
        hits, distance = squares.get(key, (None, None))
        opacity = model.prior if hits is None else math.inf if hits == 0 else distance / hits
        stop = 1 - math.exp(-(other - one) / opacity)
        if middle - measured > -model.beyond:
            total += passed * stop * math.exp(-((middle - measured) ** 2) / (2 * model.variance))
        passed *= 1 - stop
    return total + passed if not stopped else total / (1 - passed) if passed < 1 else 0.0


def test_a_beam_leaves_in_each_square_how_far_it_went_there_and_where_it_stopped():
    one = OneMap()
    one.enter(0.05, 0.05, 0.0, 0.3, stopped=True)
    prior = 2 * 0.1
    expected = {(0, 0): (0, 0.05), (1, 0): (0, 0.1), (2, 0): (0, 0.1), (3, 0): (1, 0.05)}
    found = one.squares()
    assert set(found) == set(expected)
    for square, (hits, distance) in expected.items():
        assert found[square] == pytest.approx((hits, prior + distance))
    # Once more: the prior counts once.
    one.enter(0.05, 0.05, 0.0, 0.3, stopped=True)
    assert one.squares()[3, 0] == pytest.approx((2, prior + 0.1))
    # Where nothing stopped it, it only went through.
    one.enter(0.05, 0.05, 0.0, 0.3, stopped=False)
    assert one.squares()[3, 0] == pytest.approx((2, prior + 0.15))


def test_the_distances_of_a_beam_sum_up_to_its_length():
    rng = np.random.default_rng(3)
    for _ in range(30):
        one = OneMap()
        length = rng.uniform(0.01, 5)
        one.enter(*rng.uniform(-1, 1, 2), rng.uniform(-4, 4), length, stopped=True)
        squares = np.array(list(one.squares().values()))
        assert squares[:, 0].sum() == 1
        assert (squares[:, 1] - 0.2).sum() == pytest.approx(length, abs=1e-4)


def test_the_likelihood_in_closed_form():
    one = OneMap()
    # Unknown ground before and behind: of a beam through n squares of 10 cm, each stops it with
    # q = 1 - exp(-0.1 / 8).
    q = 1 - math.exp(-0.1 / CONFIG.prior)
    stops = [q * (1 - q) ** k for k in range(2)]
    errors = [math.exp(-((0.1 * k + 0.05 - 0.1) ** 2) / (2 * CONFIG.variance)) for k in range(2)]
    expected = sum(a * b for a, b in zip(stops, errors, strict=True)) / sum(stops)
    assert one.likelihood(0, 0.05, 0, 0.1, end=0.2) == pytest.approx(expected, rel=1e-9)
    passed = (1 - q) ** 2
    expected = sum(a * b for a, b in zip(stops, errors, strict=True)) + passed
    found = one.likelihood(0, 0.05, 0, 0.1, end=0.2, stopped=False)
    assert found == pytest.approx(expected, rel=1e-9)
    # A wall after ground that is known to be empty: only where it stands can the beam stop.
    for _ in range(50):
        one.enter(0.05, 0.05, 0, 1.0, stopped=True)
    at = 1.0  # The middle of the wall's square, from the laser.
    for off in (0.0, 0.1, -0.3):
        expected = math.exp(-(off**2) / (2 * CONFIG.variance))
        found = one.likelihood(0.05, 0.05, 0, at + off, end=1.05)
        assert found == pytest.approx(expected, rel=1e-6)
    # Nothing is there: no place to stop at all.
    assert one.likelihood(0.05, 0.05, 0, 0.5, end=0.9) == 0.0
    assert one.likelihood(0.05, 0.05, 0, 0.9, end=0.9, stopped=False) == 1.0


ANGLE, PLACE = st.floats(-3.2, 3.2), st.floats(-0.5, 0.5)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(PLACE, PLACE, ANGLE, st.floats(0.01, 3), st.booleans()), max_size=6),
    st.tuples(PLACE, PLACE, ANGLE),
    st.floats(0.0, 4.0),
    st.booleans(),
    st.floats(0.0, 1.0),
)
def test_the_likelihood_is_that_of_a_slow_walk_along_the_beam(
    entered, ray, measured, stopped, near
):
    one = OneMap()
    for x, y, heading, length, hit in entered:
        one.enter(x, y, heading, length, stopped=hit)
    section = near * measured, min(measured + MODEL.beyond, MODEL.reach)
    found = one.likelihood(*ray, measured, stopped=stopped, begin=section[0])
    expected = walked_likelihood(one.squares(), ray, section, measured, stopped=stopped)
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-9)
    assert 0 <= found <= 1 + 1e-9


def test_tiles_are_made_where_beams_go():
    one = OneMap()
    one.enter(0.05, 0.05, 0.0, 0.3, stopped=True)
    assert (one.map.arrays.tiles >= 0).sum() == 1
    one.enter(0.05, 0.05, 0.0, 0.1 * TILE, stopped=True)
    assert (one.map.arrays.tiles >= 0).sum() == 2
