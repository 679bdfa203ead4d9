"""Train with several seeds, each in a process of its own."""

from __future__ import annotations

import signal
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol, runtime_checkable

from albot_agents.engine.local import CONTEXT, interrupts_blocked
from albot_agents.training.journeys import MadeJourneys
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_folder import SeedRun
from albot_core.errors import InputError
from albot_core.garbage import collect_rarely
from albot_core.interrupts import interrupts_deferred

ProgressReport = Callable[[int, str], None]
"""Called with the number of samples so far, and the state of the training as text."""


@runtime_checkable
class Reporter(Protocol):
    """Receives what happens."""

    def begin(self, seed: int, samples: int) -> ProgressReport:
        """Return what is called with the progress of a seed, which has so many samples already."""

    def warn(self, text: str) -> None:
        """Tell of a problem that does not stop the training."""

    def stop(self) -> None:
        """Tell that Ctrl-C is stopping the runs."""


def train_seeds(
    runs: Mapping[int, SeedRun], jobs: int, reporter: Reporter
) -> tuple[dict[int, Exception], bool]:
    """Train until all runs have ended or Ctrl-C.

    An error of one run does not stop the others. Ctrl-C stops all after the update that they are
    making, with a checkpoint; a second one at once, without.

    Journeys depend on no seed. The first process makes them, on all processors; the others start
    when it has, and get them.

    Args:
        runs: The runs by seed.
        jobs: Number of processes at a time.
        reporter: Receives the progress.

    Returns:
        The errors by seed: an InputError, or a RuntimeError for a bug; and whether Ctrl-C stopped
        the training.
    """
    waiting, stopped = deque(runs.items()), False
    errors: dict[int, Exception] = {}
    running: list[_Process] = []
    made: MadeJourneys | None = None
    try:
        while waiting or running:
            try:
                _start(waiting, running, made, jobs, reporter)
                ready = wait([process.link for process in running])
                with interrupts_deferred():
                    for process in [each for each in running if each.link in ready]:
                        if process.receive():
                            made = process.made if made is None else made
                            continue
                        running.remove(process)
                        if process.error is not None:
                            errors[process.seed] = process.error
                            reporter.warn(f"seed {process.seed}: {process.error}")
            except KeyboardInterrupt:
                if stopped:
                    break
                stopped = True
                waiting.clear()
                reporter.stop()
                for process in running:
                    process.stop()
    finally:
        with interrupts_deferred():
            for process in running:
                process.end()
    return errors, stopped


def _start(
    waiting: deque[tuple[int, SeedRun]],
    running: list[_Process],
    made: MadeJourneys | None,
    jobs: int,
    reporter: Reporter,
) -> None:
    """Start the next runs: one until the journeys are made, then as many as `jobs` allows."""
    while waiting and len(running) < (1 if made is None else jobs):
        with interrupts_deferred():  # Otherwise an unknown process could keep running.
            seed, run = waiting.popleft()
            running.append(_Process(seed, run, made, reporter, shares=bool(waiting)))
    if made is not None and not waiting:
        made.clear()  # All have got them.


class _Process:
    """The process that trains with one seed.

    Args:
        seed: The seed.
        run: Its run.
        made: Journeys that it need not make; None if no process has made them yet.
        reporter: Receives the progress.
        shares: Whether it sends the journeys that it has made.
    """

    def __init__(
        self,
        seed: int,
        run: SeedRun,
        made: MadeJourneys | None,
        reporter: Reporter,
        *,
        shares: bool,
    ) -> None:
        self.seed = seed
        self.made: MadeJourneys | None = None
        """The journeys that it has sent."""
        self.error: Exception | None = None
        """What ended it; None if it came to an end or was stopped."""
        self._folder, self._reporter = run[0], reporter
        self._report: ProgressReport | None = None
        self.link, other = CONTEXT.Pipe()
        # Not a daemon: it starts processes itself, which make journeys.
        arguments = (*run, other, made, shares and made is None)
        self._process = CONTEXT.Process(target=_train, args=arguments)
        with interrupts_blocked():
            self._process.start()
        other.close()  # The process has its own end; when it dies, the link breaks.

    def receive(self) -> bool:
        """Process a message; return False if the process has ended."""
        try:
            message = self.link.recv()
        except (EOFError, ConnectionError):
            self._join()
            return False
        if isinstance(message, InputError):
            self.error = message
        elif isinstance(message, str):
            self._reporter.warn(f"seed {self.seed}: {message}")
        elif isinstance(message, MadeJourneys):
            self.made = message
        else:
            samples, note = message
            if self._report is None:
                self._report = self._reporter.begin(self.seed, samples)
            self._report(samples, note)
        return True

    def stop(self) -> None:
        """Ask the process to end after its update."""
        with suppress(ConnectionError):
            self.link.send(None)

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._join()

    def _join(self) -> None:
        self._process.join()
        self.link.close()
        status = self._process.exitcode or 0
        if status < 0:
            found = f"one that died: signal {signal.Signals(-status).name}"
            expected = "a process that trains to the end"
            self.error = InputError(self._folder.path, expected, found)
        elif status:
            self.error = RuntimeError(f"{self._folder.path}: exit status {status}")


def _train(
    folder: RunFolder,
    plan: TrainingPlan,
    link: Connection,
    made: MadeJourneys | None,
    shares: bool,
) -> None:
    """Train in the process of a seed.

    It sends the samples so far with the state of the training, warnings as text, an InputError, and
    if it shares them, the journeys when they are made.
    """
    collect_rarely()
    from albot_agents.training.run import TrainingRun  # Slow to load: PyTorch.

    def send(message: Any) -> None:
        with suppress(ConnectionError):  # Who started the process has died; see `report`.
            link.send(message)

    def report(samples: int, note: str) -> None:
        if link.poll():  # A request to stop, or the end of who started the process.
            raise KeyboardInterrupt
        send((samples, note))

    try:
        with folder.locked():
            hand_over = send if shares else lambda made: None
            TrainingRun(folder, plan, send, made=made, on_journeys=hand_over).run(report)
    except InputError as error:
        send(error)
