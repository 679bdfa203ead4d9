"""The recorded episodes of `albot evaluate --record`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.recordings import EPISODE, PAGE, Recordings
from albot_agents.evaluation.trial import Outcome
from albot_cli.evaluation_page import INDEX, index_page
from albot_cli.outputs import check_folder
from albot_core.counts import many
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_core.interrupts import interrupts_deferred


def plan_recordings(
    record: Path | None,
    only: str | None,
    batch: int,
    trials: Sequence[Sequence[Trial]],
    judges_success: bool,
    force: bool,
) -> Recordings | None:
    """Return where the episodes are recorded; None if they are not.

    Args:
        record: The folder.
        only: Which episodes are kept; None for all.
        batch: Number of episodes that a process steps together.
        trials: The trials of each agent.
        judges_success: Whether their task can succeed.
        force: Whether existing files are overwritten.

    Raises:
        InputError: There are no episodes from which `only` could choose, they would be stepped
            together, or a file exists.
    """
    if only is not None and record is None:
        raise InputError("--only", "--record FOLDER, of whose episodes it keeps some", "none")
    if only is not None and not judges_success:
        raise InputError("--only", "a task that can succeed or fail", trials[0][0].task)
    if record is None:
        return None
    if batch > 1:
        raise InputError("--batch", "1 with --record", str(batch))
    recordings = Recordings.plan(record, [trial for some in trials for trial in some], only)
    files = (f"{name}{end}" for name in recordings.names.values() for end in (EPISODE, PAGE))
    check_folder(record, (INDEX, *files), force=force)
    return recordings


def remove_recordings(recordings: Recordings | None, trials: list[Trial]) -> None:
    """Remove the recordings of trials, and what ended processes have left of pages."""
    if recordings is not None:
        with interrupts_deferred():
            recordings.remove(trials)
            recordings.remove_left_overs()


def write_index(
    recordings: Recordings | None, facts: Mapping[str, Any], outcomes: Sequence[Sequence[Outcome]]
) -> dict[str, Any]:
    """Write the page that lists the recorded episodes; return how many, and its path.

    Args:
        recordings: Where the episodes are; None if they were not recorded.
        facts: The figures of the evaluation.
        outcomes: The episodes of each agent.
    """
    if recordings is None:
        return {"recorded": None}
    every = [outcome for some in outcomes for outcome in some]
    kept = sum(outcome.recording is not None for outcome in every)
    index, title = recordings.folder / INDEX, f"{facts['agent']} in {facts['task']}"
    notes = [f"worlds {', '.join(facts['world_specs'])}, seeds {facts['seeds']}"]
    notes[0] += f", mapper {facts['mapper']}, odometer {facts['odometer']}"
    if facts["success_rate"] is not None:
        low, high = facts["ci95"]
        share = f"success {facts['success_rate']:.0%} (95 %: {low:.0%} to {high:.0%})"
        notes.append(f"{share} in {many(facts['episodes'], 'episode')}")
    write_text(index, index_page(title, notes, every))
    return {"recorded": kept, "files": {"index": str(index)}}
