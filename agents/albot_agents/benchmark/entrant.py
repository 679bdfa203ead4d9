"""An entrant of the benchmark: an agent with its mapper."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.protocol import Protocol
from albot_agents.benchmark.sources import source_digest
from albot_agents.registry import AgentEntry, agent_names, find_agent
from albot_agents.trained.agent_file import AgentFile
from albot_agents.trained.trained_agent import TrainedAgent
from albot_core.errors import InputError
from albot_core.mappers.registry import NO_MAPPER, mapper_spec
from albot_core.plain_data import to_plain

_DIGITS = 8
"""Digits of the fingerprint in the name of an agent in a file."""


def _fingerprint(file: AgentFile) -> str:
    """Return a SHA-256 hash of an agent's task, weights and settings.

    The settings decide on what it meets and observes, which its weights alone do not tell.
    """
    settings = json.dumps(to_plain(file.settings), sort_keys=True)
    return hashlib.sha256(f"{file.fingerprint} {settings}".encode()).hexdigest()


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """An agent with its mapper and sensors."""

    name: str
    """Its name in the table."""
    source: str
    """The agent's name, or the path of its file."""
    entry: AgentEntry
    """The agent's entry."""
    mapper: str
    """Name of the mapper in its environments, or `none`."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Further settings of its environments, such as the sensors that the mapper needs."""

    @property
    def fingerprint(self) -> str | None:
        """The fingerprint of a trained agent with its settings; None for a scripted one."""
        return None if self.entry.file is None else _fingerprint(self.entry.file)

    @property
    def sources(self) -> str:
        """Digest of the sources of agent and mapper (`source_digest`)."""
        return _sources(self.entry, self.mapper)

    def cell(self, task: str, odometer: str, worlds: str) -> Cell:
        """Return a cell of its row."""
        return Cell(
            task=task, agent=self.name, mapper=self.mapper, odometer=odometer, worlds=worlds
        )

    def environment(self, protocol: Protocol, task: str, odometer: str) -> dict[str, Any]:
        """Return the settings of its environments in a row.

        Raises:
            InputError: The task has no such settings.
        """
        wanted = {"odometer": odometer, "mapper": self.mapper, **self.settings}
        if (steps := protocol.tasks[task].steps) is not None:
            wanted["max_episode_steps"] = steps
        return self.entry.environment(task, wanted)


def find_entrant(name: str) -> Entrant:
    """Return the entrant of an agent, with the mapper that it uses unless another is requested.

    An agent in a file is called after the file and its fingerprint, so that two files of one name
    are two rows of the table.

    Raises:
        InputError: There is no such agent, or its file is hidden.
    """
    entry = find_agent(name)
    label = name
    if name not in agent_names() and entry.file is not None:
        if Path(name).name.startswith("."):
            raise InputError("agent", "a file whose name begins with no dot", name)
        label = f"{Path(name).stem}-{_fingerprint(entry.file)[:_DIGITS]}"
    return Entrant(name=label, source=name, entry=entry, mapper=entry.mapper)


def installed_sources(cell: Cell, fingerprint: str | None) -> str | None:
    """Return the digest of the installed sources of a cell's agent and mapper.

    Args:
        cell: The cell.
        fingerprint: The fingerprint of its agent; None if that is a scripted one.

    Returns:
        The digest; None if agent or mapper are not installed.
    """
    entry = find_agent(cell.agent) if cell.agent in agent_names() else None
    if entry is None and fingerprint is None:
        return None
    try:
        return _sources(entry, cell.mapper)
    except InputError:  # There is no such mapper.
        return None


def _sources(entry: AgentEntry | None, mapper: str) -> str:
    """Return the digest of the sources of a mapper and an agent (None: a trained one in a file)."""
    modules, others = [], []
    if mapper != NO_MAPPER:
        spec = mapper_spec(mapper)
        others = [spec.factory, spec.config]
        modules = [name.partition(":")[0] for name in others]
    if entry is None or entry.file is not None:
        modules.append(TrainedAgent.__module__)
    else:
        modules.append(entry.make.__module__)
        files = (find_agent(name).file for name in entry.skills)
        others += [_fingerprint(file) for file in files if file is not None]
    return source_digest(modules, others)
