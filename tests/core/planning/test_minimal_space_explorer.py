"""The explorer of landmark association: which gaps bound its space, and how far it moves."""

from __future__ import annotations

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.planning.gap_explorer import Gap
from albot_core.planning.minimal_space_explorer import (
    MinimalSpaceConfig,
    MinimalSpaceExplorer,
    gaps_between,
    minimal_space,
    space_outline,
)
from albot_core.planning.percept import Percept
from tests.core.scenes import OUTSIDE, doorway, scan_from


def gap(x: float, y: float, outward: float, width: float = 1.0) -> Gap:
    """A gap with its middle at (x, y), across which the way leads in a direction (rad)."""
    along = np.array((np.cos(outward), np.sin(outward)))
    return Gap(centre=np.array((x, y), float), outward=along, width=width)


def test_gaps_behind_a_gap_are_covered_by_it():
    door, behind, aside = gap(3, 0, 0), gap(7, 0.5, 0), gap(2, 4, np.pi / 2)
    assert minimal_space([behind, door, aside]) == [door, aside]


def test_gaps_beside_each_other_cover_nothing():
    gaps = [gap(3, -2, 0), gap(3, 0, 0), gap(3, 2, 0)]
    assert minimal_space(gaps) == gaps


def test_the_way_past_the_end_of_a_gap_does_not_cross_it():
    near, far = gap(3, 0, 0, width=1.0), gap(6, 1.4, 0)
    assert minimal_space([near, far]) == [near, far]
    assert minimal_space([gap(3, 0, 0, width=1.5), far])[1:] == []


def test_the_minimal_bounded_space_ends_at_its_gaps_and_at_the_walls():
    # A wall at x = 5 is seen through a gap at x = 3, 1 m wide; beside it the wall is nearer.
    points = np.array([(2.9, -2.0), (5.0, -0.5), (5.0, 0.0), (5.0, 0.8), (5.0, 0.9), (-4.0, 0.0)])
    expected = points.copy()
    expected[1:4] *= 3.0 / 5.0
    np.testing.assert_allclose(space_outline(points, [gap(3, 0, 0)]), expected, atol=1e-12)


def test_without_gaps_the_minimal_bounded_space_is_all_that_is_seen():
    points = np.array([(2.0, -1.0), (3.0, 0.0), (2.0, 1.0)])
    np.testing.assert_array_equal(space_outline(points, []), points)


def test_of_two_gaps_on_a_beam_the_nearer_one_bounds_the_space():
    points = np.array([(8.0, 0.0), (0.0, 1.0)])
    for gaps in ([gap(3, 0, 0), gap(6, 0, 0)], [gap(6, 0, 0), gap(3, 0, 0)]):
        np.testing.assert_allclose(space_outline(points, gaps), [(3.0, 0.0), (0.0, 1.0)])


def test_a_gap_in_which_the_robot_stands_bounds_the_space_without_nan():
    points = np.array([(4.0, 0.0), (-2.0, 0.0), (0.0, 3.0)])
    outline = space_outline(points, [gap(0, 0, 0)])
    np.testing.assert_array_equal(outline, [(0.0, 0.0), (-2.0, 0.0), (0.0, 3.0)])


def test_a_gap_lies_between_two_adjacent_surfaces():
    """Two walls at x = 3, and between them 1.2 m of nothing."""
    walls = np.array([(3.0, -2.0, 3.0, -0.4), (3.0, 0.8, 3.0, 2.0)])
    nothing = np.empty((0, 2))
    (found,) = gaps_between(walls, nothing, 0.6, 0.25)
    np.testing.assert_allclose(found.centre, (3.0, 0.2))
    np.testing.assert_allclose(found.outward, (1.0, 0.0), atol=1e-12)
    assert found.width == pytest.approx(1.2)
    assert gaps_between(walls, nothing, 1.3, 0.25) == []
    assert gaps_between(walls[:1], nothing, 0.6, 0.25) == []


def test_things_too_small_for_a_surface_stand_in_a_gap():
    walls = np.array([(3.0, -2.0, 3.0, -0.4), (3.0, 0.8, 3.0, 2.0)])
    (beside,) = gaps_between(walls, np.array([(3.1, 0.0), (3.5, 0.5), (1.0, 0.6)]), 0.6, 0.25)
    np.testing.assert_allclose((*beside.centre, beside.width), (3.0, 0.4, 0.8))
    assert gaps_between(walls, np.array([(3.1, 0.2)]), 0.65, 0.25) == []


