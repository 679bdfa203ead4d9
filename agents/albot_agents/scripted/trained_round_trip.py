"""An agent of two trained ones: the first explores and claims places, the second drives home."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete, Space

from albot_agents.agent import Action, EnvironmentConfigs
from albot_agents.scripted.exploring import RoundTripAgent
from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.network import DRIVEN
from albot_agents.trained.trained_agent import TrainedAgent, shipped_agents
from albot_core.errors import InputError
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation import PART_NAMES, ObservationConfig
from albot_env.tasks.core.parts.scales import scale_ranges
from albot_env.tasks.core.parts.sensors import LASER
from albot_env.tasks.core.wayfinding import WayfindingConfig

_SCALES = (
    "laser_knee", "laser_sectors", "home_range", "home_knee", "home_drift", "home_near",
    "step_length", "step_turn",
)  # fmt: skip
"""Scales of observations that must be as in a skill's training; each has its own laser range."""
_SCALED_BY = {"coverage": "coverage", "onward": "wayfinding"}
"""The configurations on which parts depend."""


class TrainedRoundTrip(RoundTripAgent):
    """Explores and claims like the trained `exploring`; drives home in time like `homing`.

    Each network is shown what it saw in its training. When to turn back is decided as by
    `round-trip`, but for the speed that is expected.

    Args:
        configs: The environment's configurations of observations and actions.

    Raises:
        InputError: Observations lack what one of the networks saw in its training.
    """

    name: ClassVar[str] = "explore-and-home"
    SKILLS: ClassVar[Mapping[str, str]] = {"exploring": "claim", "homing": "declare"}
    """The agents that explore and drive home, and what each says."""
    SPEED = 0.6

    OBSERVATIONS: ClassVar[ObservationConfig] = ObservationConfig(
        laser_sectors=36,
        laser_range=10.0,
        parts=tuple(
            part
            for part in PART_NAMES
            if part
            in (
                "laser", "motion", "home", "confidence", "place", "exit", "way", "shortcut",
                "coverage", "frontier", "onward", "time_left", "matches",
            )
        ),
        coverage=CoverageConfig(patch_cells=8, patch_cell=1.5),
        matches=1,
        wayfinding=WayfindingConfig(new_share=0.75, about=1.2),
    )  # fmt: skip
    """What it observes if nothing else is asked for."""

    def __init__(self, configs: EnvironmentConfigs) -> None:
        self._observation_config = configs.observations
        self._explorer, self._homer = (Skill(*skill, configs) for skill in self.SKILLS.items())

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """Return the next action. On the way home, too, it claims to know places."""
        exploring = np.asarray(self._explorer.act(observation, info))
        if not self._turns_back(observation):
            return exploring
        homing = np.asarray(self._homer.act(observation, info))
        said = np.maximum(exploring[DRIVEN:], homing[DRIVEN:])
        return np.concatenate((homing[:DRIVEN], said))


class Skill:
    """A trained agent in an environment that shows and asks more than that of its training.

    Args:
        name: Name of the trained agent.
        said: What its third number says.
        configs: The environment's configurations.

    Raises:
        InputError: The environment does not show what the agent saw in its training.
    """

    knows_truth: ClassVar[bool] = False

    def __init__(self, name: str, said: str, configs: EnvironmentConfigs) -> None:
        self.name = name
        file = read_agent(shipped_agents()[name])
        seen, shown = file.observation_config, configs.observations
        assert seen is not None, f"{name} was not trained to drive"
        self._seen, self._shown, self._said = seen, shown, said
        self._threshold = float(file.settings["config"]["actions"].get("threshold", 0.0))
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
        self._actions = configs.actions
        self._agent = TrainedAgent(name, file, EnvironmentConfigs(seen, file.actions))
        self._asked = Box(-1, 1, (file.network.outputs,), np.float32)

    def reset(self, rng: np.random.Generator, actions: Space[Any]) -> None:
        """Begin a new episode.

        Raises:
            InputError: Actions are discrete.
        """
        if isinstance(actions, Discrete):
            raise InputError(self.name, "continuous actions", f"{actions.n} discrete")
        self._agent.reset(rng, self._asked)

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """Return what the trained agent would do; it says nothing else."""
        parts = observation if isinstance(observation, dict) else self._shown.split(observation)
        own = {part: np.asarray(parts[part], np.float32) for part in self._seen.shapes}
        ranges = self._shown.decode(LASER, observation)
        own[LASER.name] = np.empty(len(ranges), np.float32)
        scale_ranges(ranges, self._seen.scales.laser, own[LASER.name])
        numbers = np.asarray(self._agent.act(own, info))
        driving, said = numbers[:DRIVEN], numbers[DRIVEN]
        answer = np.full(len(self._actions.names), -1.0, np.float32)
        answer[:DRIVEN] = driving
        if self._said in self._actions.names:
            answer[self._actions.names.index(self._said)] = 2 * (said > self._threshold) - 1
        return answer
