"""Checks of the files that an interrupted or killed run of the command has left."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from albot_agents.benchmark.folder import ResultsFolder
from albot_agents.engine.rows import NUMBER, Row, read_rows
from albot_agents.evaluation import outcome_rows
from albot_agents.trained.agent_file import read_agent
from albot_agents.training.checkpoint import checkpoints, read_checkpoint
from albot_agents.training.plan_file import read_plan
from albot_agents.training.run_files import RunFolder
from albot_core.errors import InputError
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import CHUNK_MOMENTS
from albot_stress import rows as stress_rows

OURS = {".out", ".err", ".tmp", "plan.yml"}
"""Files that were in the folder before, and the run's output."""


_COLUMNS = {"evaluate": outcome_rows.COLUMNS, "stress": stress_rows.COLUMNS}
"""Columns of the rows of each command that keeps some."""


class BrokenPromiseError(Exception):
    """A promise of docs/reliability.md is broken."""


def check_quiet(folder: Path, status: int, number: int) -> dict[str, int]:
    """Raise BrokenPromiseError if a signal ended a run with a traceback or an odd status.

    Returns:
        Whether the signal came before Python had reached our first line.
    """
    errors = (folder / ".err").read_text()
    if "Traceback" in errors or "ignored" in errors:
        if "albot_" in errors:
            raise BrokenPromiseError(f"says {errors}")
        return {"before us": 1}
    # Before the work begins, and after its end, the signal itself ends the process.
    if status not in (-number, 128 + number):
        raise BrokenPromiseError(f"status {status} after signal {number}: {errors}")
    return {}


def check_run(command: str, folder: Path, killed: bool, moments: int | None) -> dict[str, int]:
    """Raise BrokenPromiseError if a run's files are not as promised.

    Args:
        command: The subcommand.
        folder: The folder in which it ran.
        killed: Whether it was killed, and could not tidy up.
        moments: Number of moments that an episode's recorder was given, or of rows that were
            written, if known.

    Returns:
        The counts: whole files, temporary files left behind, moments lost, rows kept.
    """
    hidden = [path for path in folder.rglob("*") if path.name.startswith(".")]
    left = [path for path in (*hidden, *(folder / ".tmp").iterdir()) if path.name not in OURS]
    if left and not killed:
        raise BrokenPromiseError(f"leaves {', '.join(path.name for path in left)}")
    facts = {"left": len(left), "files": 0}
    check = _CHECKS.get(command)
    try:
        if check is not None:
            facts |= check(folder, killed, moments)
    except (InputError, ValueError, KeyError, OSError) as error:
        raise BrokenPromiseError(f"{type(error).__name__}: {error}") from error
    facts["files"] = sum(path.is_file() and path.name not in OURS for path in folder.rglob("*"))
    return facts


def _check_play(folder: Path, killed: bool, moments: int | None) -> dict[str, int]:
    picture, episode = folder / "episode.png", folder / "episode.mcap"
    if picture.exists() and not picture.read_bytes().endswith(b"IEND\xaeB`\x82"):
        raise BrokenPromiseError("half a picture")
    if not episode.exists():
        return {}
    try:
        reader = EpisodeReader(episode)
        kept = len(list(reader.moments()))
    except InputError:
        if killed and not moments:
            return {"before the header": 1}
        raise
    if reader.torn and not killed:
        raise BrokenPromiseError("an episode that was never closed")
    lost = max(0, (moments or 0) - kept)
    if lost >= (CHUNK_MOMENTS if killed else 1):
        raise BrokenPromiseError(f"{lost} of {moments} moments lost")
    return {"lost": lost, "torn": int(reader.torn)}


def _check_train(folder: Path, killed: bool, moments: int | None) -> dict[str, int]:
    run = RunFolder(folder / "run")
    if run.versions.exists():
        json.loads(run.versions.read_text())
    if run.plan.exists():
        read_plan(run.plan, saved=True)
    if run.monitor.exists():
        lines = run.monitor.read_bytes()
        # A killed run may have been writing; resuming cuts off what follows a checkpoint.
        if not lines.endswith(b"\n") and not killed:
            raise BrokenPromiseError("half a line in the log of episodes")
    if run.evaluations.exists():
        with np.load(run.evaluations) as arrays:
            _ = [arrays[name] for name in arrays]
    for agent in (run.best, run.last):
        if agent.exists():
            read_agent(agent)
    for path in checkpoints(run.checkpoints):
        read_checkpoint(path)
    return {}


def _check_evaluate(folder: Path, killed: bool, moments: int | None) -> dict[str, int]:
    figures = folder / "out" / "evaluation.json"
    said = (folder / ".out").read_text()
    if figures.exists():
        json.loads(figures.read_text())["success_rate"]
    elif said:
        raise BrokenPromiseError("figures told and not written")
    return _check_rows("evaluate", folder, moments)


def _check_results(folder: Path, killed: bool, moments: int | None) -> dict[str, int]:
    results = ResultsFolder(folder / "results")
    kept = sum(len(cell.episodes) for cell in results.read())
    page, figures = results.path / "results.md", results.path / "results.json"
    if figures.exists():
        rows = json.loads(figures.read_text())["rows"]
        if sum(row["episodes"] for row in rows) > kept:
            raise BrokenPromiseError("figures of episodes that were not kept")
    if page.exists() and not figures.exists():
        raise BrokenPromiseError("a page without its figures")
    return {}


def _check_stress(folder: Path, killed: bool, moments: int | None) -> dict[str, int]:
    said = (folder / ".out").read_text()
    if said and json.loads(said)["violations"]:
        raise BrokenPromiseError("violations")
    return _check_rows("stress", folder, moments)


def _check_rows(command: str, folder: Path, written: int | None) -> dict[str, int]:
    """Check that each row is there that was written before the signal."""
    kept = len(rows_of(command, folder / "rows"))
    if kept < (written or 0):
        raise BrokenPromiseError(f"{written} rows written, and {kept} kept")
    return {"rows": kept}


def rows_of(command: str, folder: Path) -> list[Row]:
    """Return the rows of a run in order, each once; none if the folder is not there.

    Args:
        command: The subcommand.
        folder: The folder of its rows.

    Raises:
        InputError: A file is damaged.
    """
    if command not in _COLUMNS or not folder.is_dir():
        return []
    rows = {row[NUMBER]: row for row in read_rows(folder, _COLUMNS[command])}
    return [rows[number] for number in sorted(rows)]


_CHECKS: Mapping[str, Callable[[Path, bool, int | None], dict[str, int]]] = {
    "play": _check_play,
    "train": _check_train,
    "evaluate": _check_evaluate,
    "results": _check_results,
    "stress": _check_stress,
}
