"""The paper's numbers, as what they decide: 10°, 1.2 m, 0.5 m, and what we take as "close"."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.mappers.association.mapper import AssociationConfig
from albot_core.mappers.association.surfaces import most_similar
from albot_core.planning.minimal_space_explorer import MinimalSpaceConfig
from albot_core.sensing.view import construct_view
from tests.core.scenes import scan_from

CONFIG = AssociationConfig()
WALL = np.array((0.0, 2.0, 4.0, 2.0))


def test_the_explorer_sees_the_surfaces_that_the_mapper_sees() -> None:
    assert MinimalSpaceConfig().view == CONFIG.view


def is_same(*surface: float) -> bool:
    """Whether a surface is the wall, by the mapper's own thresholds."""
    angle, closeness, *_ = CONFIG.map_limits
    assert (angle, closeness) == (CONFIG.angle, CONFIG.closeness)
    found: int = most_similar(np.array(surface), WALL[None], 1, CONFIG.angle, CONFIG.closeness)
    return found == 0


@pytest.mark.parametrize(
    ("degrees", "same"), [(-10.5, False), (-9.5, True), (9.5, True), (10.5, False)]
)
def test_surfaces_turned_by_up_to_ten_degrees_are_the_same(degrees: float, same: bool) -> None:
    turn = np.radians(degrees)
    assert is_same(2.0, 2.0, 2.0 + np.cos(turn), 2.0 + np.sin(turn)) == same


@pytest.mark.parametrize(("apart", "same"), [(0.38, True), (0.42, False)])
def test_surfaces_are_close_up_to_forty_centimetres(apart: float, same: bool) -> None:
    assert is_same(1.0, 2.0 + apart, 3.0, 2.0 + apart) == same  # Beside it.
    assert is_same(4.0 + apart, 2.0, 6.0, 2.0) == same  # Farther on.


def seen(*walls: tuple[float, ...]) -> np.ndarray:
    """What the mapper sees of some walls from the origin."""
    return construct_view(scan_from(np.zeros(3), np.array(walls)), CONFIG.view).surfaces


@pytest.mark.parametrize(("gap", "surfaces"), [(1.0, 1), (1.4, 2)])
def test_points_more_than_twelve_decimetres_apart_are_on_two_surfaces(
    gap: float, surfaces: int
) -> None:
    assert len(seen((2, -3, 2, -gap / 2), (2, gap / 2, 2, 3))) == surfaces


@pytest.mark.parametrize(("length", "surfaces"), [(0.4, 0), (0.6, 1)])
def test_surfaces_of_less_than_half_a_metre_are_ignored(length: float, surfaces: int) -> None:
    assert len(seen((2, -length / 2, 2, length / 2))) == surfaces
