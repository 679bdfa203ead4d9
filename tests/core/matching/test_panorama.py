"""Panoramas of rooms whose walls are known, laid on each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.geometry.poses import inverse, transform_points
from albot_core.matching.panorama import DIRECTIONS, Panorama, match_panoramas


def _walls(width: float, depth: float, step: float = 0.02) -> np.ndarray:
    """Points along the walls of a room with a corner at the origin, and of a niche in it (m)."""
    x, y = np.arange(0, width, step), np.arange(0, depth, step)
    sides = [(x, 0 * x), (x, 0 * x + depth), (0 * y, y), (0 * y + width, y)]
    pillar = np.arange(0, 0.8, step)
    sides += [(width - pillar, 0 * pillar + 0.8), (0 * pillar + width - 0.8, pillar)]
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def _seen(walls: np.ndarray, pose: np.ndarray) -> Panorama:
    return Panorama.of(transform_points(inverse(pose), walls))


ROOM = _walls(5.0, 3.5)
HERE = np.array((2.0, 1.5, 0.0))


def test_a_panorama_is_the_nearest_in_every_direction() -> None:
    angles = (np.arange(DIRECTIONS) + 0.5) * 2 * np.pi / DIRECTIONS
    around = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    panorama = Panorama.of(np.concatenate((3 * around, 2 * around[:5], 4 * around)))
    assert panorama.ranges == pytest.approx(np.where(np.arange(DIRECTIONS) < 5, 2.0, 3.0))


def test_where_nothing_was_seen_there_is_nothing() -> None:
    panorama = Panorama.of(np.array(((1.0, 0.01), (0.0, 2.0))))
    assert np.flatnonzero(panorama.ranges).tolist() == [0, DIRECTIONS // 4]
    nothing = Panorama.of(np.empty((0, 2)))
    found = match_panoramas(nothing, panorama, np.zeros(3))
    assert (found.agreed, found.contradicted) == (0.0, 0.0)


@given(st.floats(-0.8, 0.8), st.floats(-0.6, 0.6), st.floats(-0.3, 0.3))
@settings(deadline=None, max_examples=25)
def test_the_same_room_is_laid_on_itself(x: float, y: float, turn: float) -> None:
    """Wherever in it, and however far off the guess is."""
    there = HERE + np.array((x, y, turn))
    found = match_panoramas(_seen(ROOM, HERE), _seen(ROOM, there), np.zeros(3))
    assert found.agreed > 0.93
    assert found.contradicted < 0.03
    assert found.pose == pytest.approx(np.array((x, y, turn)), abs=0.15)


def test_a_smaller_room_contradicts_a_larger_one() -> None:
    small = _walls(2.0, 1.6)
    found = match_panoramas(_seen(ROOM, HERE), _seen(small, np.array((1.0, 0.8, 0.0))), np.zeros(3))
    assert found.contradicted > 0.2
    assert found.agreed < 0.75


def test_the_better_of_two_guesses_counts() -> None:
    there = HERE + np.array((1.8, 0.5, 0.0))
    mine, theirs = _seen(ROOM, HERE), _seen(ROOM, there)
    far, near = np.array((-3.0, -3.0, 0.0)), np.array((1.5, 0.2, 0.1))
    assert match_panoramas(mine, theirs, far).agreed < 0.8
    both = match_panoramas(mine, theirs, far, near)
    assert both.agreed == match_panoramas(mine, theirs, near).agreed > 0.93


def test_sight_ends_at_the_wall_behind() -> None:
    """From 2 m one looks along y = 1.5 to the wall at 5 m, past a place at 3 m; back to 0."""
    there = HERE + np.array((1.0, 0.0, 0.0))
    found = match_panoramas(_seen(ROOM, HERE), _seen(ROOM, there), np.zeros(3))
    apart = np.hypot(*found.pose[:2])
    assert apart == pytest.approx(1.0, abs=0.1)
    assert found.sight == pytest.approx(2.0, abs=0.25)  # Seen from there the wall is 3 m behind.


def test_a_wall_between_ends_the_sight() -> None:
    """What is laid beyond the wall is out of sight."""
    corridor = np.stack((np.arange(-4, 4, 0.02), np.full(400, 1.0)), axis=1)
    mine, theirs = Panorama.of(corridor), Panorama.of(corridor - (0.0, 3.0))
    assert match_panoramas(mine, theirs, np.array((0.0, 3.0, 0.0))).sight < -1.0
