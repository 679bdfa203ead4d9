"""What the table of results consists of: which agents meet in which tasks, and where."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from albot_agents.evaluation.plan import Trial, plan_trials
from albot_agents.registry import find_agent

OFFICES, APARTMENTS, PLANS = "random offices", "random apartments", "real floor plans"
RANDOM = {OFFICES: "random:office", APARTMENTS: "random:apartment"}
"""Kinds of generated worlds, and their specs: each seed is a world."""


@dataclass(frozen=True, kw_only=True)
class Contest:
    """A task, and who meets in it."""

    task: str
    """Id of the environment."""
    agents: tuple[str, ...]
    """Names of the agents."""
    odometers: tuple[str, ...] = ("pioneer",)
    """The presets of noise."""
    kinds: tuple[str, ...] = (OFFICES, APARTMENTS, PLANS)
    """The kinds of worlds."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """What else environments are made with."""


CONTESTS = (
    Contest(
        task="Albot/Homing-v0",
        agents=(
            "oracle",
            "albot1-homing",
            "homing",
            "homing-blind",
            "homing-mapless",
            "path-integration",
            "random",
        ),
        odometers=("pioneer", "poor"),
        # So many journeys that hardly two episodes share one, but all agents of an episode do.
        settings={"journeys": 2**31},
    ),
    Contest(
        task="Albot/Explore-v0",
        agents=("gap-explorer", "nearest-frontier", "exploring", "random"),
    ),
    Contest(task="Albot/ExploreAndHome-v0", agents=("round-trip", "random")),
    # Rooms are the truth of places: the floor plans' are cut otherwise than robots see them.
    Contest(
        task="Albot/PlaceRecognition-v0",
        agents=("place-judge", "place-recognition", "random"),
        kinds=(OFFICES, APARTMENTS),
        settings={"journeys": 2**31},
    ),
)
"""All that the table holds."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A row of the table: an agent with an odometer in a kind of worlds."""

    task: str
    agent: str
    odometer: str
    kind: str


@dataclass(frozen=True, kw_only=True)
class Meeting:
    """One episode of each of several agents: the same world, seed and noise."""

    cells: tuple[Cell, ...]
    """The rows that the episodes belong to."""
    trials: tuple[Trial, ...]
    """The episodes, in the same order."""


def plan_meetings(
    contests: Iterable[Contest], worlds: Mapping[str, Sequence[str]], seeds: Mapping[str, range]
) -> list[Meeting]:
    """Every agent in every world with every seed, those of one world and seed together.

    Args:
        contests: Who meets in what.
        worlds: The world specs of each kind; kinds that are missing are left out.
        seeds: The seeds of each kind.

    Raises:
        InputError: There is no such agent or world.
    """
    return [
        meeting
        for contest in contests
        for kind in contest.kinds
        if kind in worlds
        for odometer in contest.odometers
        for meeting in _meetings(contest, kind, odometer, worlds[kind], seeds[kind])
    ]


def _meetings(
    contest: Contest, kind: str, odometer: str, worlds: Sequence[str], seeds: range
) -> Iterator[Meeting]:
    columns = []
    for agent in contest.agents:
        wanted = {"odometer": odometer, **contest.settings}
        settings = find_agent(agent).environment(contest.task, wanted)
        columns.append(plan_trials(contest.task, agent, worlds, seeds, settings))
    cells = tuple(
        Cell(task=contest.task, agent=agent, odometer=odometer, kind=kind)
        for agent in contest.agents
    )
    for trials in zip(*columns, strict=True):
        yield Meeting(cells=cells, trials=trials)
