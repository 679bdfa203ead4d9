"""The explorer of landmark association: which gaps bound its space, and how far it moves."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.planning.gap_explorer import Gap
from albot_core.planning.minimal_space_explorer import (
    MinimalSpaceConfig,
    MinimalSpaceExplorer,
    minimal_space,
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


HOUSE = np.array([*OUTSIDE, *doorway(2.0, 1.0)], float)


def drive(seed: int, steps: int = 400) -> np.ndarray:
    """The poses of an ideal robot that does as it is told, in the house of two rooms."""
    explorer = MinimalSpaceExplorer()
    explorer.reset(np.random.default_rng(seed))
    poses = [np.array((-1.013, -1.027, 0.5))]
    motion = np.zeros(3)
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
    return np.array(poses)


@pytest.fixture(scope="module")
def driven() -> np.ndarray:
    return drive(0)


def test_it_goes_through_the_doorway(driven):
    assert driven[0, 0] < 2.0 < driven[:, 0].max()


def test_it_touches_nothing(driven):
    ends = HOUSE.reshape(-1, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    to = driven[:, None, :2] - ends[:, 0]
    share = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0, 1)
    assert np.hypot(*np.moveaxis(to - share[..., None] * along, -1, 0)).min() > 0.2


def test_it_drives_3_m_at_a_time_at_most(driven):
    steps = np.diff(driven, axis=0)
    way, turns = np.hypot(*steps[:, :2].T), np.abs(steps[:, 2])
    on_the_spot = (way < 0.005) & (turns > 1e-6)
    runs = np.split(np.arange(len(steps)), np.flatnonzero(np.diff(on_the_spot.astype(int))) + 1)
    driving = [way[run].sum() for run in runs if not on_the_spot[run[0]]]
    assert max(driving) < 3.0 + 0.5


def test_it_is_the_same_with_the_same_seed(driven):
    np.testing.assert_array_equal(drive(0, 60), driven[:61])
    assert not np.array_equal(drive(1, 300), driven[:301])


@pytest.mark.parametrize("name", ["gap_width", "turn", "drive", "nearest"])
def test_thresholds_are_checked(name):
    with pytest.raises(InputError, match=rf"MinimalSpaceConfig\.{name}"):
        MinimalSpaceConfig(**{name: -1.0})
