"""Association-2: the robot wanders in short moves; doubled and crossing surfaces are counted."""

from __future__ import annotations

import numpy as np
import pytest

from albot_experiments import association_2 as experiment
from albot_experiments.association_1 import count_crossings, doubled_share
from albot_maps import load_world

WALL = (0.0, 0.0, 4.0, 0.0)


@pytest.mark.parametrize(
    ("other", "share"),
    [
        ((1, 0.2, 5, 0.2), 1.0),
        ((1, 0.6, 5, 0.6), 0.0),  # Too far.
        ((5, 0.2, 1, 0.2), 0.0),  # The other face of the wall.
        ((3.5, 0.2, 8, 0.2), 0.0),  # Beside a small part of it alone.
        ((1, 0.0, 3, 0.8), 0.0),  # Turned by 22°.
    ],
)
def test_a_surface_beside_another_of_its_direction_doubles_it(other, share):
    assert doubled_share(np.array((WALL, other), float)) == share


def test_surfaces_that_cross_are_counted_but_for_corners():
    across, corner = (2.0, -1, 2, 1), (4.0, -0.1, 4.0, 2)
    assert count_crossings(np.array((WALL, across))) == 1
    assert count_crossings(np.array((WALL, corner))) == 0
    assert count_crossings(np.empty((0, 4))) == doubled_share(np.empty((0, 4))) == 0.0


def test_views_are_a_short_move_apart():
    journey = experiment.wander(load_world("office-ring"), 1, length=12.0)
    motions = np.array([reading.motion for reading in journey.readings])
    assert np.hypot(*motions[:, :2].T).sum() > 10.0
    assert np.hypot(*motions[:, :2].T).max() < 3.3
    assert np.degrees(np.abs(motions[:, 2])).max() < 66.0  # A turn, and a swerve by as much.
    again = experiment.wander(load_world("office-ring"), 1, length=12.0)
    np.testing.assert_array_equal(again.truth, journey.truth)
