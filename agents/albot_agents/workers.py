"""Episodes in parallel processes, one of which may die without taking the others along."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from albot_agents.stress.plan import Episode, Violation
from albot_agents.stress.run import Outcome, run_episode
from albot_env.stress.limits import Limits

_CONTEXT = get_context("spawn")
"""Processes that begin anew are the same on every system, and inherit no threads."""


def run_episodes(episodes: Iterable[Episode], jobs: int) -> Generator[Outcome, None, None]:
    """What becomes of the episodes, in the order in which they end.

    Leaving the iterator ends all processes.

    Args:
        episodes: The episodes.
        jobs: How many run at once.
    """
    waiting = iter(episodes)
    workers = [_Worker(episode) for episode in islice(waiting, jobs)]
    try:
        while workers:
            told = wait([worker.link for worker in workers])
            for worker in [worker for worker in workers if worker.link in told]:
                outcome = worker.outcome()
                workers.remove(worker)
                following = next(waiting, None)
                if following is None:
                    worker.end()
                else:
                    workers.append(worker.given(following))
                yield outcome
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process that runs one episode after another.

    Args:
        episode: The first.
    """

    def __init__(self, episode: Episode) -> None:
        self.link, other = _CONTEXT.Pipe()
        self._step = _CONTEXT.RawValue("q", 0)
        self._process = _CONTEXT.Process(target=_work, args=(other, self._step), daemon=True)
        with _unheard_interrupts():
            self._process.start()
        other.close()  # The process has its own: when it dies, the link breaks.
        self._begin(episode)

    def _begin(self, episode: Episode) -> None:
        self._episode = episode
        self._step.value = 0
        self.link.send(episode)

    def given(self, episode: Episode) -> _Worker:
        """The worker that runs this episode next: another one where this has died."""
        try:
            self._begin(episode)
        except ConnectionError:
            self.end()
            return _Worker(episode)
        return self

    def outcome(self) -> Outcome:
        """What became of the episode, as soon as the process tells or has died."""
        try:
            outcome: Outcome = self.link.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            what = f"the process died: {_cause(self._process.exitcode or 0)}"
            step = int(self._step.value)
            violation = Violation(episode=self._episode, step=step, what=what)
            return Outcome(episode=self._episode, steps=step, violations=(violation,))
        return outcome

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.join()
        self.link.close()


def _work(link: Connection, step: Any) -> None:
    """Run the episodes that come through the link, until there are no more."""

    def tell(number: int) -> None:
        step.value = number

    while True:
        try:
            episode = link.recv()
        except EOFError:
            return
        link.send(run_episode(episode, tell, Limits()))


def _cause(status: int) -> str:
    """What an exit status means."""
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"


@contextmanager
def _unheard_interrupts() -> Iterator[None]:
    """Processes started meanwhile never hear Ctrl-C: the one that started them ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Only the main thread hears it and may say who else does.
        return
    heard = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, heard)
