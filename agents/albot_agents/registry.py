"""Agents by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable

from albot_agents.agent import Agent
from albot_agents.scripted.gap_explorer import GapExplorerAgent
from albot_agents.scripted.wanderer import Wanderer
from albot_core.errors import InputError
from albot_env.tasks.observation import ObservationConfig

USUAL = ObservationConfig()
"""How the environments make observations with the sensors that they have by default."""

_MAKERS: dict[str, Callable[[ObservationConfig], Agent]] = {
    GapExplorerAgent.name: GapExplorerAgent,
    Wanderer.name: lambda _: Wanderer(),
}


def agent_names() -> tuple[str, ...]:
    """The names of all agents."""
    return tuple(sorted(_MAKERS))


def make_agent(name: str, observing: ObservationConfig = USUAL) -> Agent:
    """A new agent.

    Args:
        name: One of `agent_names`.
        observing: How the environment that it is to act in makes observations (its
            `observing`).

    Raises:
        InputError: There is no agent of this name.
    """
    if name not in _MAKERS:
        close = difflib.get_close_matches(name, _MAKERS, n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise InputError("agent", f"one of {', '.join(agent_names())}", f"{name}{hint}")
    return _MAKERS[name](observing)
