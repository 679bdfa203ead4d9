"""The rows of an evaluation: an episode each, from which its outcome is made again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from albot_agents.benchmark.cell import single_values
from albot_agents.engine.rows import Row, plain_value, value_of
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import Outcome
from albot_core.errors import InputError

COLUMNS = {
    "agent": "string", "world": "string", "seed": "uint64", "steps": "int64", "driven_m": "double",
    "collisions": "int64", "rooms": "int64", "coverage_auc": "double", "info": "json",
    "outcome": "json",
}  # fmt: skip
"""The columns. `info` has the single values of the last info; `outcome` is what makes the outcome
again, to the last bit."""
_ARRAYS = ("start", "begin", "path", "coverage_curve")


def row_of(outcome: Outcome) -> Row:
    """Return the row of an episode, without its recording and its transitions."""
    whole = {name: plain_value(getattr(outcome, name)) for name in _ARRAYS}
    whole |= {"info": plain_value(outcome.info)}
    return {
        "agent": outcome.agent,
        "world": outcome.world,
        "seed": outcome.seed,
        "steps": len(outcome.path) - 1,
        "driven_m": outcome.driven,
        "collisions": int(outcome.collisions),
        "rooms": outcome.rooms,
        "coverage_auc": outcome.coverage_auc,
        "info": single_values(outcome.info),
        "outcome": whole,
    }


def outcome_of(row: Row, trial: Trial, folder: Path) -> Outcome:
    """Return the outcome of an episode, by its row.

    Raises:
        InputError: The row is of another episode, or damaged.
    """
    wanted = trial.agent, trial.world, trial.seed
    found = row["agent"], row["world"], row["seed"]
    place = f"row of task {row['number']}"
    if found != wanted:
        said = ", ".join(map(str, found))
        raise InputError(folder, ", ".join(map(str, wanted)), said, place=place)
    try:
        whole = {name: value_of(plain) for name, plain in row["outcome"].items()}
        arrays: dict[str, Any] = {name: np.asarray(whole[name], np.float64) for name in _ARRAYS}
        info = dict(whole["info"])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(folder, "what makes an outcome", str(error), place=place) from None
    return Outcome(
        trial=trial, info=info, collisions=row["collisions"], rooms=row["rooms"], **arrays
    )
