"""Steps per second of the environments, compared with simple baselines."""

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

from albot_benchmarks.baselines import PymunkLoopEnv
from albot_benchmarks.timing import Rate, Workload, best_rates, rate_of
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.thread_pool import ThreadPool
from albot_env.tasks.core.observation import DEFAULT_PARTS, ObservationConfig
from albot_env.tasks.explore.task import ExploreConfig
from albot_maps import World, load_world

ENVIRONMENT = "Albot/Explore-v0"
WORLD = "random:office:3?rooms=10"
"""An office floor of 200 walls."""

SENSORS = "laser", "sonar", "motion"
"""Parts of the observation that come directly from the sensors."""
WITH_MAP = (*DEFAULT_PARTS, "map_patch")
"""The parts as usual, and what the mapper remembers in two squares of 32 × 32 cells."""

_ENDLESS = 10**9
_HOLD = 10
_ACTIONS = 500
"""Steps after which a robot's actions repeat."""
_RUN_IN = 100
"""Steps of each environment before timing starts: 10 s."""

Row = dict[str, float | int | str | None]


@dataclass(frozen=True, kw_only=True)
class Case:
    """An environment to be timed."""

    mapper: str | None
    """Name of the mapper, or `none`; None for the baseline, which cannot have one."""
    num_envs: int = 1
    """Number of environments stepped together; 1 means a single one from `gymnasium.make`."""
    steps: int = 2000
    """Steps per turn, summed over all environments."""
    threads: int | None = 1
    """Threads that share the work of a batch; None for one per processor."""
    scenes: str = "none"
    """The camera's preset, or `none`."""
    parts: tuple[str, ...] | None = None
    """Parts of the observation (see `ObservationConfig.parts`); None for the default parts."""

    @property
    def mode(self) -> str:
        """`single` or `vector`."""
        return "single" if self.num_envs == 1 else "vector"

    @property
    def name(self) -> str:
        """A unique name."""
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
    Case(mapper="albot1", num_envs=256, steps=32768, parts=WITH_MAP),
    Case(mapper="none", num_envs=1024, steps=65536, threads=None),
    Case(mapper="albot1", num_envs=1024, steps=32768, threads=None),
)

PROCESS_CASE = Case(mapper="none", num_envs=256, steps=4096)
"""The batch that several processes step at once."""


def measure_environments(rounds: int, cases: Sequence[Case] = CASES) -> list[Row]:
    """Time randomly acting robots in `Albot/Explore-v0`, alone and in batches.

    They run on one core, the largest batches also on all cores, and some batches observe only
    sensor readings. A turn takes a few tenths of a second, so that other load on the machine is
    likely to spare one of them.

    The baseline runs in the same rounds: the same robot and laser as a Python loop over pymunk's
    queries.

    Returns:
        One row per case: `id`, `mode` (single or vector), `num_envs`, `threads`, `mapper` (None
        for baselines), `parts` (of the observation; None for the default), `segments` (walls of
        the world), `steps_per_second` of all environments together (the best of `rounds` turns,
        without compiling), `steps_per_cpu_second` (the same per second of processor time; if it
        is larger, the machine was busy), and `ratio`, the latter over that of the pymunk loop.
        The batch of 256 with `albot1` also has `memory_mib`, the growth of the process (0 if the
        system does not report it).
    """
    world = load_world(WORLD)
    workloads, memory = _workloads(cases, world)
    naive = PymunkLoopEnv(world, LaserGeometry())
    workloads[_PYMUNK] = _workload(naive.step, _actions(2), 1, 100)
    rates = best_rates(workloads, rounds)
    rows = [
        _row(ENVIRONMENT, case, rates[case.name])
        | ({"memory_mib": memory[case.name]} if case.name in memory else {})
        for case in cases
    ]
    rows.append(_row(_PYMUNK, Case(mapper=None), rates[_PYMUNK]))
    for row in rows:
        row["segments"] = len(world.walls)
        row["ratio"] = float(row["steps_per_cpu_second"] or 0) / rates[_PYMUNK].cpu
    return rows


def _workloads(cases: Sequence[Case], world: World) -> tuple[dict[str, Workload], dict[str, float]]:
    """Return the cases' workloads by name, and the memory of the heaviest by name (MiB)."""
    workloads: dict[str, Workload] = {}
    memory: dict[str, float] = {}
    # The heaviest comes first; later ones reuse memory that earlier ones have freed.
    for case in sorted(cases, key=lambda case: case != HEAVIEST):
        before = _resident_mib()
        workloads[case.name] = make_workload(case, world)
        if case == HEAVIEST:
            workloads[case.name]()
            memory[case.name] = _resident_mib() - before
    return workloads, memory


_PYMUNK = "pymunk in a Python loop"


def make_workload(case: Case, world: World) -> Workload:
    """Return a case's workload: random actions that continue where the last turn ended.

    The environments are run in first, so that the robots have left the start and maps are not
    empty.
    """
    count = case.num_envs
    env = make_single(case, world) if case.mode == "single" else make_batch(case, world)
    actions = _actions(3) if case.mode == "single" else _actions(count, 3)
    env.reset(seed=0)
    _workload(env.step, actions, count, _RUN_IN)()
    return _workload(env.step, actions, count, max(1, case.steps // count))


def make_single(case: Case, world: World) -> Any:
    """Make a single environment whose episode never ends."""
    return gymnasium.make(
        ENVIRONMENT,
        world=world,
        mapper=case.mapper,
        config=_config(case),
        max_episode_steps=_ENDLESS,
    )


def make_batch(case: Case, world: World) -> Any:
    """Make a batch of environments whose episodes never end."""
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
    """Return a workload of `steps` steps, which continues the actions of its last run."""
    ahead = cycle(actions)

    def workload() -> int:
        for action in islice(ahead, steps):
            step(action)
        return environments * steps

    return workload


def _actions(*shape: int) -> np.ndarray:
    """Return random actions, each held for a second; robots that jitter on the spot map nothing."""
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
    """Return the resident memory of this process (MiB); 0 if the system does not report it."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="ascii").splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) / 1024
    return 0.0


def measure_processes(
    case: Case = PROCESS_CASE, processes: int = 2, seconds: float = 2.0, rounds: int = 3
) -> Row:
    """Time a batch in one process and in several at once, in turns.

    Args:
        case: The batch that each process steps.
        processes: Number of processes.
        seconds: Length of a turn (s).
        rounds: Number of turns; the best counts.

    Returns:
        `id`, `num_envs`, `mapper`, `processes`; `single` and `together`, the steps per second of
        one process alone and of all at once, summed; `scaling`, their ratio; and `scaling_cpu`,
        the same ratio by processor time, as if every process had a core of its own.
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
            link.recv()  # The process has compiled its code.
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
    """Return the summed rates of these processes, running at once."""
    for link in links:
        link.send(seconds)
    return sum((link.recv() for link in links), Rate())


def _work(link: Connection, case: Case) -> None:
    """Run in a worker process: step the batch for each requested time, and send the rate."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The parent process ends this one.
    workload = make_workload(case, load_world(WORLD))
    link.send(workload())
    while True:
        link.send(rate_of(workload, link.recv()))
