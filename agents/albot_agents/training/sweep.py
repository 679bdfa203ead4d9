"""Run the trials of a sweep on a Ray cluster: Ray Tune begins them and ends the worse ones early.

The folders of the runs must be the same for all nodes, as on a shared file system. Ray Tune's own
state is thrown away: a sweep that is resumed tells a new scheduler all evaluations that there were.
"""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import albot_env
from albot_agents.engine.engine import RERUNS, Engine
from albot_agents.engine.ray_cluster import enter_node
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.seed_folder import SeedRun
from albot_agents.training.sweep_folder import SweepFolder
from albot_agents.training.sweep_plan import SweepPlan
from albot_core.errors import InputError

_SETTINGS = {
    "TUNE_DISABLE_AUTO_CALLBACK_LOGGERS": "1",
    "TUNE_DISABLE_SIGINT_HANDLER": "1",
    "TUNE_WARN_EXCESSIVE_EXPERIMENT_CHECKPOINT_SYNC_THRESHOLD_S": "0",
    "RAY_AIR_NEW_OUTPUT": "0",
    "RAY_CHDIR_TO_TRIAL_DIR": "0",
}
"""Ray Tune's switches: Ctrl-C and the folder are ours, and nothing is told of slow disks."""


@runtime_checkable
class Reporter(Protocol):
    """Receives what happens."""

    def progress(self, samples: int, note: str) -> None:
        """Receive the samples of all trials so far; one that was ended counts as whole."""

    def warn(self, text: str) -> None:
        """Tell of a problem that does not stop the sweep."""


def run_sweep(
    folder: SweepFolder,
    plan: TrainingPlan,
    runs: Mapping[int, SeedRun],
    engine: Engine,
    reporter: Reporter,
) -> tuple[dict[int, str], bool]:
    """Run all trials until each has come to its end or was ended by the scheduler, or Ctrl-C.

    An error of one trial does not stop the others. Ctrl-C ends all at once; each goes on from its
    last checkpoint.

    Args:
        folder: The folder of the sweep.
        plan: Its plan.
        runs: The run of each trial.
        engine: The cluster.
        reporter: Receives the progress.

    Returns:
        What went wrong, by trial; and whether Ctrl-C stopped the sweep.

    Raises:
        InputError: No cluster answers.
    """
    assert plan.sweep is not None
    os.environ.update(_SETTINGS)  # Read when Ray Tune is imported.
    # It warns that its folder has no results, which are in the folders of the runs.
    logging.getLogger("ray.tune").setLevel(logging.ERROR)
    engine.start()
    from ray import tune

    metric = plan.sweep.metric
    over = frozenset(folder.ended)
    shared = _Shared(str(Path.cwd()), albot_env.__version__, metric, over)
    work = tune.with_resources(partial(_train, shared, dict(runs)), {"cpu": 1})
    told = _callback(folder, plan, reporter)
    with _scratch(folder.tune):
        tuner = tune.Tuner(
            work,
            param_space={"trial": tune.grid_search(list(runs))},
            tune_config=tune.TuneConfig(
                metric=metric,
                mode="max",
                scheduler=_scheduler(plan.sweep, plan),
                max_concurrent_trials=engine.workers,
                reuse_actors=True,
            ),
            run_config=tune.RunConfig(
                name="sweep",
                storage_path=str(folder.tune.absolute()),
                failure_config=tune.FailureConfig(max_failures=RERUNS),
                callbacks=[told],
                verbose=0,
            ),
        )
        try:
            tuner.fit()
        except KeyboardInterrupt:
            engine.close()  # Otherwise the trials would go on.
            return told.errors, True
    return told.errors, False


@dataclass(frozen=True)
class _Shared:
    """What all trials know."""

    folder: str
    """The folder in which the command was called, for relative paths."""
    version: str
    """The version of albot-env there."""
    metric: str
    """What the scheduler compares."""
    over: frozenset[int]
    """Trials that a scheduler has ended before."""


