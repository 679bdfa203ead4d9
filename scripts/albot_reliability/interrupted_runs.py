"""Runs of the command that are interrupted or killed at random moments, and what they leave.

Starting Python and loading compiled code takes seconds, so one process does both and forks a child
for each run, which calls the command as its console script does. Some runs are new processes
nevertheless, to test the first moments. `left_files.py` has the checks that follow.
"""

from __future__ import annotations

import faulthandler
import gc
import mmap
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import chdir, contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import cycle, islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NoReturn
from unittest.mock import patch

import yaml

from albot_agents.benchmark import folder as results_folder
from albot_agents.benchmark.protocol import find_protocol
from albot_agents.engine import local
from albot_agents.engine.engine import Done, Result, Task, Work
from albot_agents.engine.rows import MANIFEST, Row, RowsFolder
from albot_cli.main import main
from albot_env.recording.writer import EpisodeWriter
from albot_reliability.left_files import BrokenPromiseError, check_quiet, check_run, rows_of

INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PATIENCE = 600.0
"""A run that continues for this time (s) after its signal hangs; a busy machine delays it."""
RESUMED = {"train": 0.1, "stress": 0.5, "evaluate": 0.5}
"""Share of the runs of these commands that are resumed afterwards, to their end."""
EARLY = 1.5
"""New processes are interrupted within this time from their start (s)."""

_FORKING = get_context("fork")
_READY = 8
"""Index in the shared memory at which a child notes that it has begun, after its moments."""
_PLAN: Mapping[str, Any] = {
    "task": "Albot/Homing-v0",
    "n_envs": 2,
    "n_timesteps": 128,
    "n_steps": 8,
    "batch_size": 16,
    "n_epochs": 1,
    "torch_threads": 1,
    "checkpoint_every": 32,
    "policy": {"net_arch": [8], "initial_action": [0.5, 0, -1]},
    "env": {
        "world": "square-loop",
        "mapper": "none",
        "journeys": 1,
        "max_episode_steps": 12,
        "config": {"outing": {"shortest": 1, "longest": 2, "away": 0}},
    },
    "evaluation": {"worlds": ["square-loop"], "seeds": "900", "every": 32},
}
_STEPS = ("--worlds", "square-loop", "--steps", "20", "--jobs", "2")
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "play": ("--headless", "--world", "square-loop", "--mapper", "odometry", "--steps", "60"),
    "train": ("--config", "plan.yml", "--out", "run"),
    "evaluate": ("Albot/Explore-v0", "--agent", "gap-explorer", "--mapper", "none", *_STEPS,
                 "--seeds", "1..4", "--out", "out", "--rows", "rows"),
    "results": ("--out", "results", "--agent", "random", "--odometer", "pioneer",
                "--episodes", "2", "--jobs", "2"),
    # Three jobs, so that there are rows before the end.
    "stress": ("--worlds", "square-loop", "--steps", "4", "--jobs", "2", "--count", "140",
               "--agent", "gap-explorer", "--json", "--rows", "rows"),
}  # fmt: skip
"""The arguments of each subcommand."""
OTHERS = ("mappers", "agents list", "worlds list", "map --help", "experiment list", "bench --help")
"""Other commands that are interrupted at their start."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run, and its result."""

    words: tuple[str, ...]
    """The command, without `albot`."""
    number: int
    """The signal that is sent."""
    after: float
    """The time of the signal, from the run's start (s)."""
    resumed: bool = False
    """Whether it is resumed afterwards."""
    rows: Sequence[Row] = ()
    """The rows that it would have written, not interrupted."""
    ended: bool = False
    """Whether the run was over before the signal came."""
    problem: str = ""
    """The promise that was broken; empty for none."""
    facts: Mapping[str, int] = field(default_factory=dict)
    """Other counts."""


def prepare() -> dict[str, tuple[float, list[Row]]]:
    """Import and load everything; return duration (s) and rows of each command."""
    import torch

    torch.set_num_threads(1)
    local.CONTEXT = _FORKING  # type: ignore[assignment]
    # Few and short episodes, of two tasks.
    protocol = find_protocol()
    tasks = {
        task: replace(protocol.tasks[task], steps=10, worlds=("mazes",))
        for task in ("Albot/Explore-v0", "Albot/ExploreAndHome-v1")
    }
    short = replace(protocol, tasks=tasks)
    vars(results_folder)["find_protocol"] = lambda version: short
    _load()
    whole = {}
    for command, words in COMMANDS.items():
        with _folder() as folder:
            began = time.monotonic()
            _call(("albot", command, *words), folder)
            seconds = time.monotonic() - began
            whole[command] = seconds, rows_of(command, folder / "rows")
    return whole


