"""The agent `keyboard`: a person drives with the keys of a window or a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box

from albot_agents.agent import Action
from albot_agents.registry import BY_MAP, EXPLORE, HOMING, ROUND_TRIP, AgentEntry
from albot_agents.task import is_probe, untwinned
from albot_core.errors import InputError
from albot_env.rendering.viewer import NullViewer, Viewer

_TURN = 0.4
"""Turn rate of the arrow keys, as a share of the maximum; more makes driving straight hard."""


class Keyboard:
    """Drives by the arrow keys, and claims a place or declares home while Enter is held."""

    name: ClassVar[str] = "keyboard"
    knows_truth: ClassVar[bool] = False

    def __init__(self) -> None:
        self._viewer: Viewer = NullViewer()

    def listen(self, viewer: Viewer) -> None:
        """Use the keys of this viewer from now on.

        Raises:
            InputError: The viewer has no keys.
        """
        if not viewer.lasting:
            raise InputError("--agent keyboard", "a window or a terminal with keys", "neither")
        self._viewer = viewer

    def reset(self, rng: np.random.Generator, actions: Box) -> None:
        """Begin a new episode."""
        self._actions = actions

    def act(self, observation: Any, info: Mapping[str, Any]) -> Action:
        """Return the action for the held keys; without any, the robot stands still."""
        held = self._viewer.held()
        speed = ("up" in held) - ("down" in held)
        turn = ("left" in held) - ("right" in held)
        action = np.full(self._actions.shape, -1.0, np.float32)
        action[:2] = speed, _TURN * turn
        # The third number alone: what a fourth would say besides, Enter does not mean.
        action[2:3] = 1.0 if "enter" in held else -1.0
        return action


ENTER_MEANINGS = {
    EXPLORE: "enter: I was here",
    HOMING: "enter: I am home",
    BY_MAP: "enter: I am home",
    ROUND_TRIP: "enter: I am home",
}
"""Meaning of Enter in each task in which a person can drive."""


def enter_meaning(task: str) -> str:
    """Return what Enter means in a task, its twin or a probe."""
    return ENTER_MEANINGS[HOMING if is_probe(task) else untwinned(task)]


KEYBOARD = AgentEntry(summary="You drive.", make=lambda *_: Keyboard(), tasks=tuple(ENTER_MEANINGS))
"""The entry of the agent, which can drive only with a viewer."""
