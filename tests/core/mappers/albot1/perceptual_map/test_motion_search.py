"""What motions cost, in closed form, and that the pose counts to which a match leads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.perceptual_map.memory import LocatedView, empty_view
from albot_core.mappers.albot1.perceptual_map.motion_search import (
    BY_TURN,
    CHANGE_COST,
    GUESS_NEARLY,
    NEARLY,
    SHIFT_COST,
    STANDING,
    is_likely,
    most_motions,
    motion_cost,
)
from albot_core.mappers.albot1.perceptual_map.odometer_error import (
    HAS_MOVED,
    LAST_X,
    LAST_Y,
    SHIFT,
    SHIFT_SCALE,
    unknown_odometer,
)
from albot_core.mappers.albot1.perceptual_map.range_profile import TURN_COST
from albot_core.mappers.albot1.perceptual_map.submap import (
    ViewPair,
    make_match_buffers,
    pair_views,
)
from albot_core.mappers.albot1.perceptual_map.submap_matching import _worth
from albot_core.sensing.beam_model import BeamModel
from tests.core.mappers.slam.rooms import ROOM as HALL
from tests.core.mappers.slam.rooms import reading_from
from tests.core.scenes import ROOM

LIMITS = Albot1Config().limits
SCALE = 0.3
"""That of the odometer's errors of turn (rad)."""


def odometer_off_by(shift: float) -> np.ndarray:
    """What is known of an odometer whose translations err by so much (m)."""
    odometer = unknown_odometer()
    odometer[HAS_MOVED], odometer[SHIFT] = 1.0, shift**2
    return odometer


def paired(
    previous: LocatedView, current: LocatedView, motion: np.ndarray, odometer: np.ndarray
) -> ViewPair:
    """Two views of ROOM, to be matched."""
    beams, buffers = BeamModel(0.01, 0.01, False), make_match_buffers(len(ROOM), len(ROOM))
    pair = pair_views(previous, current, motion, odometer, LIMITS, beams, buffers)
    return ViewPair(*pair)


@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_a_motion_costs_by_what_it_departs_from_the_odometers(heading: float) -> None:
    odometer, motion = odometer_off_by(0.2), np.array((1.0, -0.4, heading))
    known = (motion, SCALE, odometer, LIMITS)
    across = SHIFT_SCALE * 0.2
    assert motion_cost(motion, *known) == 0.0
    turned = motion_cost(np.add(motion, (0.0, 0.0, SCALE)), *known)
    assert turned == pytest.approx(TURN_COST * np.log(2))
    assert motion_cost(np.add(motion, (0.0, 0.0, 2 * np.pi - SCALE)), *known) == pytest.approx(
        turned
    )
    shifted = motion_cost(np.add(motion, (0.6 * across, -0.8 * across, 0.0)), *known)
    assert shifted == pytest.approx(SHIFT_COST * np.log(2))
    both = motion_cost(np.add(motion, (0.6 * across, -0.8 * across, SCALE)), *known)
    assert both == pytest.approx(turned + shifted)


def test_the_worse_the_odometer_the_less_a_translation_costs_that_departs_from_its() -> None:
    motion, moved = np.zeros(3), np.array((0.5, 0.0, 0.0))
    costs = [
        motion_cost(moved, motion, SCALE, odometer_off_by(off), LIMITS) for off in (0.3, 0.1, 0.01)
    ]
    assert costs == sorted(costs)
    assert costs[0] < 0.5 * costs[1]


def test_without_an_odometer_a_translation_costs_by_what_it_departs_from_the_last() -> None:
    odometer, motion = unknown_odometer(), np.zeros(3)
    odometer[LAST_X], odometer[LAST_Y] = 0.5, 0.1
    last, twice = np.array((0.5, 0.1, 0.0)), np.array((0.5, 2.1, 0.0))
    assert motion_cost(last, motion, SCALE, odometer, LIMITS) == 0.0
    assert motion_cost(twice, motion, SCALE, odometer, LIMITS) == pytest.approx(4 * CHANGE_COST)


