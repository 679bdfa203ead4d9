"""Commands become actions, continuous or discrete."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, MultiBinary, Space

from albot_agents.agent import Commands
from albot_core.errors import InputError
from albot_env.tasks.core.actions import (
    DRIVING,
    ActionConfig,
    ClaimingActionConfig,
    DeclaringActionConfig,
    MissionActionConfig,
)

CONFIG = ActionConfig(speed=0.5, turn_rate=1.0)


def begun(space: Space, config: ActionConfig = CONFIG) -> Commands:
    commands = Commands(config)
    commands.reset(space, "someone")
    return commands


@pytest.mark.parametrize(
    ("kind", "says", "said"),
    [
        (ActionConfig, "", []),
        (ActionConfig, "declare", []),
        (DeclaringActionConfig, "", [-1]),
        (DeclaringActionConfig, "declare", [1]),
        (DeclaringActionConfig, "claim", [-1]),
        (ClaimingActionConfig, "claim", [1]),
        (MissionActionConfig, "declare", [1, -1]),
        (MissionActionConfig, "claim", [-1, 1]),
    ],
)
def test_a_continuous_action_is_the_command_in_shares_of_its_limits(
    kind: type[ActionConfig], says: str, said: list[int]
) -> None:
    commands = begun(Box(-1, 1, (2 + len(said),)), kind(**vars(CONFIG)))
    assert commands.action(np.array((0.25, -3.0)), says) == pytest.approx([0.5, -1.0, *said])


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
    ahead = np.array((0.5, 0.0))
    commands = begun(Discrete(11), DeclaringActionConfig(**vars(CONFIG)))
    choices = [commands.action(ahead, says) for says in ("declare", "declare", "", "declare")]
    assert choices == [10, 0, 0, 10]
    commands = begun(Discrete(12), MissionActionConfig(**vars(CONFIG)))
    choices = [commands.action(ahead, says) for says in ("claim", "claim", "declare", "declare")]
    assert choices == [11, 0, 10, 0]


@pytest.mark.parametrize("space", [Box(-1, 1, (1,)), Discrete(3), MultiBinary(2)])
def test_actions_that_do_not_drive_are_refused(space: Space) -> None:
    with pytest.raises(InputError, match="someone, actions: expected 2 numbers or more, or 10"):
        begun(space)
