"""Commands become actions, continuous or discrete."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, MultiBinary, Space

from albot_agents.agent import Commands
from albot_core.errors import InputError
from albot_env.tasks.core.actions import DRIVING, ActionConfig

CONFIG = ActionConfig(speed=0.5, turn_rate=1.0)


def begun(space: Space) -> Commands:
    commands = Commands(CONFIG)
    commands.reset(space, "someone")
    return commands


@pytest.mark.parametrize(("length", "flag"), [(2, False), (3, True), (3, False)])
def test_a_continuous_action_is_the_command_in_shares_of_its_limits(
    length: int, flag: bool
) -> None:
    action = begun(Box(-1, 1, (length,))).action(np.array((0.25, -3.0)), flag=flag)
    assert action == pytest.approx([0.5, -1.0, 1.0 if flag else -1.0][:length])


def test_discrete_actions_drive_the_command_on_average() -> None:
    commands, command = begun(Discrete(10)), np.array((0.35, 0.06))
    driven = np.mean([DRIVING[commands.action(command)] for _ in range(200)], axis=0)
    assert driven * (CONFIG.speed, CONFIG.turn_rate) == pytest.approx(command, abs=0.01)


def test_what_no_discrete_action_can_do_is_not_made_up_for_later() -> None:
    commands = begun(Discrete(10))
    for _ in range(10):
        assert DRIVING[commands.action(np.array((0.0, 1.0)))] == (0.0, 0.5)
    assert DRIVING[commands.action(np.array((0.2, 0.0)))] == (0.4, 0.0)


def test_a_discrete_statement_is_made_once_for_it_stops_the_robot() -> None:
    commands, ahead = begun(Discrete(11)), np.array((0.5, 0.0))
    choices = [commands.action(ahead, flag=flag) for flag in (True, True, False, True)]
    assert choices == [10, 0, 0, 10]


@pytest.mark.parametrize("space", [Box(-1, 1, (1,)), Discrete(3), MultiBinary(2)])
def test_actions_that_do_not_drive_are_refused(space: Space) -> None:
    with pytest.raises(InputError, match="someone, actions: expected 2 numbers or more, or 10"):
        begun(space)
