"""`albot train`: train an agent for a task."""

from __future__ import annotations

import importlib.util
import json
import math
import shlex
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_agents.engine.choice import LOCAL, make_engine
from albot_cli import completion
from albot_cli.engine_options import ADDRESS, ENGINE
from albot_cli.number_types import CountType
from albot_cli.outputs import JSON, check_folder
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_cli.robots import robot_option
from albot_cli.signals import STOPPED
from albot_cli.train_seeds import seeds_as_text, train_with_seeds
from albot_cli.train_sweep import sweep_as_text, train_sweep
from albot_core.errors import InputError
from albot_env.vector import TRAINING_EXTRA
from albot_env.vector.spinning import spin_briefly

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from albot_agents.training.plan import TrainingPlan
    from albot_agents.training.run_files import RunFolder
    from albot_agents.training.seed_folder import SeedFolder, SeedRun
    from albot_agents.training.sweep_folder import SweepFolder

    Sweep = tuple[SweepFolder, TrainingPlan, dict[int, SeedRun]]

_EVERY = 10.0
"""Time between two progress lines (s)."""
_NEEDED = ("sb3_contrib", "stable_baselines3", "tensorboard", "torch")
_RUNS = Path("runs")
_SUFFIXES = (".yml", ".yaml")
"""Suffixes of plans, which distinguish them from tasks."""
_LARGEST_SEED = 2**32 - 1
"""The same value as a plan's, whose module is slow to load."""
_FOLDER = PathType(file_okay=False)


@click.command()
@click.argument(
    "task",
    required=False,
    metavar="[TASK|PLAN]",
    shell_complete=completion.tasks_or_files,
)
@click.option(
    "--config",
    type=PathType(dir_okay=False),
    help="The plan, a YAML file, where TASK is given too.  [default: the one that comes with it]",
)
@click.option(
    "--print-plan",
    is_flag=True,
    help="Print the plan as YAML, every parameter with its meaning and range, and do not train.",
)
@click.option("--out", type=_FOLDER, help="Folder of the run.  [default: runs/TASK-ALGORITHM-N]")
@click.option("--resume", type=_FOLDER, help="Continue the run in this folder.")
@click.option(
    "--seed",
    type=CountType(0, _LARGEST_SEED),
    help="A whole number from 0 to 2³² − 1.  [default: the plan's]",
)
@click.option(
    "--seeds",
    metavar="A..B",
    help="Train with each of these seeds, both included, or those of a list as 0,3,7: a run each "
    "in a folder below --out, and one learning curve with its spread.",
)
@click.option(
    "--jobs",
    type=CountType(1),
    help="Runs of --seeds at a time, a process for each.  [default: 1; with --engine ray, one a "
    "core]",
)
@ENGINE
@ADDRESS
@click.option(
    "--steps", type=CountType(1), help="Samples in all.  [default: the plan's n_timesteps]"
)
@robot_option
@click.option(
    "--quiet",
    is_flag=True,
    help="Print no progress lines if stderr is not a terminal.",
)
@JSON
def command(
    task: str | None,
    config: Path | None,
    print_plan: bool,
    out: Path | None,
    resume: Path | None,
    seed: int | None,
    seeds: str | None,
    jobs: int | None,
    engine: str,
    address: str | None,
    steps: int | None,
    robot: str | None,
    quiet: bool,
    as_json: bool,
) -> int:
    """Train an agent for TASK, such as homing (or Albot/Homing-v0), or by a PLAN, a YAML file.

    Needs the extra `train`: pip install -c constraints.txt '.[train]' in a clone.

    The run's folder holds everything needed to resume: a run that is killed and continued with
    --resume loses at most the samples after the last checkpoint. Ctrl-C writes a checkpoint and
    ends with exit status 130. best.albot and last.albot in the folder are agents for
    `albot evaluate --agent FILE`.

    With --seeds, --resume FOLDER continues all runs that have not come to their end. Ctrl-C stops
    each after its update; a second one stops them at once. With --engine ray they are tasks of a
    cluster whose nodes share --out, and Ctrl-C stops all at once, with their last checkpoints.

    A PLAN with a `sweep` needs --engine ray: its trials are tasks of the cluster, a run each in a
    folder below --out, and Ray Tune ends the worse ones early.
    """
    if task is not None and (file := Path(task)).suffix in _SUFFIXES:
        if config is not None:
            raise InputError("--config", f"no such option beside the plan {file}", str(config))
        task, config = None, file
    if seed is not None and seeds is not None:
        raise InputError("--seed", "no such option with --seeds", str(seed))
    if print_plan:
        if seeds is not None:
            raise InputError("--seeds", "no such option with --print-plan; --seed", seeds)
        if jobs is not None:
            raise InputError("--jobs", "no such option with --print-plan", str(jobs))
        _print_plan(task, config, resume, seed, steps, robot, as_json)
        return 0
    _check_installed()
    spin_briefly()
    every = math.inf if quiet else _EVERY
    if resume is not None:
        _check_alone(config, out, seed, seeds, robot)
    if seeds is not None or _has_seeds(resume):
        is_local = engine == LOCAL
        with make_engine(engine, jobs or (1 if is_local else None), address) as made:
            made.start()  # Where there is no cluster, no folder is made.
            with _seeds(task, config, out, resume, seeds, steps, robot) as (found, runs):
                result = train_with_seeds(found, runs, made, every)
        return _tell(result, seeds_as_text, as_json)
    plan = None if resume is not None else _read_plan(task, config, seed, steps, robot)
    if _has_trials(resume) if plan is None else plan.sweep is not None:
        _check_sweep(engine, steps if resume is not None else None)
        with make_engine(engine, jobs, address) as made:
            made.start()
            with _sweep(plan, task, config, out, resume) as sweep:
                result = train_sweep(*sweep, made, every)
        return _tell(result, sweep_as_text, as_json)
    _check_single(jobs, engine, address)
    with _run(plan, task, out, resume, steps) as run:
        result = _train(*run, every)
    return _tell(result, _as_text, as_json)


