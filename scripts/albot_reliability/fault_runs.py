"""Repeated runs of pytest in processes in which the libraries are loaded, the nearest tests first.

As a program it reads one job per line from standard input, and writes the job's result on one line:
both are JSON. A job consists of pytest's arguments, the files of tests in their order, the file for
its output, and the processor time after which the tests that passed are enough.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

import pytest

NOTHING_FOUND = 77
"""The exit status of a run that was ended because the tests that passed were enough."""
ENDLESS, WAITED = 300, 1800
"""Processor time, and time, after which a run is considered endless (s)."""
# No plugin of pytest is among them, because it complains about plugins that are loaded already.
_LIBRARIES = (
    "numba", "llvmlite", "scipy.ndimage", "scipy.optimize", "scipy.sparse.csgraph", "scipy.spatial",
    "shapely", "yaml", "jsonschema", "mcap.reader", "mcap.writer",
    "beartype", "gymnasium", "pymunk", "click", "PIL.Image", "matplotlib.figure",
    "torch", "stable_baselines3", "sb3_contrib",
)  # fmt: skip


class _Order:
    """The pytest plugin of one run."""

    def __init__(self, tests: list[str], seconds: float) -> None:
        self._tests, self._seconds = tests, seconds
        self._began: float | None = None
        self._has_failed = False

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(
        self, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Sort the tests by the order of their files."""
        places = {config.rootpath / name: place for place, name in enumerate(self._tests)}
        items.sort(key=lambda item: places.get(item.path, len(places)))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """End the run between two tests; time counts from the first, which compiles most.

        If a test has failed, the fault is found, however long that took.
        """
        self._has_failed |= report.failed
        if report.when != "teardown" or self._has_failed:
            return
        if self._began is None:
            self._began = time.process_time()
        if time.process_time() - self._began > self._seconds:
            pytest.exit("nothing found", NOTHING_FOUND)


def _run(job: dict[str, Any]) -> NoReturn:
    """Run the tests of a job in this process, and end it."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (ENDLESS, ENDLESS))
    output = os.open(job["output"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for place, stream in enumerate((nothing, output, output)):
        os.dup2(stream, place)
    status: int = pytest.main(job["arguments"], plugins=[_Order(job["tests"], job["seconds"])])
    sys.stdout.flush()
    os._exit(status)


def _end(process: int) -> tuple[int, resource.struct_rusage]:
    """Wait for a process, or kill it with all that it started; return its status and usage."""
    since = time.monotonic()
    done, status, used = os.wait4(process, os.WNOHANG)
    while not done:
        if time.monotonic() - since > WAITED:
            os.kill(process, signal.SIGKILL)
        time.sleep(0.1)
        done, status, used = os.wait4(process, os.WNOHANG)
    with suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)
    return status, used


def main() -> None:
    """Run the jobs."""
    for name in _LIBRARIES:
        importlib.import_module(name)
    sys.path[0] = str(Path.cwd())
    for line in sys.stdin:
        process = os.fork()
        if process == 0:
            _run(json.loads(line))
        status, used = _end(process)
        result = {
            "status": os.waitstatus_to_exitcode(status),
            "seconds": round(used.ru_utime + used.ru_stime, 1),
        }
        sys.stdout.write(json.dumps(result) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