def _load() -> None:
    """Call the commands in this process, so that every child has all that they load."""
    from click.testing import CliRunner
    from stable_baselines3 import PPO

    from albot_cli.group import albot

    with (
        patch.object(local.LocalEngine, "run", _run_here),
        # After torch has computed gradients in a process, it cannot do so in a forked child.
        patch.object(PPO, "train", lambda self: None),
    ):
        for command, words in COMMANDS.items():
            with _folder() as folder, chdir(folder):
                CliRunner().invoke(albot, [command, *words], catch_exceptions=False)
    gc.freeze()  # Objects that the collector never visits are never copied into a child.


def _run_here(
    engine: local.LocalEngine, work: Work[Task, Result], tasks: Iterable[Task]
) -> Generator[Done[Task, Result], None, None]:
    for number, task in enumerate(tasks):
        yield Done(number=number, task=task, result=work(task, lambda step: None))


def forked_runs(
    whole: Mapping[str, tuple[float, Sequence[Row]]],
    count: int,
    numbers: Sequence[int],
    jobs: int,
) -> Iterator[Run]:
    """Run the commands in turn, until `count` runs were still going on when their signal came.

    Args:
        whole: Duration (s) and rows of each command, not interrupted.
        count: Number of runs.
        numbers: The signals, of which each run gets one.
        jobs: Number of runs at a time.
    """
    rng = random.Random(sum(numbers))
    commands = cycle(whole.items())
    with ProcessPoolExecutor(jobs, mp_context=_FORKING) as pool:
        while count > 0:
            wanted = [
                Run(
                    words=(command, *COMMANDS[command]),
                    number=rng.choice(numbers),
                    after=rng.uniform(0, length),
                    resumed=rng.random() < RESUMED.get(command, 0.0),
                    rows=rows,
                )
                for command, (length, rows) in islice(commands, count)
            ]
            for run in pool.map(_run_forked, wanted):
                count -= not run.ended
                yield run


def fresh_runs(count: int, numbers: Sequence[int], jobs: int) -> Iterator[Run]:
    """Run the commands in new processes, which get their signal soon after their start."""
    rng = random.Random(count)
    words = [(command, *rest) for command, rest in COMMANDS.items()]
    words += [tuple(line.split()) for line in OTHERS]
    wanted = [
        Run(words=each, number=rng.choice(numbers), after=rng.uniform(0, EARLY))
        for each in islice(cycle(words), count)
    ]
    with ProcessPoolExecutor(jobs, mp_context=_FORKING) as pool:
        yield from pool.map(_run_fresh, wanted)


def _run_forked(run: Run) -> Run:
    with _folder() as folder:
        moments = mmap.mmap(-1, 9)
        child = os.fork()
        if not child:
            _be_child(("albot", *run.words), folder, moments)
        while not moments[_READY] and _wait(child, 0.002) is None:
            pass
        return _interrupted(run, folder, child, moments)


def _run_fresh(run: Run) -> Run:
    albot = Path(sys.executable).with_name("albot")
    with (
        _folder() as folder,
        (folder / ".out").open("w") as out,
        (folder / ".err").open("w") as err,
    ):
        process = subprocess.Popen(
            [albot, *run.words],
            cwd=folder,
            stdout=out,
            stderr=err,
            start_new_session=True,
            env={**os.environ, "TMPDIR": str(folder / ".tmp")},
            preexec_fn=_hear_signals,
        )
        return _interrupted(run, folder, process.pid, None)


