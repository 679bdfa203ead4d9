"""What a second process brings: the same batch in one process, and in two at once."""

from __future__ import annotations

import signal
from multiprocessing import get_context
from multiprocessing.connection import Connection

from albot_benchmarks.environment import ENVIRONMENT, WORLD, Case, Row, make_lap
from albot_benchmarks.rates import Rate, rate_of
from albot_maps import load_world

_CASE = Case(mapper="none", num_envs=256, steps=4096)


def measure_processes(
    case: Case = _CASE, processes: int = 2, seconds: float = 2.0, rounds: int = 3
) -> Row:
    """Time a batch in one process, and in several at once, in turns.

    Args:
        case: The batch that each process steps.
        processes: How many.
        seconds: Length of a turn.
        rounds: How many turns each has; the best counts.

    Returns:
        `id`, `num_envs`, `mapper`, `processes`; `single` and `together`, steps a second of
        one process alone and of all at once in sum; `scaling`, their ratio, and
        `scaling_cpu`, the same by the time that processors worked: what it would be where
        every process has a core of its own.
    """
    context = get_context("spawn")
    links: list[Connection] = []
    workers = []
    for _ in range(processes):
        link, other = context.Pipe()
        worker = context.Process(target=_work, args=(other, case), daemon=True)
        worker.start()
        other.close()
        links.append(link)
        workers.append(worker)
    try:
        for link in links:
            link.recv()  # It has compiled.
        alone = together = Rate()
        for _ in range(rounds):
            alone = alone.better(_turn(links[:1], seconds))
            together = together.better(_turn(links, seconds))
    finally:
        for worker in workers:
            worker.kill()
            worker.join()
    return {
        "id": ENVIRONMENT,
        "num_envs": case.num_envs,
        "mapper": case.mapper,
        "processes": processes,
        "single": alone.by_clock,
        "together": together.by_clock,
        "scaling": together.by_clock / alone.by_clock,
        "scaling_cpu": together.by_processor / alone.by_processor,
    }


def _turn(links: list[Connection], seconds: float) -> Rate:
    """The rates of these processes at once, in sum."""
    for link in links:
        link.send(seconds)
    return sum((link.recv() for link in links), Rate())


def _work(link: Connection, case: Case) -> None:
    """Step the batch for as long as is asked for; tell the rate."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Who started this process ends it.
    lap = make_lap(case, load_world(WORLD))
    link.send(lap())
    while True:
        link.send(rate_of(lap, link.recv()))