def _train(shared: _Shared, runs: Mapping[int, SeedRun], config: Mapping[str, Any]) -> None:
    """Train in the process of a trial; tell Ray Tune of each evaluation."""
    from ray import tune

    from albot_agents.training.run import TrainingRun  # Slow to load: PyTorch.

    enter_node(shared.folder, shared.version)
    trial = int(config["trial"])
    folder, plan = runs[trial]
    told = 0

    def tell(curve: Mapping[str, list[float]]) -> None:
        nonlocal told
        samples = curve.get("samples", [])
        if samples and shared.metric not in curve:
            known = [name for name in curve if name != "samples"]
            expected = f"one of what evaluations of {plan.task} give, {', '.join(known)}"
            raise InputError("sweep.metric", expected, shared.metric)
        while told < len(samples):
            told += 1
            figures = {name: values[told - 1] for name, values in curve.items()}
            tune.report(figures)

    if trial in shared.over or folder.is_finished(plan):
        tell(SweepFolder(folder.path.parent, values=[{}] * len(runs)).curve(trial))
        return
    run = TrainingRun(folder, plan)
    tell(run.evaluated)
    run.run(lambda samples, note: tell(run.evaluated))
    tell(run.evaluated)


def _scheduler(sweep: SweepPlan, plan: TrainingPlan) -> Any:
    """Return Ray Tune's scheduler."""
    from ray.tune import schedulers

    assert plan.evaluation is not None
    grace = min(sweep.grace or plan.evaluation.every, plan.n_timesteps)
    if sweep.scheduler == "asha":
        return schedulers.ASHAScheduler(
            time_attr="samples",
            # A trial that has all samples ends by itself.
            max_t=plan.n_timesteps * 2,
            grace_period=grace,
            reduction_factor=sweep.reduction,
        )
    if sweep.scheduler == "median":
        return schedulers.MedianStoppingRule(time_attr="samples", grace_period=grace)
    fifo: Any = schedulers.FIFOScheduler
    return fifo()


def _callback(folder: SweepFolder, plan: TrainingPlan, reporter: Reporter) -> Any:
    """Return what Ray Tune calls; `errors` holds what went wrong, by trial."""
    from ray import tune

    assert plan.sweep is not None
    metric = plan.sweep.metric

    class Told(tune.Callback):
        """Tells of progress and errors, and notes which trials the scheduler has ended."""

        def __init__(self) -> None:
            self.errors: dict[int, str] = {}
            self._samples: dict[int, int] = {}
            self._best: tuple[float, int] | None = None

        def on_trial_result(
            self, iteration: int, trials: Any, trial: Any, result: dict[str, Any], **info: Any
        ) -> None:
            number, score = trial.config["trial"], (result[metric], -trial.config["trial"])
            self._samples[number] = int(result["samples"])
            self._best = score if self._best is None else max(self._best, score)
            self._report()

        def on_trial_complete(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
            number = trial.config["trial"]
            self.errors.pop(number, None)
            if self._samples.get(number, 0) < plan.n_timesteps:
                folder.end(number)
            self._samples[number] = plan.n_timesteps
            self._report()

        def on_trial_error(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
            number = trial.config["trial"]
            if number not in self.errors:
                self.errors[number] = _told_error(trial)
                reporter.warn(f"trial {number}: {self.errors[number]}")

        def _report(self) -> None:
            note = ""
            if self._best is not None:
                note = f"best {metric} {self._best[0]:.2f}, trial {-self._best[1]}"
            reporter.progress(sum(self._samples.values()), note)

    return Told()


def _told_error(trial: Any) -> str:
    """Return why a trial failed, in one line."""
    lines = str(trial.get_error() or "unknown").strip().splitlines()
    return lines[-1].strip()


@contextmanager
def _scratch(path: Path) -> Iterator[None]:
    """Remove a folder before and after the block."""
    shutil.rmtree(path, ignore_errors=True)
    try:
        yield
    finally:
        shutil.rmtree(path, ignore_errors=True)
