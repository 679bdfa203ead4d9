"""A copy of the project in which tests and experiments run with one fault at a time."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from albot_reliability import fault_runs
from albot_reliability.fault_sampling import FOLDERS, ROOT, Fault

SEEN, MISSED = "seen", "missed"
LONGEST = 900.0
"""Time after which an experiment with a fault is stopped (s)."""
_STOPPED = (signal.SIGXCPU, signal.SIGKILL)
_NOT_LOADED = 4
"""Pytest's status if a `conftest.py` cannot be imported, among other usage errors."""
_COPIED = ("core", "maps", "albot_env", "agents", "scripts", "tests", "docs")
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?(?:\[.*?\])?)(?: - .*)?$", re.MULTILINE)


class ProjectCopy:
    """A copy of the project that contains one fault at a time.

    The project itself must not change in the meantime.

    Args:
        folder: An empty folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True)
        for name in _COPIED:
            shutil.copytree(ROOT / name, folder / name)
        for path in ROOT.iterdir():
            if path.is_file():
                shutil.copy2(path, folder / path.name)
        self._before = dict(self._files())
        folders = os.pathsep.join(str(folder / name) for name in FOLDERS)
        settings = {
            "PYTHONPATH": folders,
            "CI": "true",
            "OMP_NUM_THREADS": "1",
            "NUMBA_NUM_THREADS": "1",
            "NUMBA_OPT": "1",  # The code that a fault's run compiles is not kept.
        }
        self._environment = os.environ | settings
        self._runs = subprocess.Popen(
            [sys.executable, str(Path(fault_runs.__file__))],
            cwd=folder,
            env=self._environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, fault: Fault, tests: list[str], seconds: float) -> dict[str, Any]:
        """Run tests with a fault; return the result."""
        with self._injected(fault):
            result, output = self._pytest(["-x"], tests, seconds)
        failed, status = _FAILED.findall(output), result["status"]
        if status in (0, fault_runs.NOTHING_FOUND):
            passed = re.findall(r"(\d+) passed", output)
            found = {"outcome": MISSED, "passed": int(passed[-1]) if passed else 0}
        else:
            unloaded = status == _NOT_LOADED and "while loading conftest" in output
            if not failed and not unloaded and status >= 0:
                raise RuntimeError(f"{fault}: {output}")
            ended = "a run that does not end" if -status in _STOPPED else "a process that ends"
            ended = "tests that cannot be loaded" if unloaded else ended
            found = {"outcome": SEEN, "by": failed[0] if failed else ended}
        return found | {"seconds": result["seconds"]}

    def experiment(self, name: str, seeds: range, fault: Fault | None) -> Mapping[str, bool] | None:
        """Run an experiment, with a fault if there is one; return its verdicts by mapper.

        An experiment without verdicts of its own has one, of the empty name. None if the experiment
        does not end within `LONGEST`, or fails.
        """
        over = f"{seeds.start}..{seeds.stop - 1}"
        arguments = ["experiment", "run", name, "--seeds", over, "--json"]
        with self._injected(fault) if fault is not None else nullcontext():
            try:
                done = subprocess.run(
                    [sys.executable, "-m", "albot_cli.main", *arguments],
                    cwd=self._folder,
                    env=self._environment,
                    capture_output=True,
                    text=True,
                    timeout=LONGEST,
                )
            except subprocess.TimeoutExpired:
                return None
        if done.returncode != 0 and fault is None:
            raise RuntimeError(f"{name}: {done.stderr}")
        if done.returncode != 0:
            return None
        report = json.loads(done.stdout)
        return report.get("verdicts") or {"": report["holds"]}

    def failing(self, tests: Iterable[str]) -> list[str]:
        """Return those of some tests that fail without a fault."""
        _, output = self._pytest([], sorted(tests), math.inf)
        return _FAILED.findall(output)

    def close(self) -> None:
        """End the process that runs tests."""
        self._runs.communicate()

    def _pytest(
        self, options: list[str], tests: list[str], seconds: float
    ) -> tuple[dict[str, Any], str]:
        """Run tests; return status and processor time, and the output."""
        output = self._folder.with_name("output")
        job = {
            "arguments": ["-q", "-p", "no:cacheprovider", "--tb=no", *options, *tests],
            "tests": tests,
            "seconds": seconds,
            "output": str(output),
        }
        assert self._runs.stdin is not None
        assert self._runs.stdout is not None
        self._runs.stdin.write(json.dumps(job) + "\n")
        self._runs.stdin.flush()
        result = json.loads(self._runs.stdout.readline())
        return result, output.read_text(encoding="utf-8", errors="replace")

    @contextmanager
    def _injected(self, fault: Fault) -> Iterator[None]:
        path = self._folder / fault.path
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        assert lines[fault.line - 1].rstrip("\n") == fault.old, fault
        lines[fault.line - 1] = fault.new + "\n"
        path.write_text("".join(lines), encoding="utf-8")
        try:
            yield
        finally:
            self._restore()

    def _restore(self) -> None:
        """Restore all files: the module, and the code compiled from it."""
        for path, stamp in list(self._files()):
            if self._before.get(path) != stamp:
                source = ROOT / path.relative_to(self._folder)
                path.unlink()
                if path in self._before:
                    shutil.copy2(source, path)
        for path in self._before:
            if not path.exists():
                shutil.copy2(ROOT / path.relative_to(self._folder), path)

    def _files(self) -> Iterator[tuple[Path, tuple[int, int]]]:
        for path in self._folder.rglob("*"):
            if path.is_file():
                of = path.stat()
                yield path, (of.st_mtime_ns, of.st_size)
