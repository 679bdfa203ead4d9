"""The table of results: agents compared in the same episodes of the same tasks.

`COMPARISONS` lists which agents are compared in which task, with which odometers and worlds. For
each world and seed every agent runs one episode (`PairedTrials`): the same world, start, outward
journey or tour, and people and boxes. Its own are its sensors with their noise, its map and what it
does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

from albot_agents.evaluation.paired import check_same_episodes, paired_differences
from albot_agents.evaluation.plan import Trial, plan_trials
from albot_agents.evaluation.summary import summarise
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_agents.registry import find_agent
from albot_agents.workers import TaskRunner, run_parallel
from albot_core.errors import InputError

OFFICES, APARTMENTS, PLANS = "random offices", "random apartments", "real floor plans"
RANDOM = {OFFICES: "random:office", APARTMENTS: "random:apartment"}
"""Kinds of generated worlds, and their specs; each seed is one world."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A task, and the agents compared in it."""

    task: str
    """Id of the environment."""
    agents: tuple[str, ...]
    """Names of the agents. The differences of the others from the first are told."""
    figure: str
    """The figure whose differences are told (see `paired.FIGURES`)."""
    odometers: tuple[str, ...] = ("pioneer",)
    """Presets of odometer noise."""
    kinds: tuple[str, ...] = (OFFICES, APARTMENTS, PLANS)
    """The kinds of worlds."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Other settings of the environments."""


COMPARISONS = (
    Comparison(
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
        figure="spl",
    ),
    Comparison(
        task="Albot/HomingByMap-v0",
        agents=(
            "oracle",
            "albot1-homing",
            "patch-homing",
            "map-homing",
            "path-integration",
            "random",
        ),
        figure="spl",
    ),
    Comparison(
        task="Albot/Explore-v0",
        agents=("gap-explorer", "nearest-frontier", "exploring", "random"),
        figure="coverage_auc",
    ),
    Comparison(task="Albot/ExploreAndHome-v1", agents=("round-trip", "random"), figure="spl"),
    # Rooms are the ground truth of places; the floor plans divide rooms unlike a robot sees them.
    Comparison(
        task="Albot/PlaceRecognition-v0",
        agents=("place-judge", "place-recognition", "random"),
        figure="recall",
        kinds=(OFFICES, APARTMENTS),
    ),
)
"""The content of the table."""


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """A row of the table: an agent with one odometer in one kind of worlds."""

    task: str
    agent: str
    odometer: str
    kind: str
    figure: str
    """The figure whose difference from the first agent of the comparison is told."""


@dataclass(frozen=True, kw_only=True)
class PairedTrials:
    """The same episode for each agent."""

    rows: tuple[TableRow, ...]
    """The rows that the episodes belong to."""
    trials: tuple[Trial, ...]
    """The episodes, in the same order."""


def plan_paired_trials(
    comparisons: Iterable[Comparison],
    worlds: Mapping[str, Sequence[str]],
    seeds: Mapping[str, range],
) -> list[PairedTrials]:
    """Plan an episode per agent, world and seed, grouped by world and seed.

    Args:
        comparisons: The comparisons.
        worlds: The world specs of each kind; missing kinds are left out.
        seeds: The seeds of each kind.

    Raises:
        InputError: There is no such agent or world, or an agent would meet other episodes.
    """
    return [
        paired
        for comparison in comparisons
        for kind in comparison.kinds
        if kind in worlds
        for odometer in comparison.odometers
        for paired in _pair_trials(comparison, kind, odometer, worlds[kind], seeds[kind])
    ]


def _pair_trials(
    comparison: Comparison, kind: str, odometer: str, worlds: Sequence[str], seeds: range
) -> Iterator[PairedTrials]:
    columns = []
    for agent in comparison.agents:
        wanted = {"odometer": odometer, **comparison.settings}
        settings = find_agent(agent).environment(comparison.task, wanted)
        columns.append(plan_trials(comparison.task, agent, worlds, seeds, settings))
    rows = tuple(
        TableRow(
            task=comparison.task,
            agent=agent,
            odometer=odometer,
            kind=kind,
            figure=comparison.figure,
        )
        for agent in comparison.agents
    )
    check_same_episodes({row.agent: trials[0] for row, trials in zip(rows, columns, strict=True)})
    for trials in zip(*columns, strict=True):
        yield PairedTrials(rows=rows, trials=trials)


Figures = Mapping[TableRow, Mapping[str, Any]]
"""The figures of each row, as `summarise` returns them."""


Numbered = tuple[int, PairedTrials]
"""Paired trials and their number."""
Outcomes = tuple[int, list[Outcome]] | InputError
"""The number of the paired trials and the outcome of each trial; or the error of one of them."""


class PairedTrialsRunner(TaskRunner[Numbered, Outcomes]):
    """Runs paired trials."""

    def run(self, task: Numbered, on_step: Callable[[int], None]) -> Outcomes:
        """Run all episodes of paired trials."""
        number, paired = task
        try:
            return number, [run_trial(trial, on_step) for trial in paired.trials]
        except InputError as error:
            return error

    def on_crash(self, task: Numbered, step: int, cause: str) -> Outcomes:
        """Raise RuntimeError: the process died, which is a bug.

        Raises:
            RuntimeError: Always.
        """
        trial = task[1].trials[0]
        raise RuntimeError(f"{trial.task} in {trial.world}, seed {trial.seed}: {cause}")


def run_paired_trials(
    planned: Sequence[PairedTrials], jobs: int, on_done: Callable[[int], None] = lambda _: None
) -> Figures:
    """Run paired trials; return the figures of each row.

    Args:
        planned: The episodes.
        jobs: Number of processes.
        on_done: Called with the number of finished paired trials.

    Raises:
        InputError: There is no such world, mapper or sensor.
    """
    done: dict[int, list[Outcome]] = {}
    results = run_parallel(PairedTrialsRunner(), enumerate(planned), min(jobs, len(planned)))
    with closing(results):
        for result in results:
            if isinstance(result, InputError):
                raise result
            number, outcomes = result
            done[number] = outcomes
            on_done(len(done))
    rows: dict[TableRow, list[Outcome]] = {}
    references: dict[TableRow, TableRow] = {}
    for number, paired in enumerate(planned):
        for row, outcome in zip(paired.rows, done[number], strict=True):
            rows.setdefault(row, []).append(outcome)
            references[row] = paired.rows[0]
    return {
        row: {**summarise(outcomes), **_difference(row, outcomes, rows[references[row]])}
        for row, outcomes in rows.items()
    }


def _difference(
    row: TableRow, outcomes: Sequence[Outcome], others: Sequence[Outcome]
) -> dict[str, Any]:
    """Return the difference from the first agent of the comparison; nothing for that one."""
    if outcomes is others:
        return {}
    found = paired_differences(outcomes, others).get(row.figure)
    if found is None:
        return {}
    return {"difference": found["mean"], "difference_ci95": found["ci95"]}