def _tell(result: dict[str, Any], as_text: Callable[[dict[str, Any]], str], as_json: bool) -> int:
    """Print the outcome; return the exit status."""
    click.echo(json.dumps(result) if as_json else as_text(result))
    return STOPPED if result["stopped"] else 0


def _check_sweep(engine: str, steps: int | None) -> None:
    """Raise InputError if an option is missing that a sweep needs, or is given in vain."""
    if engine == LOCAL:
        raise InputError("--engine", "ray, for the trials of the plan's sweep", engine)
    if steps is not None:
        expected = "no such option with the --resume of a sweep, whose trials have equal ones"
        raise InputError("--steps", expected, str(steps))


def _check_single(jobs: int | None, engine: str, address: str | None) -> None:
    """Raise InputError if an option is given that several runs need."""
    for name, given in {"--jobs": jobs, "--address": address}.items():
        if given is not None:
            raise InputError(name, "no such option without --seeds or a sweep", str(given))
    if engine != LOCAL:
        raise InputError("--engine", "--seeds or a sweep, whose runs are the tasks", engine)


def _check_installed() -> None:
    missing = [name for name in _NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        expected = f"the packages of the extra `train` ({TRAINING_EXTRA})"
        raise InputError("albot train", expected, f"no {', '.join(missing)}")


def _print_plan(
    task: str | None,
    config: Path | None,
    resume: Path | None,
    seed: int | None,
    steps: int | None,
    robot: str | None,
    as_json: bool,
) -> None:
    from albot_agents.training.plan_file import plan_text
    from albot_core.plain_data import to_plain

    if resume is not None:
        expected = "no such option with --print-plan: the run's plan is its config.yml"
        raise InputError("--resume", expected, str(resume))
    plan = _read_plan(task, config, seed, steps, robot, tried=False)
    click.echo(json.dumps(to_plain(plan)) + "\n" if as_json else plan_text(plan), nl=False)


def _read_plan(
    task: str | None,
    config: Path | None,
    seed: int | None,
    steps: int | None,
    robot: str | None,
    *,
    tried: bool = True,
) -> TrainingPlan:
    """Read the plan of a new run; `tried` as for `read_plan`."""
    from albot_agents.task import find_task
    from albot_agents.training.plan_file import read_plan, shipped_plan

    task = None if task is None else find_task(task)
    changes: dict[str, Any] = {"seed": seed, "n_timesteps": steps, "robot": robot}
    if config is not None:
        return read_plan(config, task, tried=tried, **changes)
    if task is None:
        raise InputError("albot train", "a TASK, a PLAN or --resume", "none")
    return shipped_plan(task, tried=tried, **changes)


@contextmanager
def _run(
    plan: TrainingPlan | None,
    task: str | None,
    out: Path | None,
    resume: Path | None,
    steps: int | None,
) -> Iterator[tuple[RunFolder, TrainingPlan]]:
    """Make the folder of a new run, or find one; yield it and its plan, for this process alone."""
    from albot_agents.task import find_task
    from albot_agents.training.run_files import RunFolder

    if plan is not None:
        folder = RunFolder(_new_folder(plan, out))
        folder.begin(plan, _command(sys.argv[1:]))
        with folder.locked():
            yield folder, plan
        return
    assert resume is not None
    folder = RunFolder(resume)
    task = None if task is None else find_task(task)
    with folder.locked():
        yield folder, folder.resume(task, n_timesteps=steps)


@contextmanager
def _sweep(
    plan: TrainingPlan | None,
    task: str | None,
    config: Path | None,
    out: Path | None,
    resume: Path | None,
) -> Iterator[Sweep]:
    """Make the folder of a sweep, or find one; yield it, its plan and the run of each trial.

    They are for this process alone.
    """
    from albot_agents.task import find_task
    from albot_agents.training.sweep_folder import SweepFolder

    if plan is not None:
        assert config is not None  # No plan of the project's has a sweep.
        folder = SweepFolder(_new_folder(plan, out))
        runs = folder.begin(plan, _command(sys.argv[1:]), config)
        with folder.locked():
            yield folder, plan, runs
        return
    assert resume is not None
    folder = SweepFolder(resume)
    task = None if task is None else find_task(task)
    with folder.locked():
        yield folder, *folder.resume(task)


def _new_folder(plan: TrainingPlan, out: Path | None) -> Path:
    """Return the folder for a new run, or for those of a sweep, after checking it."""
    from albot_agents.training.run_files import free_folder

    out = free_folder(_RUNS, plan) if out is None else out
    check_folder(out)
    if _has_seeds(out) or _has_trials(out):
        expected = f"a folder without runs (or --resume {out})"
        raise InputError(out, expected, "those of several seeds or trials")
    return out


def _check_alone(
    config: Path | None, out: Path | None, seed: int | None, seeds: str | None, robot: str | None
) -> None:
    """Raise InputError if an option is given that a run which is resumed has already."""
    fixed = {"--config": config, "--out": out, "--seed": seed, "--seeds": seeds, "--robot": robot}
    for name, value in fixed.items():
        if value is not None:
            raise InputError(name, "no such option with --resume", str(value))


def _has_seeds(folder: Path | None) -> bool:
    """Return whether a folder holds the runs of several seeds."""
    from albot_agents.training.seed_folder import SeedFolder

    return folder is not None and SeedFolder(folder).seeds.is_file()


def _has_trials(folder: Path | None) -> bool:
    """Return whether a folder holds the runs of a sweep."""
    from albot_agents.training.sweep_folder import SweepFolder

    return folder is not None and SweepFolder(folder).trials.is_file()


@contextmanager
def _seeds(
    task: str | None,
    config: Path | None,
    out: Path | None,
    resume: Path | None,
    seeds: str | None,
    steps: int | None,
    robot: str | None,
) -> Iterator[tuple[SeedFolder, dict[int, SeedRun]]]:
    """Make or find the folder of several seeds; yield it and the run of each seed.

    They are for this process alone.
    """
    from albot_agents.task import find_task
    from albot_agents.training.seed_folder import SeedFolder, parse_seed_list

    if resume is not None:
        task = None if task is None else find_task(task)
        folder = SeedFolder(resume)
        with folder.locked():
            yield folder, folder.resume(task, n_timesteps=steps)
        return
    chosen = parse_seed_list(seeds or "")
    plan = _read_plan(task, config, None, steps, robot)
    if plan.sweep is not None:
        raise InputError("--seeds", "no such option with a plan that has a sweep", seeds or "")
    folder = SeedFolder(_new_folder(plan, out))
    runs = folder.begin(plan, chosen, _command(sys.argv[1:]))
    with folder.locked():
        yield folder, runs


def _train(folder: RunFolder, plan: TrainingPlan, every: float) -> dict[str, Any]:
    """Train and return the outcome. Without a terminal, print a line every `every` seconds."""
    from albot_agents.training.run import TrainingRun

    def warn(text: str) -> None:
        click.echo(f"albot: {text}", err=True)

    run = TrainingRun(folder, plan, warn)
    title, start = f"train {plan.task}", run.learner.num_timesteps
    with progress(title, plan.n_timesteps, "samples", start=start, every=every) as update:
        return run.run(update)


def _as_text(result: dict[str, Any]) -> str:
    """Return the result as text."""
    lines = [
        f"{result['task']} with {result['algorithm']}, seed {result['seed']}: "
        f"{result['samples']:,} samples, {result['episodes']:,} episodes, "
        f"{result['seconds']:.0f} s ({result['samples_per_second']:,.0f} samples/s)"
        + (", stopped before the end" if result["stopped"] else "")
    ]
    figures = {
        name: {key: value for key, value in result[kind].items() if key != "samples"}
        for name, kind in (("cloning", "pretraining"), ("claims", "claims"))
    }
    figures |= {"training": {"success_rate": result["success_rate"]}}
    figures |= {"evaluation": result["evaluation"]}
    for name, found in figures.items():
        known = [f"{key} {value:.2f}" for key, value in found.items() if value is not None]
        if known:
            lines.append(f"  {name:<10} {', '.join(known)}")
    lines += [f"  {name:<10} {path}" for name, path in result["files"].items()]
    if result["checkpoint"]:
        lines.append(f"  {'checkpoint':<10} {result['checkpoint']}")
    if result["stopped"]:
        lines.append(f"  continue with: albot train --resume {shlex.quote(result['folder'])}")
    return "\n".join(lines)


def _command(words: list[str]) -> str:
    """Return the command line without `--out`, which matters only on this machine."""
    kept, rest = ["albot"], iter(words)
    for word in rest:
        if word == "--out":
            next(rest, None)
        elif not word.startswith("--out="):
            kept.append(word)
    return shlex.join(kept)
