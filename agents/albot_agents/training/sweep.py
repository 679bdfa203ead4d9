"""Run the trials of a sweep on a Ray cluster: Ray Tune begins them and ends the worse ones early.

The folders of the runs must be the same for all nodes, as on a shared file system. Ray Tune's own
state is thrown away: a sweep that is resumed tells a new scheduler all evaluations that there were.
"""

from __future__ import annotations

import logging
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import albot_env
from albot_agents.engine.engine import RERUNS, Engine, name_error
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
_ERROR = "error"
"""What a trial that cannot go on tells in its last result."""


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
        InputError: No cluster answers, or the folder cannot be written.
    """
    assert plan.sweep is not None
    os.environ.update(_SETTINGS)  # Read when Ray Tune is imported.
    # It warns that its folder has no results, which are in the folders of the runs, and prints the
    # tracebacks of errors, which are told in a line.
    logging.getLogger("ray.tune").setLevel(logging.CRITICAL)
    engine.start()
    from ray import tune

    metric = plan.sweep.metric
    over = frozenset(folder.ended)
    shared = _Shared(str(Path.cwd()), albot_env.__version__, metric, over)
    work = tune.with_resources(partial(_train, shared, dict(runs)), {"cpu": 1})
    notes = _Notes(folder, plan, reporter)
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
                callbacks=[_callback(notes)],
                verbose=0,
            ),
        )
        try:
            tuner.fit()
        except KeyboardInterrupt:
            engine.close()  # Otherwise the trials would go on.
            return notes.errors, True
    if notes.fault is not None:
        raise notes.fault
    return notes.errors, False


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
    """Train in the process of a trial; tell Ray Tune of each evaluation, or of the error."""
    from ray import tune

    try:
        _train_trial(shared, runs, int(config["trial"]))
    except Exception as error:  # noqa: BLE001  (Ray Tune would run it again, to no avail)
        said = str(error) if isinstance(error, InputError) else name_error(error)
        tune.report({"samples": 0, shared.metric: -math.inf, _ERROR: said})


def _train_trial(shared: _Shared, runs: Mapping[int, SeedRun], trial: int) -> None:
    """Train; tell Ray Tune of each evaluation.

    Raises:
        InputError: The training cannot go on.
    """
    from ray import tune

    from albot_agents.training.run import TrainingRun  # Slow to load: PyTorch.

    enter_node(shared.folder, shared.version)
    folder, plan = runs[trial]
    told = 0

    def tell(curve: Mapping[str, list[float]]) -> None:
        nonlocal told
        samples = curve.get("samples", [])
        while told < len(samples):
            told += 1
            figures = {name: values[told - 1] for name, values in curve.items()}
            tune.report(figures)

    if trial in shared.over or folder.is_finished(plan):
        tell(folder.curve)
        return
    with folder.locked():
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


class _Notes:
    """Tells of progress and errors, and notes which trials the scheduler has ended.

    Args:
        folder: The folder of the sweep.
        plan: Its plan.
        reporter: Receives the progress.
    """

    def __init__(self, folder: SweepFolder, plan: TrainingPlan, reporter: Reporter) -> None:
        assert plan.sweep is not None
        self._folder, self._whole, self._reporter = folder, plan.n_timesteps, reporter
        self._metric = plan.sweep.metric
        self._samples: dict[int, int] = {}
        self._best: tuple[float, int] | None = None
        self._failed: set[int] = set()
        self.errors: dict[int, str] = {}
        """What went wrong, by trial."""
        self.fault: Exception | None = None
        """Why the folder could not be written; None if it could."""

    def add(self, trial: int, result: Mapping[str, Any]) -> None:
        """Note an evaluation of a trial, or that it cannot go on."""
        if _ERROR in result:
            self._failed.add(trial)
            self.fail(trial, result[_ERROR])
            return
        score = result[self._metric], -trial
        self._samples[trial] = int(result["samples"])
        self._best = score if self._best is None else max(self._best, score)
        self._report()

    def end(self, trial: int) -> None:
        """Note that a trial has come to its end or was ended by the scheduler."""
        if trial in self._failed:
            return
        self.errors.pop(trial, None)  # It died, and was run again.
        if self._samples.get(trial, 0) < self._whole:
            try:
                self._folder.end(trial)
            except (InputError, OSError) as error:
                self.fault = error  # Ray Tune would take it for one of the trial.
        self._samples[trial] = self._whole
        self._report()

    def fail(self, trial: int, said: str) -> None:
        """Note that a trial cannot go on, or that its process died."""
        if trial not in self.errors:
            self.errors[trial] = said
            self._reporter.warn(f"trial {trial}: {said}")

    def _report(self) -> None:
        note = ""
        if self._best is not None:
            note = f"best {self._metric} {self._best[0]:.2f}, trial {-self._best[1]}"
        self._reporter.progress(sum(self._samples.values()), note)


def _callback(notes: _Notes) -> Any:
    """Return what Ray Tune calls."""
    from ray import tune

    class Told(tune.Callback):
        """Hands on what Ray Tune tells."""

        def on_trial_result(
            self, iteration: int, trials: Any, trial: Any, result: dict[str, Any], **info: Any
        ) -> None:
            notes.add(trial.config["trial"], result)

        def on_trial_complete(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
            notes.end(trial.config["trial"])

        def on_trial_error(self, iteration: int, trials: Any, trial: Any, **info: Any) -> None:
            notes.fail(trial.config["trial"], _told_error(trial))

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
