"""The agent: it chooses a robot's actions in an environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_core.planning.steering import Command
from albot_core.robot import PIONEER_3DX, RobotConfig
from albot_env.tasks.core.actions import DRIVING, ActionConfig
from albot_env.tasks.core.observation import ObservationConfig

Action = Float32[np.ndarray, "numbers"]
"""Speed and turn rate as shares of what the environment allows, in [-1, 1], and further numbers,
each of which says what it is named after if it is above 0.5 (`ActionConfig.names`): `declare`, that
the robot is home; `claim`, that it knows the place."""


@runtime_checkable
class Agent(Protocol):
    """Chooses actions from observations."""

    @property
    def name(self) -> str:
        """The name under which `make_agent` finds it."""

    @property
    def knows_truth(self) -> bool:
        """Whether it uses the ground truth in the infos; such an agent is an upper bound only."""

    def reset(self, rng: np.random.Generator, actions: Any) -> None:
        """Begin a new episode: reset all state.

        Args:
            rng: The source of all its randomness.
            actions: The space of the environment's actions.

        Raises:
            InputError: The agent cannot act in such an environment.
        """

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the action for an observation, which is a flat array or a dict of parts.

        `info` is the environment's info for agents that know the truth, and empty for others.
        """


def choose_action(agent: Agent, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
    """Return an agent's action; `info` is passed on only if the agent knows the truth."""
    return agent.act(observation, info if agent.knows_truth else {})


class EnvironmentConfigs(NamedTuple):
    """What an agent is told of its environment."""

    observations: ObservationConfig
    """How observations are made of readings."""
    actions: ActionConfig
    """What the numbers of an action stand for."""
    robot: RobotConfig = PIONEER_3DX
    """Body and drive of the robot."""

    @classmethod
    def of(cls, env: gymnasium.Env[Any, Any]) -> EnvironmentConfigs:
        """Return those of an environment, which may be wrapped."""
        names = "observation_config", "action_config", "robot_config"
        return cls(*map(env.get_wrapper_attr, names))


class Commands:
    """Turns drive commands into the actions of an environment, continuous or discrete.

    Of the discrete actions that one is taken which is nearest to the command and to what the
    actions before fell short of theirs: so speeds between two actions are driven on average, by
    now one and now the other (first-order noise shaping, as in a delta-sigma modulator).

    Args:
        action_config: The environment's action config, which tells the scales.
    """

    def __init__(self, action_config: ActionConfig) -> None:
        self._config = action_config

    def reset(self, actions: Space[Any], who: str) -> None:
        """Begin an episode with this space of actions.

        Raises:
            InputError: It is no space of speeds and turn rates.
        """
        self._is_discrete = isinstance(actions, Discrete)
        self._numbers = int(actions.n) if isinstance(actions, Discrete) else 0
        if isinstance(actions, Box) and len(actions.shape) == 1:
            self._numbers = actions.shape[0]
        if self._numbers < (len(DRIVING) if self._is_discrete else 2):
            expected = (
                f"2 numbers or more, or {len(DRIVING)} discrete actions or more, to drive with"
            )
            raise InputError(who, expected, str(actions), place="actions")
        self._lacking = np.zeros(2)
        self._said = 0

    def action(self, command: Command, says: str = "") -> Action | np.int64:
        """Return the action for a command: speed (m/s) and turn rate (rad/s).

        Args:
            command: The command.
            says: Name of the further number that is to be high: `declare` or `claim`. Where the
                environment's actions have none of this name, nothing is said. A discrete action
                that says something also stops the robot, so of several in a row only the first
                does.
        """
        shares = self._config.shares(command)
        names = self._config.names
        place = names.index(says) if says in names else 0
        if not self._is_discrete:
            action = np.full(self._numbers, -1.0, np.float32)
            action[:2] = shares
            if place and place < self._numbers:
                action[place] = 1.0
            return action
        is_first, self._said = place not in (0, self._said), place
        saying = len(DRIVING) + place - 2
        if is_first and saying < self._numbers:
            return np.int64(saying)
        choices = np.array(DRIVING)
        # What no action can do is not made up for later.
        wanted = np.clip(shares, choices.min(axis=0), choices.max(axis=0)) + self._lacking
        choice = int(np.argmin(np.hypot(*(choices - wanted).T)))
        self._lacking = np.clip(wanted - choices[choice], -0.5, 0.5)
        return np.int64(choice)


def begin_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, seed: int
) -> tuple[Any, dict[str, Any]]:
    """Reset environment and agent; return the first observation and info.

    The agent's generator is derived from `seed`, so that it does not draw the same numbers as the
    environment.
    """
    agent.reset(np.random.default_rng((seed, 1)), env.action_space)
    return env.reset(seed=seed)
