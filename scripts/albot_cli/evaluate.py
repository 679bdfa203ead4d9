"""`albot evaluate`: measure an agent in many episodes of a task."""

from __future__ import annotations

import json
import os
import re
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_cli.mappers import mapper_config_option, read_robots_config
from albot_cli.outputs import FORCE, check_folder, filled_folder
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_cli.signals import STOPPED
from albot_core.counts import many
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_agents.evaluation.plan import Trial
    from albot_agents.evaluation.trial import Outcome

_FIGURES, _PICTURE = "evaluation.json", "failures.png"


@click.command()
@click.argument("task")
@click.option("--agent", required=True, help="See `albot agents list`.")
@click.option(
    "--worlds",
    multiple=True,
    default=("random:office",),
    show_default=True,
    metavar="SPEC",
    help="random:KIND (each seed is a world), a name, a file, or a pattern of files; repeatable.",
)
@click.option(
    "--seeds", default="1000..1019", show_default=True, metavar="A..B", help="Both included."
)
@click.option("--mapper", help="See `albot mappers`; or none.  [default: the agent's own]")
@mapper_config_option
@click.option(
    "--odometer",
    "--noise",
    default="pioneer",
    show_default=True,
    help="ideal, pioneer, poor, carpet, stage, albot1-disturbed, bias-1.5, bias-3 or bias-6.",
)
@click.option(
    "--outward",
    metavar="A..B",
    help="Length of the outward journey, in metres.  [default: 30..100]",
)
@click.option("--steps", type=click.IntRange(1), help="Time limit.  [default: the task's]")
@click.option("--jobs", type=click.IntRange(1), help="Processes.  [default: one a core]")
@click.option(
    "--out",
    type=PathType(file_okay=False),
    help="Folder for evaluation.json and, of tasks that can succeed, a picture of the failures.",
)
@FORCE
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def command(
    task: str,
    agent: str,
    worlds: tuple[str, ...],
    seeds: str,
    mapper: str | None,
    mapper_config: Path | None,
    odometer: str,
    outward: str | None,
    steps: int | None,
    jobs: int | None,
    out: Path | None,
    force: bool,
    as_json: bool,
) -> int:
    """Run an agent through many episodes of TASK, such as homing (or Albot/Homing-v0).

    The figures are: success with its 95 % Wilson interval, success weighted by path length (SPL,
    mean and median, with bootstrapped 95 % intervals), and the final distance from home. If Ctrl-C
    stops it, the exit status is 130 and the figures are those of the episodes so far.
    """
    from albot_agents.evaluation.plan import parse_seeds, plan_trials
    from albot_agents.registry import check_agent, find_agent
    from albot_agents.task import find_task

    task = find_task(task)
    check_agent(agent, task)
    entry = find_agent(agent)
    settings: dict[str, Any] = {"odometer": odometer}
    if mapper is not None:
        settings["mapper"] = mapper
    if steps is not None:
        settings["max_episode_steps"] = steps
    if outward is not None:
        settings["config"] = _way_out(task, outward)
    if out is not None:
        check_folder(out, (_FIGURES, _PICTURE), force=force)
    mapper_parameters = {} if mapper_config is None else {"mapper_config": mapper_config}
    untrained = entry.untrained_settings(settings | mapper_parameters)
    settings = entry.environment(task, settings)
    inside = settings.get("mapper", entry.mapper)
    if mapper_config is not None:
        settings["mapper_config"] = read_robots_config(inside, mapper_config)
    trials = plan_trials(task, agent, worlds, parse_seeds(seeds), settings)
    trials[0].make().close()  # Invalid settings raise before the work begins.
    for setting in untrained:
        click.echo(f"albot: {agent} was not trained with {setting}", err=True)
    began = time.perf_counter()
    outcomes, stopped = _run(trials, jobs or os.cpu_count() or 1)
    facts: dict[str, Any] = {"task": task, "agent": agent, "mapper": inside, "odometer": odometer}
    facts["mapper_config"] = None if mapper_config is None else str(mapper_config)
    facts["untrained"] = untrained
    facts["fingerprint"] = None if entry.file is None else entry.file.fingerprint
    facts |= {"world_specs": worlds, "seeds": seeds, **_summary(outcomes)}
    facts |= {"seconds": time.perf_counter() - began, "stopped": stopped, "files": {}}
    if out is not None:
        _save(out, facts, outcomes)
    click.echo(json.dumps(facts) if as_json else _as_text(facts))
    return STOPPED if stopped else 0


