"""A cell of the benchmark's table, and the episodes measured in it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from albot_agents.evaluation.trial import Outcome
from albot_core.geometry.types import Pose
from albot_core.plain_data import Location, read_array, read_record


@dataclass(frozen=True, kw_only=True)
class Cell:
    """An agent in a task, with an odometer, in a kind of worlds."""

    task: str
    """Id of the environment."""
    agent: str
    """Name of the agent in the table."""
    mapper: str
    """Name of the mapper in its environments, or `none`."""
    odometer: str
    """Preset of the odometer's noise."""
    worlds: str
    """Kind of worlds, a key of `Protocol.worlds`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeResult:
    """The measurements of an episode, as they are kept: a `MeasuredEpisode`."""

    agent: str
    """Name of the agent in the table."""
    world: str
    """The world's name in the protocol (`EpisodeKey.world`)."""
    seed: int
    """Seed of environment and agent."""
    steps: int
    """Number of steps."""
    start: Pose
    """Pose of home (world frame)."""
    begin: Pose
    """Pose at the beginning of the episode (world frame)."""
    driven: float
    """Length of the agent's path (m)."""
    collisions: int
    """Number of times that the robot came into contact with something."""
    rooms: int
    """Number of rooms that the robot can reach; 0 if the task measures no exploring."""
    coverage_auc: float | None
    """Mean share of ground covered over the first 200 m; None if the task measures none."""
    info: Mapping[str, Any]
    """The single values of the last info; None for a number that is not finite."""

    @classmethod
    def of(cls, outcome: Outcome, agent: str, world: str) -> EpisodeResult:
        """Return what is kept of an episode.

        Args:
            outcome: The episode.
            agent: Name of the agent in the table.
            world: The world's name in the protocol.
        """
        return cls(
            agent=agent,
            world=world,
            seed=outcome.seed,
            steps=len(outcome.path) - 1,
            start=outcome.start,
            begin=outcome.begin,
            driven=outcome.driven,
            collisions=int(outcome.collisions),
            rooms=outcome.rooms,
            coverage_auc=outcome.coverage_auc,
            info=single_values(outcome.info),
        )

    def difference(self, other: EpisodeResult) -> tuple[str, Any, Any] | None:
        """Return the first value that differs from another result's: its name, and both values.

        None if the results are the same.
        """
        mine, its = self._flat(), other._flat()
        for name in (*mine, *its):
            if mine.get(name) != its.get(name) or (name in mine) != (name in its):
                return name, mine.get(name), its.get(name)
        return None

    def _flat(self) -> dict[str, Any]:
        data = self.to_plain()
        return {f"info.{name}": value for name, value in data.pop("info").items()} | data

    def to_plain(self) -> dict[str, Any]:
        """Return it as plain data, without the agent's name; `read_episode` is the inverse."""
        data = {each.name: getattr(self, each.name) for each in fields(self)}
        del data["agent"]
        return data | {"start": self.start.tolist(), "begin": self.begin.tolist()}


def single_values(info: Mapping[str, Any]) -> dict[str, Any]:
    """Return the single values of an info by name, in alphabetical order.

    Arrays and mappings are left out. A number that is not finite becomes None, as JSON has none.
    """
    values: dict[str, Any] = {}
    for name in sorted(info):
        value = info[name]
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, float) and not math.isfinite(value):
            value = None
        elif not isinstance(value, bool | int | float | str):
            continue
        values[name] = value
    return values


_KINDS = {
    "world": str, "seed": int, "steps": int, "start": Any, "begin": Any, "driven": float,
    "collisions": int, "rooms": int, "coverage_auc": float | None, "info": dict[str, Any],
}  # fmt: skip


def read_episode(data: Any, agent: str, where: Location) -> EpisodeResult:
    """Parse the plain data of an episode.

    Args:
        data: The data.
        agent: Name of the agent in the table.
        where: Location of the data.

    Raises:
        InputError: It is not such data; the error names the place.
    """
    found = read_record(_KINDS, data, where)
    for name in ("start", "begin"):
        found[name] = read_array((3,), found[name], where.at(name))
    return EpisodeResult(agent=agent, **found)
