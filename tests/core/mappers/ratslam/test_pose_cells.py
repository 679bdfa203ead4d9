"""The pose cells against a plain dense network, and laws of path integration."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.ratslam import pose_cells
from albot_core.mappers.ratslam.config import PoseCellConfig
from albot_core.mappers.ratslam.layers import network_activity
from albot_core.mappers.ratslam.motions import after, nearest_turn
from albot_core.mappers.ratslam.pose_cells import REACH, Packet, PoseCells

SMALL = PoseCellConfig(columns=20, rows=24, headings=18)
NOTHING = np.zeros((0, 3)), np.zeros(0)


def dense(cells: PoseCells) -> np.ndarray:
    """The activity of all cells, (headings, rows, columns)."""
    columns, rows, headings = cells.shape
    activity = np.zeros(headings * rows * columns)
    activity[cells.cells] = cells.activity
    return activity.reshape(headings, rows, columns)


def spread(activity: np.ndarray, width: float) -> np.ndarray:
    away = np.arange(-REACH, REACH + 1)
    weights = np.exp(-0.5 * (away / width) ** 2)
    for axis in range(3):
        shifted = [w * np.roll(activity, d, axis) for d, w in zip(away, weights, strict=True)]
        activity = sum(shifted) / weights.sum()
    return activity


def shifted(activity: np.ndarray, amounts: tuple[float, float, float]) -> np.ndarray:
    """Shifted along x, y and θ, by linear interpolation."""
    for axis, amount in zip((2, 1, 0), amounts, strict=True):
        whole = int(np.floor(amount))
        part = amount - whole
        activity = (1 - part) * np.roll(activity, whole, axis) + part * np.roll(
            activity, whole + 1, axis
        )
    return activity


def at(activity: np.ndarray, place: np.ndarray) -> np.ndarray:
    """A network with this activity at a position x', y', θ' and none elsewhere."""
    one = np.zeros_like(activity)
    one[0, 0, 0] = 1.0
    return shifted(one, tuple(place.tolist()))


def part(places: np.ndarray) -> np.ndarray:
    return places - np.floor(places + 0.5)


