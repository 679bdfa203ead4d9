"""Train with several seeds on a Ray cluster, a task each.

The folders of the runs must be the same for all nodes, as on a shared file system. A run whose node
dies goes on elsewhere, from its last checkpoint.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from contextlib import closing
from functools import partial
from typing import Any

from albot_agents.engine.engine import Crash, Engine, OnStep
from albot_agents.training.seed_folder import SeedRun
from albot_agents.training.seed_processes import ProgressReport, Reporter
from albot_core.errors import InputError

_EVERY = 0.5
"""Time between two looks at the messages of the runs (s)."""
_MESSAGES = 1000
"""Largest number of messages that are fetched at a time."""


def train_on_cluster(
    runs: Mapping[int, SeedRun], engine: Engine, reporter: Reporter
) -> tuple[dict[int, Exception], bool]:
    """Train until all runs have ended or Ctrl-C.

    An error of one run does not stop the others. Ctrl-C ends all at once; each goes on from its
    last checkpoint.

    Args:
        runs: The runs by seed.
        engine: The cluster.
        reporter: Receives the progress.

    Returns:
        The errors by seed: an InputError, or a RuntimeError for a bug or a run whose process died
        each time; and whether Ctrl-C stopped the training.

    Raises:
        InputError: No cluster answers.
    """
    engine.start()
    from ray.util.queue import Queue

    queue = Queue(actor_options={"num_cpus": 0})
    errors: dict[int, Exception] = {}
    ended = threading.Event()
    listener = threading.Thread(target=_tell, args=(queue, reporter, ended), daemon=True)
    listener.start()
    stopped = False
    try:
        with closing(engine.run(partial(_train, queue), list(runs.items()))) as results:
            for done in results:
                seed, (folder, _) = done.task
                error = done.result
                if isinstance(error, Crash):
                    errors[seed] = RuntimeError(f"{folder.path}: {error}\n{error.details}")
                elif error is not None:
                    errors[seed] = error
                if seed in errors:
                    reporter.warn(f"seed {seed}: {errors[seed]}")
    except KeyboardInterrupt:
        stopped = True
        reporter.stop()
    finally:
        ended.set()
        listener.join()
    return errors, stopped


def _tell(queue: Any, reporter: Reporter, ended: threading.Event) -> None:
    """Tell of the progress of the runs until they have ended."""
    reports: dict[int, ProgressReport] = {}
    while True:
        is_last = ended.wait(_EVERY)
        for seed, message in queue.get_nowait_batch(min(queue.qsize(), _MESSAGES)):
            if isinstance(message, str):
                reporter.warn(f"seed {seed}: {message}")
                continue
            samples, note = message
            if seed not in reports:
                reports[seed] = reporter.begin(seed, samples)
            reports[seed](samples, note)
        if is_last:
            return


def _train(queue: Any, task: tuple[int, SeedRun], on_step: OnStep, /) -> InputError | None:
    """Train in a task of the cluster; return what ended it, None for its end."""
    from albot_agents.training.run import TrainingRun  # Slow to load: PyTorch.

    seed, (folder, plan) = task

    def send(message: Any) -> None:
        queue.put_nowait((seed, message))

    def report(samples: int, note: str) -> None:
        on_step(samples)
        send((samples, note))

    try:
        with folder.locked():
            TrainingRun(folder, plan, send).run(report)
    except InputError as error:
        return error
    return None