def _interrupted(run: Run, folder: Path, child: int, moments: mmap.mmap | None) -> Run:
    """Send the signal when it is time, wait for the end, and check what is left."""
    try:
        _wait(child, run.after)
        with suppress(ProcessLookupError):
            # A terminal's Ctrl-C goes to all processes of a command, the others to one.
            (os.killpg if run.number == signal.SIGINT else os.kill)(child, run.number)
        status = _wait(child, PATIENCE)
        if status is None:
            os.kill(child, signal.SIGUSR1)
            _wait(child, 1.0)
            errors = (folder / ".err").read_text()
            raise BrokenPromiseError(f"goes on for {PATIENCE:.0f} s: {errors}")
        if status == 0:
            return replace(run, ended=True)
        if not _gone(child, PATIENCE):
            raise BrokenPromiseError("leaves processes behind")
        facts = check_quiet(folder, status, run.number)
        written = None if moments is None else int.from_bytes(moments[:8], "little")
        facts |= check_run(run.words[0], folder, run.number == signal.SIGKILL, written)
        if run.resumed:
            facts["resumed"] = _resume(run, folder)
        return replace(run, facts=facts)
    except BrokenPromiseError as broken:
        return replace(run, problem=str(broken))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)


def _resume(run: Run, folder: Path) -> int:
    """Resume a run; return 1, or 0 if it had not begun its folder."""
    command = run.words[0]
    if command == "train":
        if not (folder / "run" / "config.yml").exists():
            return 0
        _call(("albot", "train", "--resume", "run"), folder)
        return 1
    rows = folder / "rows"
    if not (rows / MANIFEST).exists():
        return 0
    before = rows_of(command, rows)
    _call(("albot", command, "--resume", "rows"), folder)
    after = rows_of(command, rows)
    if after != list(run.rows):
        raise BrokenPromiseError(f"resumed to other rows: {after}")
    if any(row not in after for row in before):
        raise BrokenPromiseError("rows lost by resuming")
    return 1


def _wait(child: int, seconds: float) -> int | None:
    """Return the child's exit status, negative for a signal; None if it has not ended in time."""
    deadline = time.monotonic() + seconds
    while True:
        # The child stays a zombie, so that its process number is not reused until all is checked.
        found = os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if found is not None:
            killed = found.si_code in (os.CLD_KILLED, os.CLD_DUMPED)
            return -found.si_status if killed else found.si_status
        if (left := deadline - time.monotonic()) <= 0:
            return None
        time.sleep(min(left, 0.002))


def _gone(child: int, seconds: float) -> bool:
    """Return whether all other processes of the child's session end in time."""
    os.waitpid(child, 0)
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            os.killpg(child, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.01)
    return False


def _call(words: Sequence[str], folder: Path) -> None:
    """Run the command in a child to its end, which must be successful."""
    child = os.fork()
    if not child:
        _be_child(words, folder, None)
    _, status = os.waitpid(child, 0)
    if status:
        errors = (folder / ".err").read_text()
        raise BrokenPromiseError(f"{' '.join(words)}: status {status}, {errors}")


def _be_child(words: Sequence[str], folder: Path, moments: mmap.mmap | None) -> NoReturn:
    """Run the command in this child process, in a folder of its own."""
    status = 1
    try:
        os.setsid()
        os.chdir(folder)
        tempfile.tempdir = str(folder / ".tmp")
        for number, path in enumerate((os.devnull, ".out", ".err")):
            flags = os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
            os.dup2(os.open(path, flags), number)
        sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w")  # noqa: SIM115
        sys.argv = list(words)
        if moments is not None:
            _count_written(moments, words[1])
        _hear_signals()
        faulthandler.register(signal.SIGUSR1)
        if moments is not None:
            moments[_READY] = 1
        main()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException:  # noqa: BLE001 - as Python itself does
        traceback.print_exc()
    finally:
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def _hear_signals() -> None:
    """Reset the signals as in a process started by a shell; the parent may ignore some."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _count_written(counter: mmap.mmap, command: str) -> None:
    """Count the moments that the recorder of `play` is given; with other commands, the rows."""
    kind: Any = EpisodeWriter if command == "play" else RowsFolder
    write = kind.add

    def add(self: Any, *arguments: Any) -> None:
        write(self, *arguments)
        count = int.from_bytes(counter[:8], "little") + 1
        counter[:8] = count.to_bytes(8, "little")

    kind.add = add


@contextmanager
def _folder() -> Iterator[Path]:
    """Yield a folder for a run, with the plan of a training."""
    folder = Path(tempfile.mkdtemp(prefix="interrupted-"))
    try:
        (folder / ".tmp").mkdir()
        (folder / "plan.yml").write_text(yaml.safe_dump(dict(_PLAN)))
        yield folder
    finally:
        shutil.rmtree(folder)