def _way_out(task: str, text: str) -> Any:
    """Return the task's configuration with an outward journey of length `A..B` (m)."""
    from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
    from albot_env.tasks.homing.task import HomingConfig, HomingTask

    if task != HomingTask.environment:
        raise InputError(
            "--outward", f"{HomingTask.environment}, which has an outward journey", task
        )
    number = r"(\d+(?:\.\d+)?)"
    found = re.fullmatch(rf"{number}\.\.{number}", text)
    if found is None:
        raise InputError("--outward", "A..B in metres, as 30..100", text or "nothing")
    shortest, longest = float(found[1]), float(found[2])
    if longest < shortest:
        raise InputError("--outward", "a range A..B with B at least A", text)
    return HomingConfig(outing=OutwardJourneyConfig(shortest=shortest, longest=longest))


def _run(trials: list[Trial], jobs: int) -> tuple[list[Outcome], bool]:
    """Return the outcomes in the order of the trials, and whether Ctrl-C stopped the run."""
    from albot_agents.evaluation.trial import TrialRunner
    from albot_agents.workers import run_parallel

    done: dict[int, Outcome] = {}
    stopped = False
    numbers = {(trial.world, trial.seed): k for k, trial in enumerate(trials)}
    results = run_parallel(TrialRunner(), trials, min(jobs, len(trials)))
    try:
        with progress("evaluate", len(trials), "episodes") as update, closing(results):
            for outcome in results:
                if isinstance(outcome, InputError):
                    raise outcome
                done[numbers[outcome.trial.world, outcome.trial.seed]] = outcome
                update(len(done))
    except KeyboardInterrupt:
        stopped = True
    return [done[k] for k in sorted(done)], stopped


def _summary(outcomes: list[Outcome]) -> dict[str, Any]:
    from albot_agents.evaluation.summary import summarise

    return summarise(outcomes)


def _save(out: Path, facts: dict[str, Any], outcomes: list[Outcome]) -> None:
    """Write the figures and the picture; add their paths to `facts`."""
    from albot_core.files import write_text

    facts["files"]["figures"] = str(out / _FIGURES)
    with filled_folder(out) as scratch:
        if facts["success_rate"] is not None:
            from albot_agents.evaluation.picture import save_failures

            save_failures(outcomes, scratch / _PICTURE)
            facts["files"]["failures"] = str(out / _PICTURE)
        write_text(scratch / _FIGURES, json.dumps(facts, indent=1))


def _as_text(facts: dict[str, Any]) -> str:
    """Return the figures as text."""
    lines = [
        f"{facts['agent']} in {facts['task']}, {many(facts['episodes'], 'episode')}, mapper "
        f"{facts['mapper']}, odometer {facts['odometer']}, {facts['seconds']:.0f} s"
        + (", stopped before the end" if facts["stopped"] else "")
    ]
    if facts["success_rate"] is not None:
        low, high = facts["ci95"]
        lines.append(f"  success   {facts['success_rate']:.0%}  (95 %: {low:.0%} to {high:.0%})")
    if facts["spl"] is not None:
        spl_low, spl_high = facts["spl_ci95"]
        lines.append(
            f"  SPL       {facts['spl']:.2f}  (95 %: {spl_low:.2f} to {spl_high:.2f}), "
            f"median {facts['spl_median']:.2f}, soft {facts['soft_spl']:.2f}"
        )
    if facts["mean_final_distance_m"] is not None:
        began = facts["mean_initial_distance_m"]
        lines.append(
            f"  from home {facts['mean_final_distance_m']:.1f} m at the end"
            + ("" if began is None else f", {began:.1f} m at the beginning")
        )
    if facts["revisits"] is not None:
        recall, precision = (
            "–" if facts[name] is None else f"{facts[name]:.3f}" for name in ("recall", "precision")
        )
        lines.append(
            f"  places    recall {recall} at precision {precision}, "
            f"of {facts['revisits']} seen again"
        )
    if facts["mean_coverage"] is not None:
        lines.append(
            f"  covered   {facts['mean_coverage']:.0%} of the ground; "
            f"{facts['collisions_per_m'] or 0:.3f} collisions a metre"
        )
    if facts["coverage_auc"] is not None:
        low, high = facts["coverage_auc_ci95"]
        lines.append(
            f"  exploring {facts['coverage_auc']:.3f} covered on average over the first 200 m  "
            f"(95 %: {low:.3f} to {high:.3f})"
        )
    if facts["rooms_share"] is not None:
        low, high = facts["rooms_share_ci95"]
        lines.append(
            f"  rooms     {facts['rooms_share']:.0%} entered  (95 %: {low:.0%} to {high:.0%})"
        )
    lines += [f"  {name:<9} {path}" for name, path in facts["files"].items()]
    return "\n".join(lines)
