"""Agents by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass

from albot_agents.agent import Agent
from albot_agents.scripted.albot1_homing import Albot1Homing
from albot_agents.scripted.gap_explorer import GapExplorerAgent
from albot_agents.scripted.oracle import Oracle
from albot_agents.scripted.path_integration import PathIntegration
from albot_agents.scripted.place_judge import PlaceJudge
from albot_agents.scripted.wanderer import Wanderer
from albot_core.errors import InputError
from albot_env.tasks.observation import ObservationConfig

USUAL = ObservationConfig()
"""How the environments make observations with the sensors that they have by default."""


@dataclass(frozen=True, kw_only=True)
class AgentEntry:
    """An agent that can be made by name."""

    summary: str
    """What it does, in one line."""
    make: Callable[[ObservationConfig], Agent]
    """What makes it, for an environment that makes observations so."""
    mapper: str = "albot1"
    """The mapper that it is evaluated with where no other is asked for."""


AGENTS = {
    Albot1Homing.name: AgentEntry(
        summary="Drives home through the exits of Albot1's network of places.",
        make=Albot1Homing,
    ),
    GapExplorerAgent.name: AgentEntry(
        summary="Explores from gap to gap, the nearest first.",
        make=GapExplorerAgent,
    ),
    Oracle.name: AgentEntry(
        summary="Knows the truth and drives the shortest way home: the upper bound.",
        make=Oracle,
        mapper="none",
    ),
    PathIntegration.name: AgentEntry(
        summary="Follows the odometer's home vector, without a map.",
        make=PathIntegration,
        mapper="none",
    ),
    PlaceJudge.name: AgentEntry(
        summary="Judges which place it has seen before, by what agrees; it drives nothing.",
        make=PlaceJudge,
    ),
    Wanderer.name: AgentEntry(
        summary="Acts at random: the lower bound.", make=lambda _: Wanderer(), mapper="none"
    ),
}
"""All agents by name, in the order of the alphabet."""


def agent_names() -> tuple[str, ...]:
    """The names of all agents."""
    return tuple(AGENTS)


def find_agent(name: str) -> AgentEntry:
    """The agent of a name.

    Raises:
        InputError: There is none; the message names the nearest.
    """
    if name not in AGENTS:
        close = difflib.get_close_matches(name, AGENTS, n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise InputError("agent", f"one of {', '.join(AGENTS)}", f"{name or 'nothing'}{hint}")
    return AGENTS[name]


def make_agent(name: str, observing: ObservationConfig = USUAL) -> Agent:
    """A new agent.

    Args:
        name: One of `agent_names`.
        observing: How the environment that it is to act in makes observations (its
            `observing`).

    Raises:
        InputError: There is no agent of this name.
    """
    return find_agent(name).make(observing)