@pytest.mark.parametrize("is_sure", [False, True])
def test_with_an_odometer_turns_nearly_as_likely_as_the_first_are_aligned(is_sure: bool) -> None:
    """And all motions of other translations, which come after them."""
    odometer = odometer_off_by(0.1)
    for below, near in ((0.0, True), (0.9 * NEARLY, True), (1.1 * NEARLY, False), (9.0, False)):
        for k in (1, BY_TURN - 1):
            assert is_likely(k, 0.6 - below, 0.6, is_sure, odometer) == near
        assert is_likely(BY_TURN, 0.6 - below, 0.6, is_sure, odometer)
    assert not is_likely(BY_TURN, -np.inf, 0.6, is_sure, odometer)


def test_without_an_odometer_all_motions_are_aligned_until_a_match_is_sure() -> None:
    """Then those that are nearly as likely as the first."""
    odometer = unknown_odometer()
    for k in (0, 1, BY_TURN):
        for below in (0.0, 0.9 * GUESS_NEARLY, 1.1 * GUESS_NEARLY, 9.0):
            assert is_likely(k, 0.6 - below, 0.6, False, odometer)
            assert is_likely(k, 0.6 - below, 0.6, True, odometer) == (below < GUESS_NEARLY)
        assert not is_likely(k, -np.inf, 0.6, False, odometer)


finite = st.floats(-0.4, 0.4)


@given(st.tuples(finite, finite, finite), st.tuples(finite, finite, finite))
def test_a_match_is_worth_the_same_from_wherever_it_came_to_its_pose(
    a: tuple[float, float, float], b: tuple[float, float, float]
) -> None:
    view, motion = empty_view(len(ROOM)), np.array((0.3, 0.0, 0.1))
    view.surfaces[:], view.size[0] = ROOM, len(ROOM)
    pair = paired(view, view, motion, odometer_off_by(0.1))._replace(turn_scale=SCALE)
    led_to = np.array((0.2, -0.1, 0.05))
    worths = [
        _worth(0.7, np.array(start), compose(inverse(np.array(start)), led_to), pair)
        for start in (a, b)
    ]
    assert worths[0] == pytest.approx(worths[1], abs=1e-2)
    far = np.add(motion, (3.0, 0.0, 2.0))
    assert _worth(0.7, np.array(a), compose(inverse(np.array(a)), far), pair) < worths[0]


def test_a_robot_without_an_odometer_stands_still_where_the_next_view_is_as_the_last() -> None:
    """Else all motions would be searched at each view until it first moves."""
    previous, moved = empty_view(), np.array((0.2, 0.1, 0.05))
    previous.size[0] = len(ROOM)
    previous.surfaces[: len(ROOM)] = ROOM
    odometer, still = unknown_odometer(), np.zeros(3)

    def stands(motion: np.ndarray) -> bool:
        current = empty_view(len(ROOM))
        current.size[0] = len(ROOM)
        current.surfaces[: len(ROOM)] = transform_segments(inverse(motion), ROOM)
        return bool(most_motions(paired(previous, current, still, odometer)) == 1)

    assert stands(still)
    assert stands(np.array((0.005, 0.0, 0.002)))
    assert not stands(moved)
    odometer[LAST_Y] = -STANDING
    assert not stands(still), "along a corridor it may go on as before"


def test_a_robot_without_an_odometer_that_sets_off_slowly_is_followed() -> None:
    mapper, pose = Albot1(), np.zeros(3)
    for step in (*[0.0] * 5, *np.linspace(0.005, 0.3, 12)):
        pose = compose(pose, np.array((step, 0.0, 0.1 * step)))
        mapper.update(reading_from(pose, np.zeros(3), HALL))
    np.testing.assert_allclose(mapper.estimate.pose, pose, atol=0.03)
