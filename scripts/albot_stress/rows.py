"""The rows of a stress run: an episode each, from which its outcome is made again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from albot_agents.engine.rows import Row
from albot_core.errors import InputError
from albot_stress.episodes import Episode, Outcome, Violation

COLUMNS = {
    "world": "string", "seed": "uint64", "agent": "string", "mapper": "string",
    "odometer": "string", "faults": "string", "steps": "int64", "violations": "json",
}  # fmt: skip
"""The columns; `violations` lists step, invariant and what is wrong."""
_EPISODE = ("world", "seed", "agent", "mapper", "odometer", "faults")


def episode_key(episode: Episode) -> tuple[Any, ...]:
    """Return what tells an episode from the others of a campaign."""
    fields = tuple(getattr(episode, name) for name in _EPISODE)
    return (*fields, repr(episode.mapper_config))


def row_of(outcome: Outcome) -> Row:
    """Return the row of an episode."""
    row = {name: getattr(outcome.episode, name) for name in _EPISODE}
    found = [[each.step, each.invariant, each.what] for each in outcome.violations]
    return row | {"steps": outcome.steps, "violations": found}


def outcome_of(row: Row, episode: Episode, folder: Path) -> Outcome:
    """Return the outcome of an episode, by its row.

    Raises:
        InputError: The row is of another episode, or damaged.
    """
    wanted = [getattr(episode, name) for name in _EPISODE]
    found = [row[name] for name in _EPISODE]
    place = f"row of task {row['number']}"
    if found != wanted:
        raise InputError(folder, f"an episode {wanted}", str(found), place=place)
    try:
        violations = tuple(
            Violation(episode=episode, step=int(step), invariant=str(invariant), what=str(what))
            for step, invariant, what in row["violations"]
        )
        steps = int(row["steps"])
    except (TypeError, ValueError) as error:
        raise InputError(folder, "what makes an outcome", str(error), place=place) from None
    return Outcome(episode=episode, steps=steps, violations=violations)