def iterated(
    activity: np.ndarray, lattice: np.ndarray, centre: np.ndarray, motion: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """One iteration of the whole network, cell by cell as it is defined, and the lattice."""
    config = SMALL
    excited = spread(activity, config.excitation)
    left = np.maximum(excited - spread(excited, config.inhibition), 0)
    left = left / left.sum() - config.global_inhibition
    left[left <= 1e-9] = 0
    left /= left.sum()
    angles = (np.arange(config.headings) + lattice[2]) * config.cell_turn
    away = np.angle(np.exp(1j * (angles - centre[2] * config.cell_turn)))
    of_packet = left.sum(axis=(1, 2)) * (np.abs(away) <= 3.5 * config.cell_turn)
    way = np.array(motion[:2]) * of_packet.sum() / (of_packet @ np.cos(away)) / config.cell
    turn = motion[2] / config.cell_turn

    def step(angle: float) -> np.ndarray:
        cos, sin = np.cos(angle), np.sin(angle)
        return np.array((cos * way[0] - sin * way[1], sin * way[0] + cos * way[1], turn))

    after = part(centre + step(centre[2] * config.cell_turn))
    moved = np.zeros_like(left)
    for layer, angle in enumerate(angles):
        one = np.zeros_like(left)
        one[layer] = left[layer]
        moved += shifted(one, tuple((step(angle) - (after - lattice)).tolist()))
    return moved, after


def test_it_does_what_a_dense_network_does():
    rng = np.random.default_rng(0)
    cells = PoseCells(SMALL)
    activity = dense(cells)
    for _ in range(40):
        motion = rng.normal(0, (0.3, 0.1, 0.4))
        injected = rng.uniform(0, cells.shape, (3, 3))
        amounts = rng.uniform(0, 0.3, 3)
        lattice = np.array(cells.lattice)
        for place, amount in zip(injected, amounts, strict=True):
            activity = activity + amount * at(activity, place - lattice)
        activity, lattice = iterated(activity, lattice, np.array(cells.packet[:3]), motion)
        assert cells.iterate(tuple(motion.tolist()), injected, amounts)
        np.testing.assert_allclose(dense(cells), activity, atol=1e-7)
        np.testing.assert_allclose(part(cells.lattice - lattice), 0, atol=1e-9)
        assert cells.activity.sum() == pytest.approx(1.0)


def test_activity_settles_in_one_packet():
    cells = PoseCells(PoseCellConfig())
    for _ in range(100):
        cells.iterate((0.0, 0.0, 0.0), *NOTHING)
    assert len(cells.cells) < 500
    assert cells.packet.share == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(cells.offset(64, 64, 0), 0, atol=1e-9)


def test_the_next_packet_is_what_is_active_elsewhere():
    """Two packets across the edges of the network, and a cell at the rim of each one's window."""
    cells = PoseCells(SMALL)
    columns, rows, headings = cells.shape

    def cell(x: int, y: int, heading: int) -> int:
        return (heading % headings * rows + y % rows) * columns + x % columns

    assert cells.shares() == (1.0, 0.0)
    places = [(0, 0, 0), (-3, 3, -3), (10, -1, 0), (10, 2, 3), (10, -5, 0)]
    cells.cells = np.array([cell(*place) for place in places])
    cells.activity = np.array((0.4, 0.2, 0.25, 0.1, 0.05))
    assert cells.shares() == pytest.approx((0.6, 0.35))


def turned(degrees: float, config: PoseCellConfig) -> PoseCells:
    """A network that was turned from heading 0 in steps that cells do not divide."""
    cells = PoseCells(config)
    for _ in range(8):
        cells.iterate((0.0, 0.0, np.radians(degrees) / 8), *NOTHING)
    return cells


@pytest.mark.parametrize("step", [0.1, 0.25])
@pytest.mark.parametrize("degrees", range(0, 50, 5))
def test_path_integration_is_the_same_in_all_directions(degrees, step):
    """Over 8 m the heading is right within 0.5°, and the way within half a percent."""
    cells = turned(degrees, PoseCellConfig())
    start = cells.packet
    assert start.heading == pytest.approx(degrees / 10, abs=1e-9)
    for _ in range(round(8 / step)):
        cells.iterate((step, 0.0, 0.0), *NOTHING)
    x, y, _ = cells.offset(start.x, start.y, 0.0)
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(degrees, abs=0.5)
    assert np.hypot(x, y) == pytest.approx(8.0, rel=0.005)
    assert nearest_turn(cells.offset(0, 0, start.heading)[2]) == pytest.approx(0.0, abs=0.012)


@pytest.mark.parametrize("seed", range(4))
def test_path_integration_of_a_winding_way(seed):
    """10 m with random turns, against the same motions one after another."""
    rng = np.random.default_rng(seed)
    cells, pose = PoseCells(PoseCellConfig()), (0.0, 0.0, 0.0)
    turns = np.cumsum(rng.normal(0, 0.05, 100))
    for turn in turns.tolist():
        cells.iterate((0.1, 0.0, turn), *NOTHING)
        pose = after(pose, (0.1, 0.0, turn))
    off = cells.offset(64, 64, 0) - pose
    assert np.hypot(*off[:2]) < 0.15
    assert abs(nearest_turn(off[2])) < np.radians(2)


def test_small_injections_move_the_packet_by_fractions_of_a_cell():
    """A packet that a view draws a third of a cell aside stays there."""
    cells = PoseCells(PoseCellConfig())
    for _ in range(20):
        cells.iterate((0.0, 0.0, 0.0), *NOTHING)
    there = np.array(((64.3, 63.8, 0.2),))
    for _ in range(60):
        cells.iterate((0.0, 0.0, 0.0), there, np.array((0.1,)))
    for _ in range(60):
        cells.iterate((0.0, 0.0, 0.0), *NOTHING)
    np.testing.assert_allclose(cells.packet[:3], there[0], atol=0.05)


def test_cells_that_are_read_out_lie_round_the_packet():
    """Sharing among the fixed cells keeps the mean; few of them are the most active."""
    cells = turned(63.0, PoseCellConfig())
    cells.iterate((0.37, 0.21, 0.0), *NOTHING)
    assert max(map(abs, cells.lattice)) > 0.2
    found, activity = cells.top(0.0, (0.0, 0.0, 0.0))
    columns, rows, _ = cells.shape
    places = np.stack((found % columns, found // columns % rows, found // (columns * rows)))
    np.testing.assert_allclose(places @ activity, cells.packet[:3], atol=1e-4)
    assert activity.sum() == pytest.approx(1.0)
    most, strongest = cells.top(0.5, (0.0, 0.0, 0.0))
    assert len(most) < len(found) / 4
    assert strongest.min() >= 0.5 * activity.max()
    moved, _ = cells.top(0.0, (0.25 * columns, 0.0, 0.0))  # Once round.
    assert moved.size


def test_a_restored_network_goes_on_to_the_bit():
    rng = np.random.default_rng(1)
    cells, other = PoseCells(SMALL), PoseCells(SMALL)
    for k in range(30):
        if k == 15:
            other.restore(cells.state())
        inputs = (
            tuple(rng.normal(0, (0.3, 0.1, 0.4)).tolist()),
            rng.uniform(0, cells.shape, (2, 3)),
            rng.uniform(0, 0.2, 2),
        )
        cells.iterate(*inputs)
        if k >= 15:
            other.iterate(*inputs)
    for name, array in cells.state().items():
        np.testing.assert_array_equal(array, other.state()[name])


def test_the_network_wraps_round():
    """A packet that goes once round is where it was, and its centre is found across the edge."""
    cells = PoseCells(SMALL)
    seen = []
    for _ in range(2 * SMALL.columns):
        cells.iterate((0.5 * SMALL.cell, 0.0, 0.0), *NOTHING)
        seen.append(cells.packet.x)
    moves = np.diff(seen) % SMALL.columns
    assert moves.min() > 0.2
    assert moves.max() < 0.8
    assert all(0 <= x < SMALL.columns for x in seen)
    assert max(seen) > SMALL.columns - 1


def test_a_shift_by_whole_cells_moves_the_same_activity():
    cells, twin = PoseCells(SMALL), PoseCells(SMALL)
    for _ in range(5):
        cells.iterate((0.0, 0.0, 0.0), *NOTHING)
        twin.iterate((0.0, 0.0, 0.0), *NOTHING)
    cells.iterate((0.0, 0.0, 0.0), *NOTHING)
    twin.iterate((0.0, 0.0, 7 * SMALL.cell_turn), *NOTHING)
    np.testing.assert_allclose(np.roll(dense(cells), 7, 0), dense(twin), atol=1e-12)


def inject(cells: PoseCells, times: int, amount: float) -> None:
    for _ in range(times):
        far = np.array(((6.0, 5.0, 3.0),))
        cells.iterate((0.0, 0.0, 0.0), far, np.array((amount,)))


def test_little_activity_far_away_dies_and_much_wins():
    weak, strong = PoseCells(SMALL), PoseCells(SMALL)
    inject(weak, 1, 0.2)
    inject(strong, 30, 0.2)
    for cells in (weak, strong):
        for _ in range(200):
            cells.iterate((0.0, 0.0, 0.0), *NOTHING)
        assert cells.packet.share > 0.99
    np.testing.assert_allclose(weak.offset(10, 12, 0), 0, atol=0.02)
    np.testing.assert_allclose(strong.offset(6, 5, 3), 0, atol=0.02)


def test_a_network_that_loses_all_activity_is_seeded_where_it_was():
    cells = PoseCells(PoseCellConfig(columns=20, rows=20, global_inhibition=0.9))
    assert not cells.iterate((0.1, 0.0, 0.0), *NOTHING)
    assert cells.packet[:3] == (10, 10, 0)
    np.testing.assert_array_equal(cells.activity, [1.0])
    assert dense(cells)[0, 10, 10] == 1.0


@pytest.mark.parametrize("amount", [5e-324, 1e-322, 1.0])
def test_cells_are_listed_once_though_products_underflow(amount):
    """Without end the lists would be longer than there are cells, and memory be overwritten."""
    source, target = np.zeros((2, 32))
    source[[3, 4, 5]] = amount
    cells, reached = np.array([3, 4, 5]), np.zeros(32, np.int64)
    weights = np.array([0.1, 0.2, 0.4, 0.2, 0.1])
    found = pose_cells._spread(source, target, cells, reached, 3, weights, 1, 32)
    assert found == np.count_nonzero(target)
    assert set(reached[:found]) == set(np.flatnonzero(target))


@pytest.mark.parametrize("far", [1e3, 1e9, 1e200])
def test_motion_faster_than_the_network_is_wide_wraps(far):
    cells = PoseCells(SMALL)
    assert cells.iterate((far, -far, far), *NOTHING)
    assert np.isfinite(cells.activity).all()
    assert cells.activity.sum() == pytest.approx(1.0)
    assert np.isfinite(cells.packet).all()


@pytest.mark.parametrize(
    ("field", "value"), [("columns", 4), ("cell", 0.0), ("global_inhibition", -1.0), ("step", -1.0)]
)
def test_a_network_that_cannot_be_is_refused(field, value):
    with pytest.raises(InputError, match=f"PoseCellConfig.{field}"):
        PoseCellConfig(**{field: value})
    with pytest.raises(InputError, match="more than excitation"):
        PoseCellConfig(excitation=2.0, inhibition=2.0)


def test_cells_are_moved_in_their_own_direction():
    cells = PoseCells(SMALL)
    columns, rows, headings = cells.shape
    east = (0 * rows + 5) * columns + 18
    north = (headings // 2 // 2 * rows + 23) * columns + 3  # Of 18 headings the fourth is 80°.
    moved = cells.moved(np.array((east, north)), (1.0, 0.0, np.pi))
    np.testing.assert_allclose(moved[0], (22, 5, 9))
    cos, sin = np.cos(np.radians(80)), np.sin(np.radians(80))
    np.testing.assert_allclose(moved[1], (3 + 4 * cos, 23 + 4 * sin, 13))


def test_others_see_the_most_active_cell_at_each_place():
    network = PoseCells(PoseCellConfig(columns=16, rows=20, headings=36))
    network.seed(Packet(15.0, 3.0, 27.0, 1.0))
    first = network_activity(network)
    assert first.values.shape == (20, 16)
    assert first.values[3, 15] == 1.0
    assert first.values.sum() == 1.0
    # The middle of the cell, in metres; the heading is 27 cells of 10°.
    assert first.packet == pytest.approx((15.5 * 0.25, 3.5 * 0.25, np.radians(-90)))
    network.iterate((0.0, 0.0, 0.0), *NOTHING)
    values = network_activity(network).values
    assert np.array_equal(values, dense(network).max(axis=0).astype(np.float32))
    other = PoseCells(network.config)
    other._set_state(network.state())
    assert np.array_equal(network_activity(other).values, values)
