"""How many steps a second the environments take, compared with simple baselines."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from albot_benchmarks.baselines import PymunkLoopEnv, irsim_found, irsim_laser
from albot_benchmarks.timing import Rate, Workload, best_rates, rate_of
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.thread_pool import ThreadPool
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import World, load_world

ENVIRONMENT = "Albot/Explore-v0"
WORLD = "random:office:3?rooms=10"
"""An office floor of 200 walls."""

SENSORS = "laser", "sonar", "motion"
"""What a robot observes that makes nothing of its readings."""

_ENDLESS = 10**9
_HOLD = 10
_ACTIONS = 500
"""Steps after which a robot's actions come again."""
_RUN_IN = 100
"""Steps of each environment before the first that is timed: 10 s."""

Row = dict[str, float | int | str | None]


@dataclass(frozen=True, kw_only=True)
class Case:
    """An environment to be timed."""

    mapper: str | None
    """Name of the mapper inside, or `none`; None where there is none to have."""
    num_envs: int = 1
    """How many environments step together; 1 is one of `gymnasium.make`."""
    steps: int = 2000
    """Steps in a turn, of all environments together."""
    threads: int | None = 1
    """Threads that share the work of a batch; None for as many as there are processors."""
    scenes: str = "none"
    """The camera's preset, or `none`."""
    parts: tuple[str, ...] | None = None
    """What is observed (see `ObservationConfig.parts`); None for what the environment usually
    shows."""

    @property
    def mode(self) -> str:
        """`single` or `vector`."""
        return "single" if self.num_envs == 1 else "vector"

    @property
    def name(self) -> str:
        """A name of its own."""
        return f"{self.mode} {self.num_envs} {self.mapper} {self.threads} {self.parts}"


HEAVIEST = Case(mapper="albot1", num_envs=256, steps=32768)
"""The case whose memory is measured."""

CASES = (
    HEAVIEST,
    Case(mapper="none"),
    Case(mapper="odometry"),
    Case(mapper="albot1"),
    Case(mapper="none", num_envs=256, steps=65536, parts=SENSORS),
    Case(mapper="none", num_envs=1024, steps=65536, parts=SENSORS),
    Case(mapper="none", num_envs=256, steps=65536),
    Case(mapper="none", num_envs=1024, steps=65536),
    Case(mapper="albot1", num_envs=1024, steps=32768),
    Case(mapper="none", num_envs=1024, steps=65536, threads=None),
    Case(mapper="albot1", num_envs=1024, steps=32768, threads=None),
)

PROCESS_CASE = Case(mapper="none", num_envs=256, steps=4096)
"""The batch that is stepped in several processes at once."""


def measure_environments(rounds: int, cases: Sequence[Case] = CASES) -> list[Row]:
    """Time robots that wander about in `Albot/Explore-v0`, alone and in batches.

    On one core, and the largest batches on all cores, too; and batches that observe nothing but
    what their sensors say. Turns take some tenths of a second, so that in one of them the machine
    may be left alone by its neighbours.

    In the same rounds: the same robot and laser as a loop over pymunk's queries, and, where
    it is installed, ir-sim's laser alone.

    Returns:
        For each `id`, `mode` (single or vector), `num_envs`, `threads`, `mapper` (None where
        there is none to have), `parts` (what is observed, None for what usually is), `segments`
        (walls of the world), `steps_per_second` of all environments together (the best of
        `rounds` turns, compiled), `steps_per_cpu_second` (the same by the time that a processor
        really worked: where it is greater, the machine was busy), and `ratio`, that over the
        naive loop's. Of the batch of 256 with `albot1` also `memory_mib`, by how much the
        process grew (where the system tells; else 0).
    """
    world = load_world(WORLD)
    workloads, memory = _workloads(cases, world)
    baselines = _baselines(world)
    rates = best_rates({**workloads, **baselines}, rounds)
    rows = [
        _row(ENVIRONMENT, case, rates[case.name])
        | ({"memory_mib": memory[case.name]} if case.name in memory else {})
        for case in cases
    ]
    rows += [_row(name, Case(mapper=None), rates[name]) for name in baselines]
    for row in rows:
        row["segments"] = len(world.walls)
        row["ratio"] = float(row["steps_per_cpu_second"] or 0) / rates[_PYMUNK].cpu
    return rows


