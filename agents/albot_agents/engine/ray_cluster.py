"""Run tasks on a Ray cluster: an existing one, or one of this machine alone.

Ray schedules the tasks, runs those of dead workers and dead nodes again, and moves tasks and
results. Here is only what fits it to the interface of engines. It needs the extra `cluster`.

Ray sends tasks and results between its own processes with pickle, and its processes listen on
ports. Those of a cluster that is started here listen on the loopback interface alone, and ask for a
token that only this process and those that it started know.
"""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import albot_env
from albot_agents.engine.engine import (
    RERUNS,
    Crash,
    Done,
    Engine,
    Failure,
    Result,
    Task,
    Work,
    attempt,
    judge,
)
from albot_core.errors import InputError
from albot_core.interrupts import INTERRUPTS, interrupts_deferred

AUTO = "auto"
"""The address that means the cluster of this machine, as Ray knows it."""
PATIENCE = 5.0, 20.0
"""Longest time until a port answers, and until Ray's own check of a cluster has ended (s)."""
_STORE = 256 << 20
"""Memory for large tasks and results of a cluster that is started here (bytes)."""
_FORWARDED = ("ALBOT_", "NUMBA_", "OMP_", "OPENBLAS_", "MKL_")
"""Beginnings of the names of environment variables that workers get from this process."""
_LONGEST = 12
"""Largest number of characters of the path of the folder for temporary files. Sockets' paths have
107 at most, of which Ray's names of folders and of the socket take 75, and ours 19."""
_AHEAD = 2
"""Number of tasks for each processor that Ray is given at a time, so that none waits."""


_ENDINGS = {
    "WorkerCrashedError": "it crashed or was killed",
    "NodeDiedError": "its node died",
    "OutOfMemoryError": "its node ran out of memory",
}
"""How processes ended, by the name of Ray's error."""