def test_by_the_paper_what_is_seen_through_a_door_parts_its_gap_in_two():
    """The surface behind lies between the two of the wall; ours is one gap in the doorway."""
    scan = scan_from(np.zeros(3), HOUSE)
    ranges = np.minimum(scan.ranges, 30.0)
    percept = Percept(ranges=ranges, laser=scan.geometry, pose=np.zeros(3), motion=np.zeros(3))
    by_surfaces = MinimalSpaceExplorer(MinimalSpaceConfig(gaps="surfaces")).gaps_in_view(percept)
    by_ranges = MinimalSpaceExplorer().gaps_in_view(percept)
    assert max(gap.centre[0] for gap in by_surfaces) > 2.5
    assert min(abs(gap.centre[0] - 2.0) for gap in by_ranges) < 0.1


HOUSE = np.array([*OUTSIDE, *doorway(2.0, 1.0)], float)


def drive(
    seed: int, steps: int = 400, config: MinimalSpaceConfig | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The poses of an ideal robot that does as it is told, in the house of two rooms.

    Beside them the number of the move of which each step is a part.
    """
    explorer = MinimalSpaceExplorer(config or MinimalSpaceConfig())
    explorer.reset(np.random.default_rng(seed))
    poses = [np.array((-1.013, -1.027, 0.5))]
    motion, moves = np.zeros(3), []
    for _ in range(steps):
        scan = scan_from(poses[-1], HOUSE)
        percept = Percept(
            ranges=np.minimum(scan.ranges, 30.0),
            laser=scan.geometry,
            pose=relative(poses[0], poses[-1]),
            motion=motion,
        )
        speed, rate = explorer.command(percept)
        motion = np.array((0.1 * speed, 0.0, 0.1 * rate))
        poses.append(compose(poses[-1], motion))
        moves.append(explorer.moves)
    return np.array(poses), np.array(moves)


@pytest.fixture(scope="module")
def driven_moves() -> tuple[np.ndarray, np.ndarray]:
    return drive(0)


@pytest.fixture(scope="module")
def driven(driven_moves) -> np.ndarray:
    return driven_moves[0]


def test_it_goes_through_the_doorway(driven):
    assert driven[0, 0] < 2.0 < driven[:, 0].max()


def test_it_touches_nothing(driven):
    ends = HOUSE.reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    to = driven[:, None, :2] - ends[:, 0]
    share = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0, 1)
    assert np.hypot(*np.moveaxis(to - share[..., None] * along, -1, 0)).min() > 0.2


def test_a_move_is_3_m_or_30_degrees_at_most(driven_moves):
    poses, moves = driven_moves
    way = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    turns = np.diff(np.unwrap(poses[:, 2]))
    ways = [way[moves == move].sum() for move in np.unique(moves)]
    turned = [abs(turns[moves == move].sum()) for move in np.unique(moves)]
    assert 2.5 < max(ways) < 3.0 + 0.1  # It may go on for one step.
    assert np.radians(25.0) < max(turned) < np.radians(30.0 + 2.0 + 6.0)


def test_a_straight_move_ends_after_its_longest_drive():
    poses, moves = drive(0, 120, MinimalSpaceConfig(drive=1.0))
    way = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert 0.9 < max(way[moves == move].sum() for move in np.unique(moves)) < 1.1


def test_the_longest_drive_turn_and_gap_are_those_of_the_paper():
    config = MinimalSpaceConfig()
    assert (config.drive, config.turn, config.gap_width) == (3.0, np.radians(30.0), 0.6)


def test_it_is_the_same_with_the_same_seed(driven):
    np.testing.assert_array_equal(drive(0, 60)[0], driven[:61])
    assert not np.array_equal(drive(1, 300)[0], driven[:301])


@pytest.mark.parametrize("name", ["gap_width", "turn", "drive", "nearest"])
def test_thresholds_are_checked(name):
    with pytest.raises(InputError, match=rf"MinimalSpaceConfig\.{name}"):
        MinimalSpaceConfig(**{name: -1.0})


def test_what_gaps_lie_between_is_checked():
    wrong = {"gaps": "doors"}
    with pytest.raises((InputError, TypeCheckError), match="gaps"):
        MinimalSpaceConfig(**wrong)
