"""Where the robot is in the experiences that it enters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from albot_core.errors import InputError
from albot_core.mappers.ratslam.config import CorrectionConfig, ExperienceConfig, RatSlamConfig
from albot_core.mappers.ratslam.pose_cells import Packet
from albot_core.mappers.ratslam.position import Position

PACKET = Packet(0.0, 0.0, 0.0, 1.0)


def between_two(smoothing: float) -> Position:
    """Two experiences at x = 0 and 1 m; the robot is in the second."""
    experiences = ExperienceConfig(smoothing=smoothing)
    config = replace(
        RatSlamConfig.scenes(), experiences=experiences, correction=CorrectionConfig(passes=0)
    )
    position = Position(config)
    position.enter(position.add(0, PACKET), (0.0, 0.0, 0.0), is_new=True)
    position.integrate((1.0, 0.0, 0.0), 1.0)
    position.iteration += 1
    position.enter(position.add(1, PACKET), (0.0, 0.0, 0.0), is_new=True)
    assert position.map.poses == pytest.approx(np.array(((0, 0, 0), (1, 0, 0))))
    return position


def enter(position: Position, experience: int, shift: float) -> float:
    """Enter an experience of which the pose cells tell; where the robot is in it then."""
    position.iteration += 1
    offset = (shift, 0.0, 0.0)
    entry = position.smoothed(experience, offset)
    position.enter(experience, *entry, is_new=False)
    return position.here[0]


def test_what_the_pose_cells_say_is_averaged_over_the_experiences_entered():
    """The robot stands at x = 0.5 m and is told each time that it stands 0.3 m before that."""
    position = between_two(0.25)
    position.integrate((-0.5, 0.0, 0.0), 2.0)
    assert enter(position, 0, 0.2) == pytest.approx(0.2)  # At first they are believed alone.
    x = 0.2
    for k, share in enumerate((1 / 2, 1 / 3, 1 / 4, 1 / 4, 1 / 4)):
        shift = 0.8
        here = enter(position, (k + 1) % 2, shift - (k + 1) % 2)
        x += share * (shift - x)
        assert here + (k + 1) % 2 == pytest.approx(x)


def test_without_smoothing_the_pose_cells_are_believed():
    position = between_two(1.0)
    for shift in (0.3, -0.2, 0.4):
        assert enter(position, 0, shift) == pytest.approx(shift)


@pytest.mark.parametrize("shift", [(1.9, 0.0, 0.0), (0.0, 0.0, 1.5)])
def test_far_from_where_it_is_expected_they_are_believed_too(shift: tuple[float, float, float]):
    """And the mean begins anew."""
    position = between_two(0.25)
    position.integrate((-0.5, 0.0, 0.0), 2.0)
    for _ in range(5):
        enter(position, 0, 0.5)
    assert position.smoothed(0, shift) == (shift, 1.0)
    position.iteration += 1
    position.enter(0, shift, 1.0, is_new=False)
    offset, weight = position.smoothed(0, (shift[0] + 0.4, 0.0, shift[2]))
    assert offset[0] == pytest.approx(shift[0] + 0.2)
    assert weight == pytest.approx(0.5)


def test_the_heading_is_averaged_the_short_way_round():
    position = between_two(0.5)
    enter(position, 0, 1.0)
    position.here = (0.5, 0.0, 2 * np.pi + 0.1)
    offset, _ = position.smoothed(0, (0.5, 0.0, 0.3))
    assert offset[2] == pytest.approx(0.2)


def along_two_corridors() -> Position:
    """Experiences 0 to 3 at x = 0 to 3 m, 4 to 7 at x = 10 to 13 m; the robot is in the last."""
    position = Position(RatSlamConfig.scenes())
    for number in range(8):
        position.enter(position.add(number, PACKET), (0.0, 0.0, 0.0), is_new=True)
        position.integrate((7.0 if number == 3 else 1.0, 0.0, 0.0), number + 1.0)
        position.iteration += 1
    position.integrate((-1.0, 0.0, 0.0), 9.0)
    return position


def visit(position: Position, experience: int) -> None:
    """Drive on by 1 m and enter a known experience at its origin."""
    position.integrate((-1.0, 0.0, 0.0), position.stamp + 1.0)
    position.iteration += 1
    offset = (0.0, 0.0, 0.0)
    position.check(experience, offset)
    position.enter(experience, *position.smoothed(experience, offset), is_new=False)


def transitions(position: Position) -> set[tuple[int, int]]:
    links = position.map.links
    return set(zip(links.rows("source").tolist(), links.rows("target").tolist(), strict=True))


def test_a_visit_to_an_experience_far_away_leaves_no_transition():
    """The robot drives back through 6, 5 and 4; once it is taken to be in 0, 11 m away."""
    position = along_two_corridors()
    before = transitions(position)
    for experience in (6, 0, 4):
        visit(position, experience)
    assert transitions(position) - before == {(7, 6), (6, 4)}
    there = position.map.links.rows("motion")[-1]
    assert there == pytest.approx((-2.0, 0.0, 0.0), abs=1e-9)


def test_experiences_far_away_that_follow_one_another_are_believed():
    """The robot is in fact 10 m farther back, as after a drift that the packet shares."""
    position = along_two_corridors()
    before = transitions(position)
    for experience in (3, 2, 1):
        visit(position, experience)
    assert transitions(position) == before
    visit(position, 0)
    assert transitions(position) - before == {(7, 3), (3, 2), (2, 1), (1, 0)}


def test_two_false_visits_in_a_row_do_not_confirm_each_other():
    position = along_two_corridors()
    before = transitions(position)
    for experience in (0, 3, 0, 3, 0):
        visit(position, experience)
    assert transitions(position) == before


def test_it_is_restored():
    position = between_two(0.25)
    for _ in range(3):
        enter(position, 0, 0.5)
    position.check(1, (5.0, 0.0, 0.0))
    enter(position, 1, 5.0)
    other = Position(RatSlamConfig.scenes())
    state = position.state() | {"history.place": np.zeros(3, np.int64)}
    other._set_state(state)
    assert {k: v.tolist() for k, v in other.state().items()} == {
        k: v.tolist() for k, v in position.state().items()
    }


def test_a_smoothing_beyond_one_is_refused():
    with pytest.raises(InputError, match=r"ExperienceConfig\.smoothing"):
        ExperienceConfig(smoothing=1.5)


def test_a_part_without_experiences_is_novel():
    """So is one where they all face elsewhere; whole turns do not matter."""
    position = between_two(0.25)
    zone = RatSlamConfig.scenes().experiences
    position.here = (0.9 * zone.radius, 0.0, 2 * np.pi + 0.9 * zone.turn)
    assert not position.is_novel
    position.here = (0.0, 1.1 * zone.radius, 0.0)
    assert position.is_novel
    position.here = (0.0, 0.0, -1.1 * zone.turn)
    assert position.is_novel