class RayEngine(Engine):
    """Runs tasks on a Ray cluster.

    Args:
        address: `HOST:PORT` of the cluster's head, or `AUTO`; None to start a cluster of this
            machine, which ends with the engine.
        limit: Largest number of tasks at a time; None for one a processor of the cluster.
    """

    def __init__(self, address: str | None = None, limit: int | None = None) -> None:
        self._address, self._limit = address, limit
        self._ray: Any = None
        self._folder: Path | None = None

    @property
    def workers(self) -> int:
        """Number of tasks at a time: as asked for, or the processors that the cluster has now."""
        if self._limit is not None:
            return self._limit
        if self._ray is None:
            return os.cpu_count() or 1
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def start(self) -> None:
        """Connect to the cluster, or start one.

        Raises:
            InputError: No cluster answers at the address, or it is of another version of Ray.
        """
        if self._ray is not None:
            return
        # Read when Ray is imported. Nothing is to be sent to anybody, here and in all processes.
        os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
        if self._address is None:
            self._start_here()
        else:
            _check_cluster(self._address)
            self._connect(address=self._address)

    def _start_here(self) -> None:
        """Start a cluster of this machine, which nobody else can reach."""
        # By this, Ray's processes listen on the loopback interface alone on any system.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
        os.environ["RAY_AUTH_MODE"] = "token"
        os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(32))
        self._folder = _socket_folder()
        self._connect(
            address="local",
            num_cpus=self.workers,
            include_dashboard=False,
            object_store_memory=_STORE,
            _temp_dir=str(self._folder),
        )

    def _connect(self, **settings: Any) -> None:
        import ray  # Slow to load, and reads the variables that are set above.

        variables = {
            name: value for name, value in os.environ.items() if name.startswith(_FORWARDED)
        }
        if self._folder is not None:  # What a killed worker leaves is removed with it.
            variables["TMPDIR"] = str(self._folder)
        with _handlers_kept():
            try:
                ray.init(
                    log_to_driver=False,
                    configure_logging=False,
                    runtime_env={"env_vars": variables},
                    **settings,
                )
            except (ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
                said = str(error).strip().partition("\n")[0]
                raise InputError("--address", "the address of a Ray cluster", said) from None
        # Ray would print there what it thinks of dead workers, and what is printed is the result.
        ray._private.worker.print_to_stdstream = lambda *_, **__: None
        self._ray = ray

    def run(
        self, work: Work[Task, Result], tasks: Iterable[Task], *, fresh: bool = False
    ) -> Generator[Done[Task, Result], None, None]:
        """Run tasks; see `Engine.run`."""
        self.start()
        ray = self._ray
        options = {"num_cpus": 1, "max_retries": RERUNS, "max_calls": 1 if fresh else 0}
        remote = ray.remote(**options)(_run_remote)
        shared = ray.put((work, str(Path.cwd()), albot_env.__version__))
        waiting = enumerate(tasks)
        running: dict[Any, tuple[int, Task]] = {}
        try:
            while True:
                room = self._most - len(running)
                for number, task in islice(waiting, max(0, room)):
                    with interrupts_deferred():
                        running[remote.remote(shared, task)] = number, task
                if not running:
                    return
                for reference in self._ended(list(running)):
                    number, task = running.pop(reference)
                    yield Done(number=number, task=task, result=self._result(reference))
        finally:
            for reference in running:
                ray.cancel(reference, force=True)

    @property
    def _most(self) -> int:
        """Largest number of tasks that Ray has at a time."""
        if self._address is not None and self._limit is not None:
            return self._limit
        return _AHEAD * self.workers

    def _ended(self, running: list[Any]) -> list[Any]:
        """Wait until a task has ended; return all that have."""
        first, others = self._ray.wait(running, num_returns=1)
        more: list[Any] = []
        if others:
            more, _ = self._ray.wait(others, num_returns=len(others), timeout=0)
        return [*first, *more]

    def _result(self, reference: Any) -> Any:
        """Return the result of a task that has ended, or the crash.

        Raises:
            InputError: The task raised it.
            OSError: The task raised it.
        """
        errors = self._ray.exceptions
        try:
            return judge(self._ray.get(reference))
        except errors.RuntimeEnvSetupError as error:
            said = str(error).strip().partition("\n")[0]
            raise InputError("--address", "a cluster that can start workers", said) from None
        except errors.RayTaskError as error:  # The task could not even be unpacked.
            cause = f"{type(error.cause).__name__}: {error.cause}".partition("\n")[0]
            return Crash(step=None, cause=cause, tries=1, details=str(error))
        except errors.RayError as error:
            cause = f"the process died: {_ENDINGS.get(type(error).__name__, type(error).__name__)}"
            return Crash(step=None, cause=cause, tries=RERUNS + 1, details=str(error))

    def close(self) -> None:
        """Leave the cluster, and end it if it was started here."""
        with interrupts_deferred():
            if self._ray is not None:
                self._ray.shutdown()
                self._ray = None
            if self._folder is not None:
                shutil.rmtree(self._folder, ignore_errors=True)
                self._folder = None


def _socket_folder() -> Path:
    """Make and return a folder for Ray's files, with a name short enough for sockets in it."""
    is_short = len(tempfile.gettempdir()) <= _LONGEST
    return Path(tempfile.mkdtemp(prefix="albot-ray-", dir=None if is_short else "/tmp"))


def _run_remote(shared: tuple[Work[Task, Result], str, str], task: Task) -> Result | Failure:
    """Run a task in a worker of the cluster.

    Args:
        shared: What runs it; the folder in which the command was called, for relative paths; the
            version of albot-env there.
        task: The task.
    """
    work, folder, version = shared
    try:
        enter_node(folder, version)
    except InputError as error:
        return Failure(error=error)
    return attempt(work, task, lambda step: None)


def enter_node(folder: str, version: str) -> None:
    """Prepare a worker of the cluster for a task.

    Args:
        folder: The folder in which the command was called, for relative paths; on another machine,
            it may not be there.
        version: The version of albot-env there.

    Raises:
        InputError: This node has another version.
    """
    if albot_env.__version__ != version:
        expected = f"albot-env {version} on all nodes, as where the command runs"
        raise InputError(f"node {socket.gethostname()}", expected, albot_env.__version__)
    with suppress(OSError):
        os.chdir(folder)


def _check_cluster(address: str) -> None:
    """Raise InputError if no cluster answers at an address, soon.

    `ray.init` would wait for minutes, and then end this process. So Ray's check runs in another.
    """
    if address != AUTO:
        _check_port(address)
    program = "from ray.scripts.scripts import main; main()"
    words = [sys.executable, "-c", program, "health-check"]
    words += [] if address == AUTO else ["--address", address]
    try:
        ran = subprocess.run(
            words, capture_output=True, text=True, check=False, timeout=PATIENCE[1]
        )
    except subprocess.TimeoutExpired:
        found = "something that does not answer as one"
    else:
        if ran.returncode == 0:
            return
        found = ran.stderr.strip().rpartition("\n")[2] or "none"
    raise InputError("--address", "the head of a Ray cluster", found)


def _check_port(address: str) -> None:
    """Raise InputError if an address is none, or nothing listens there."""
    host, colon, port = address.rpartition(":")
    if not colon or "/" in address or not port.isdecimal() or int(port) >= 1 << 16:
        raise InputError("--address", f"HOST:PORT of the head of a Ray cluster, or {AUTO}", address)
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=PATIENCE[0]).close()
    except OSError as error:
        found = f"nothing that answers at {address}: {error.strerror or error}"
        raise InputError("--address", "the head of a Ray cluster", found) from None


@contextmanager
def _handlers_kept() -> Iterator[None]:
    """Put the handlers of signals back after the block, in which Ray replaces one."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in INTERRUPTS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
