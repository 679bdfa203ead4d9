"""Views that contradict each other, counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.perceptual_map.consistency import inconsistency
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView, empty_view

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