def _workloads(cases: Sequence[Case], world: World) -> tuple[dict[str, Workload], dict[str, float]]:
    """Turns of the cases by name, and of the heaviest how much memory it takes (MiB)."""
    workloads: dict[str, Workload] = {}
    memory: dict[str, float] = {}
    # The heaviest comes first: those after it use what others have given back.
    for case in sorted(cases, key=lambda case: case != HEAVIEST):
        before = _resident_mib()
        workloads[case.name] = make_workload(case, world)
        if case == HEAVIEST:
            workloads[case.name]()
            memory[case.name] = _resident_mib() - before
    return workloads, memory


_PYMUNK, _IRSIM = "pymunk in a Python loop", "ir-sim, its laser alone"


def _baselines(world: World) -> dict[str, Workload]:
    """What the environments are compared with."""
    naive = PymunkLoopEnv(world, LaserGeometry())
    baselines = {_PYMUNK: _workload(naive.step, _actions(2), 1, 100)}
    if irsim_found():
        scan = irsim_laser(world, LaserGeometry())
        baselines[_IRSIM] = _workload(lambda _: scan(), _actions(2), 1, 30)
    return baselines


def make_workload(case: Case, world: World) -> Workload:
    """A turn of a case: random actions, from where the turn before has led.

    What comes before the first has led away from the start: maps are not empty any more.
    """
    count = case.num_envs
    env = make_single(case, world) if case.mode == "single" else make_batch(case, world)
    actions = _actions(3) if case.mode == "single" else _actions(count, 3)
    env.reset(seed=0)
    _workload(env.step, actions, count, _RUN_IN)()
    return _workload(env.step, actions, count, max(1, case.steps // count))


def make_single(case: Case, world: World) -> Any:
    """One environment, without an end."""
    return gymnasium.make(
        ENVIRONMENT,
        world=world,
        mapper=case.mapper,
        config=_config(case),
        max_episode_steps=_ENDLESS,
    )


def make_batch(case: Case, world: World) -> Any:
    """A batch of environments without an end."""
    return gymnasium.make_vec(
        ENVIRONMENT,
        num_envs=case.num_envs,
        world=world,
        mapper=case.mapper,
        scenes=case.scenes,
        config=_config(case),
        max_episode_steps=_ENDLESS,
        threads=case.threads,
    )


def _config(case: Case) -> ExploreConfig:
    shown = ObservationConfig() if case.parts is None else ObservationConfig(parts=case.parts)
    return ExploreConfig(observations=shown)


def _workload(
    step: Callable[[np.ndarray], Any], actions: np.ndarray, environments: int, steps: int
) -> Workload:
    """So many steps, with the actions that come after those of the workload before."""
    ahead = cycle(actions)

    def workload() -> int:
        for action in islice(ahead, steps):
            step(action)
        return environments * steps

    return workload


def _actions(*shape: int) -> np.ndarray:
    """Random actions, each kept for a second: robots that tremble on the spot map nothing."""
    drawn = np.random.default_rng(0).uniform(-1, 1, (_ACTIONS // _HOLD, *shape))
    return np.repeat(drawn, _HOLD, axis=0).astype(np.float32)


def _row(name: str, case: Case, rate: Rate) -> Row:
    return {
        "id": name,
        "mode": case.mode,
        "num_envs": case.num_envs,
        "threads": ThreadPool(case.threads).size,
        "mapper": case.mapper,
        "parts": None if case.parts is None else ", ".join(case.parts),
        "steps_per_second": rate.wall_clock,
        "steps_per_cpu_second": rate.cpu,
    }


def _resident_mib() -> float:
    """Memory that this process holds (MiB)."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="ascii").splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    return 0.0


def measure_processes(
    case: Case = PROCESS_CASE, processes: int = 2, seconds: float = 2.0, rounds: int = 3
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
        "single": alone.wall_clock,
        "together": together.wall_clock,
        "scaling": together.wall_clock / alone.wall_clock,
        "scaling_cpu": together.cpu / alone.cpu,
    }


def _turn(links: list[Connection], seconds: float) -> Rate:
    """The rates of these processes at once, in sum."""
    for link in links:
        link.send(seconds)
    return sum((link.recv() for link in links), Rate())


def _work(link: Connection, case: Case) -> None:
    """Step the batch for as long as is asked for; tell the rate."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Who started this process ends it.
    workload = make_workload(case, load_world(WORLD))
    link.send(workload())
    while True:
        link.send(rate_of(workload, link.recv()))
