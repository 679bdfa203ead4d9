"""Views that contradict each other, counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.consistency import (
    inconsistency,
    inconsistent_views,
)
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView, empty_view
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    FIRST_SHIFT_ERROR,
    HAS_MOVED,
    SHIFT,
    unknown_odometer,
)

LIMITS = Albot1Config.thesis().limits
AHEAD = (4.0, -3.0, 4.0, 3.0)
"""A wall of 6 m, 4 m ahead (m)."""


def view_of(*walls: tuple[float, ...], pose: tuple[float, ...] = (0.0, 0.0, 0.0)) -> LocatedView:
    view = empty_view(8)
    view.surfaces[: len(walls)] = np.reshape(walls, (-1, 4))
    view.size[0] = len(walls)
    view.pose[:] = pose
    return view


def test_a_view_agrees_with_itself():
    assert inconsistency(view_of(AHEAD), view_of(AHEAD), LIMITS) == 0.0


def test_one_wall_seen_from_two_places_is_one():
    # A metre on and a quarter turned, the wall is 3 m away and to the right.
    nearer = view_of((3.0, 3.0, -3.0, 3.0), pose=(1.0, 0.0, -np.pi / 2))
    assert inconsistency(view_of(AHEAD), nearer, LIMITS) == 0.0


def test_a_wall_that_is_seen_past_is_contradicted():
    # Each point of the nearer wall is seen past; the farther one is hidden behind it.
    assert inconsistency(view_of((2.0, -2.0, 2.0, 2.0)), view_of(AHEAD), LIMITS) == 1.0


def test_the_share_is_that_of_points():
    # 6 m of 24 points agree in either view; 1.5 m of 6 points are seen past by the other.
    both = view_of(AHEAD), view_of((2.0, -1.5, 2.0, 0.0), AHEAD)
    hidden = 12  # points of the wall ahead that the second view has hidden
    assert inconsistency(*both, LIMITS) == pytest.approx(6 / (6 + 48 - hidden), abs=0.02)


def test_little_in_view_says_nothing():
    assert inconsistency(view_of((2.0, -0.5, 2.0, 0.5)), view_of(AHEAD), LIMITS) == 0.0
    assert inconsistency(view_of(), view_of(AHEAD), LIMITS) == 0.0


OURS = Albot1Config().limits
STILL = np.zeros(3)
NEAR, FAR = view_of((2.0, -2.0, 2.0, 2.0)), view_of(AHEAD)
"""Each contradicts the other: one sees past the wall of the other."""


def count(
    previous: LocatedView,
    current: LocatedView,
    agreement: float,
    *,
    before: int = 0,
    has_moved: bool = True,
) -> int:
    odometer = unknown_odometer()
    odometer[HAS_MOVED], odometer[SHIFT] = has_moved, FIRST_SHIFT_ERROR**2
    return inconsistent_views(before, agreement, STILL, odometer, previous, current, OURS)


@pytest.mark.parametrize(("agreement", "inconsistent"), [(0.0, 1), (0.49, 1), (0.51, 0), (1.0, 0)])
def test_only_an_unsure_match_is_doubted(agreement, inconsistent):
    assert count(NEAR, FAR, agreement) == inconsistent


def test_the_less_lies_where_it_is_expected_the_less_may_contradict():
    # 15 % of the points contradict.
    both = view_of(AHEAD), view_of((2.0, -1.5, 2.0, 0.0), AHEAD)
    share = inconsistency(*both, OURS)
    assert count(*both, share / 2.9) == 0
    assert count(*both, share / 3.1) == 1


@pytest.mark.parametrize(
    ("shift", "has_moved", "agreement", "inconsistent"),
    [
        (2.0, True, 0.4, 1),  # The odometer says that the robot stands still.
        (2.0, False, 0.4, 0),  # There is no odometer.
        (-2.0, True, 0.4, 1),
        (0.2, True, 0.4, 0),  # The odometer is off by as much at times.
        (2.0, True, 0.6, 0),  # Wheels may slip: what is seen decides.
    ],
)
def test_a_match_far_from_where_the_odometer_says_is_doubted(
    shift, has_moved, agreement, inconsistent
):
    # Where it was matched, the robot sees the wall where it was seen before.
    current = view_of((4.0 - shift, -3.0, 4.0 - shift, 3.0), pose=(shift, 0.0, 0.0))
    assert inconsistency(FAR, current, OURS) == 0.0
    assert count(FAR, current, agreement, has_moved=has_moved) == inconsistent
    assert current.pose.tolist() == [shift, 0.0, 0.0]


def test_the_next_view_confirms_or_denies():
    assert count(NEAR, NEAR, 0.0, before=1) == 2
    assert count(NEAR, FAR, 1.0, before=1) == 0
