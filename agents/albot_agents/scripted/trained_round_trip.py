"""An agent of two trained ones: the first explores and claims places, the second drives home."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Space

from albot_agents.agent import Action, Commands, EnvironmentConfigs
from albot_agents.scripted.exploring import TimeToReturn
from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.network import DRIVEN
from albot_agents.trained.trained_agent import TrainedAgent, shipped_agents
from albot_core.errors import InputError
from albot_core.planning.steering import Command
from albot_env.tasks.core.actions import FlaggingActionConfig
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation import PART_NAMES, ObservationConfig
from albot_env.tasks.core.parts.scales import scale_ranges
from albot_env.tasks.core.parts.sensors import LASER

_SCALES = (
    "laser", "laser_knee", "laser_sectors", "home_range", "home_knee", "home_drift", "home_near",
    "step_length", "step_turn",
)  # fmt: skip
"""What must be as in a skill's training; only the laser's range is its own."""
_SCALED_BY = {"coverage": "coverage", "onward": "wayfinding", "path": "wayfinding"}
"""The configurations on which parts depend."""


class TrainedRoundTrip:
    """Explores and claims like the trained `exploring`; drives home in time like `homing`.

    Each network is shown what it saw in its training. When to turn back is decided as by
    `round-trip`, but for the speed that is expected.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack what one of the networks saw in its training.
    """

    name: ClassVar[str] = "explore-and-home"
    knows_truth: ClassVar[bool] = False
    SKILLS: ClassVar[tuple[str, str]] = ("exploring", "homing")
    """The agents that explore, and claim; and that drive home, and declare."""
    SPEED = 0.6
    """Expected speed on the way home (m/s)."""

    OBSERVATIONS: ClassVar[ObservationConfig] = ObservationConfig(
        laser_sectors=36,
        laser_range=10.0,
        parts=tuple(
            part
            for part in PART_NAMES
            if part
            in (
                "laser", "motion", "home", "confidence", "place", "path", "coverage", "frontier",
                "onward", "time_left", "matches",
            )
        ),
        coverage=CoverageConfig(patch_cells=8, patch_cell=1.5),
        matches=1,
    )  # fmt: skip
    """What it observes if nothing else is asked for."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        self._return = TimeToReturn(configs.observations, self.SPEED)
        self._commands = Commands(configs.actions)
        self._explores, self._drives_home = (Skill(name, configs) for name in self.SKILLS)

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode, exploring.

        Raises:
            InputError: Observations lack the part `time_left`, or actions do not drive.
        """
        self._return.reset(self.name)
        self._commands.reset(actions, self.name)
        self._explores.reset(rng)
        self._drives_home.reset(rng)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action | np.int64:
        """Return the next action. On the way home, too, it claims to know places."""
        command, claims = self._explores.act(observation)
        says = "claim" if claims else ""
        if self._return.has_come(observation):
            command, is_home = self._drives_home.act(observation)
            says = "declare" if is_home else says
        return self._commands.action(command, says=says)


class Skill:
    """A trained agent in an environment that shows and asks more than that of its training.

    Args:
        name: Name of the trained agent.
        configs: The environment's configurations.

    Raises:
        InputError: The environment does not show what the agent saw in its training.
    """

    def __init__(self, name: str, configs: EnvironmentConfigs) -> None:
        file = read_agent(shipped_agents()[name])
        seen, shown = file.observation_config, configs.observations
        assert seen is not None, f"{name} was not trained to drive"
        self._seen, self._shown = seen, shown
        usual = FlaggingActionConfig().threshold
        self._threshold = float(file.settings["config"]["actions"].get("threshold", usual))
        for part, shape in seen.shapes.items():
            found = shown.shapes.get(part)
            if found != shape:
                raise InputError(name, f"the part {part} of shape {shape}", str(found or "none"))
        needed = [*_SCALES, *(each for part, each in _SCALED_BY.items() if part in seen.shapes)]
        for scale in needed:
            expected, given = getattr(seen, scale), getattr(shown, scale)
            if expected != given:
                raise InputError(name, f"{scale} {expected}", str(given))
        if shown.laser_range < seen.laser_range:
            expected = f"laser_range {seen.laser_range:g} or more"
            raise InputError(name, expected, f"{shown.laser_range:g}")
        self._agent = TrainedAgent(name, file, EnvironmentConfigs(seen, file.actions))
        self._scales = np.array((file.actions.speed, file.actions.turn_rate))
        self._asked = Box(-1, 1, (file.network.outputs,), np.float32)

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a new episode."""
        self._agent.reset(rng, self._asked)

    def act(self, observation: Any) -> tuple[Command, bool]:
        """Return how the agent would drive (m/s, rad/s), and whether it would say what it can."""
        parts = observation if isinstance(observation, dict) else self._shown.split(observation)
        own = {part: np.asarray(parts[part], np.float32) for part in self._seen.shapes}
        ranges = self._shown.decode(LASER, observation)
        own[LASER.name] = np.empty(len(ranges), np.float32)
        scale_ranges(ranges, self._seen.scales.laser, own[LASER.name])
        numbers = np.asarray(self._agent.act(own, {}), np.float64)
        return numbers[:DRIVEN] * self._scales, bool(numbers[DRIVEN] > self._threshold)
