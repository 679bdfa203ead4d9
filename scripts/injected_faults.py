"""The section on injected faults: how many one-line faults the tests of their rooms see.

    python scripts/injected_faults.py FILE [--number N]... [--missed] [--seconds S]

writes what came of each fault into FILE as it goes, and goes on where it stopped; `--number`
and `--missed` try some of them again, the latter those that were not seen. Each fault is put into a
copy of the project, alone, and the tests nearest to its module run there until one fails.
"""

from __future__ import annotations

import json
import math
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import click

from albot_cli.main import exit_status
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.files import write_text
from albot_core.kernels import compiled
from fault_runs import NOTHING_FOUND
from fault_sampling import FOLDERS, ROOT, Fault, draw_faults

SEED = 1
"""Decides the faults."""
SHARE = 0.6
"""The share of each folder's modules that get one."""
SECONDS = 15.0
"""Processor time after which the tests that passed are enough (s)."""
SEEN, MISSED = "seen", "missed"
_TESTS = ROOT / "tests"
_LONG = ("test_processors", "test_precompile", "test_warm_up", "test_linking", "test_fuzz")
"""Files of tests that compile everything anew in processes of their own, or try thousands."""
_COPIED = ("core", "maps", "albot_env", "agents", "scripts", "tests", "docs")
_IMPORTS = re.compile(
    r"^\s*(?:from ((?:albot|tests)[\w.]*) import ([\w, ]*)|import ((?:albot|tests)[\w.]*))",
    re.MULTILINE,
)
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+(?:\[.*?\])?)", re.MULTILINE)
_STAMPED = """

def _tie_to_all_kernels(dispatcher: Any) -> None:
    kept, changed = dispatcher._cache._cache_file, {changed!r}
    stamp = {stamp!r} + (" fault" if dispatcher.py_func.__module__ in changed else "")
    kept._version = f"{{kept._version}} {{stamp}}"
"""
"""Only kernels that the fault can reach are compiled anew. Appended to the copy's `compiled`."""


# Which tests are near a module.


@cache
def _imports(path: Path) -> frozenset[str]:
    """The modules of ours, tests' among them, that a file names in its imports."""
    found = set()
    for module, names, plain in _IMPORTS.findall(path.read_text(encoding="utf-8")):
        found |= {module or plain, *(f"{module}.{name.strip()}" for name in names.split(","))}
    return frozenset(found)


@cache
def _modules() -> Mapping[str, Path]:
    """The files of all modules by their names."""
    found = {}
    for folder in FOLDERS:
        packages = [ROOT / folder] if folder != "." else [ROOT / "albot_env", _TESTS]
        for path in (path for package in packages for path in package.rglob("*.py")):
            name = ".".join(path.relative_to(ROOT / folder).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


def _reached(path: Path) -> dict[Path, int]:
    """The files that a file imports, and how many imports are on the way to each."""
    found, waiting = {path: 0}, [path]
    for current in waiting:
        for name in sorted(_imports(current)):
            file = _modules().get(name)
            if file is not None and file not in found:
                found[file] = found[current] + 1
                waiting.append(file)
    return found


def tests_of(path: str) -> list[str]:
    """Return the files of tests that reach a module, the nearest first.

    That of the module's own name in the mirrored folder comes first; then those that import it; then
    others, those of its folder first.
    """
    module = ROOT / path
    folder = _mirror(module)
    ranked = []
    for test in sorted(_TESTS.rglob("test_*.py")):
        distance = _reached(test).get(module)
        if distance is None or test.stem in _LONG:
            continue
        is_own = test.parent == folder and test.stem == f"test_{module.stem}"
        away = 0 if test.is_relative_to(folder) else 1
        ranked.append((not is_own, distance > 1, away, distance, test.stat().st_size, test))
    return [str(rank[-1].relative_to(ROOT)) for rank in sorted(ranked)]


def _mirror(module: Path) -> Path:
    """The folder of tests that mirrors a module's folder, or the nearest above it that is there."""
    parts = module.relative_to(ROOT).parts[:-1]
    parts = parts[1:] if parts[0] != "albot_env" else parts
    folder = _TESTS.joinpath(parts[0].removeprefix("albot_"), *parts[1:])
    while not folder.exists():
        folder = folder.parent
    return folder


# Runs.


class Copy:
    """A copy of the project, in which one fault stands at a time.

    Args:
        folder: An empty folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir()
        for name in _COPIED:
            shutil.copytree(ROOT / name, folder / name)
        for path in ROOT.iterdir():
            if path.is_file():
                shutil.copy2(path, folder / path.name)
        packages = (ROOT / name / package for name in FOLDERS for package in compiled.PACKAGES)
        self._stamp = compiled.digest(package for package in packages if package.exists())
        self._compiled = folder / "core/albot_core/kernels/compiled.py"
        self._before = dict(self._files())
        folders = os.pathsep.join(str(folder / name) for name in FOLDERS)
        settings = {
            "PYTHONPATH": folders,
            "CI": "true",
            "OMP_NUM_THREADS": "1",
            "NUMBA_NUM_THREADS": "1",
            "NUMBA_OPT": "1",  # What one fault's run compiles anew is not kept.
        }
        self._runs = subprocess.Popen(
            [sys.executable, str(ROOT / "scripts/fault_runs.py")],
            cwd=folder,
            env=os.environ | settings,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, fault: Fault, tests: list[str], seconds: float) -> dict[str, Any]:
        """Run tests with a fault; return what came of it."""
        with self._injected(fault):
            result, output = self._pytest(["-x"], tests, seconds)
        failed, status = _FAILED.findall(output), result["status"]
        if status in (0, NOTHING_FOUND):
            passed = re.findall(r"(\d+) passed", output)
            found = {"outcome": MISSED, "passed": int(passed[-1]) if passed else 0}
        else:
            assert failed or status < 0, output
            found = {"outcome": SEEN, "by": failed[0] if failed else "the time that it takes"}
        return found | {"seconds": result["seconds"]}

    def failing(self, tests: Iterable[str]) -> list[str]:
        """Return those of some tests that fail without a fault."""
        with self._stamped(set()):
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
        module = ROOT / fault.path
        changed = {name for name, file in _modules().items() if module in _reached(file)}
        with self._stamped(changed):
            yield

    @contextmanager
    def _stamped(self, changed: set[str]) -> Iterator[None]:
        with self._compiled.open("a") as stream:
            stream.write(_STAMPED.format(changed=changed, stamp=self._stamp))
        try:
            yield
        finally:
            self._restore()

    def _restore(self) -> None:
        """Make everything as it was: the module, and what was compiled of it."""
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


# The command.


@click.command()
@click.argument("out", type=PathType(dir_okay=False))
@click.option("--number", "numbers", multiple=True, type=int, help="Try these again.")
@click.option("--missed", is_flag=True, help="Try those again that were not seen.")
@click.option("--seconds", default=SECONDS, show_default=True, help="Processor time for each.")
def main(out: Path, numbers: tuple[int, ...], missed: bool, seconds: float) -> None:
    """Inject faults, and write what came of them."""
    os.nice(10)
    found = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
    faults = draw_faults(SEED, SHARE)
    wanted = set(numbers) or {
        number
        for number in range(len(faults))
        if str(number) not in found or (missed and found[str(number)]["outcome"] == MISSED)
    }
    with (
        tempfile.TemporaryDirectory() as folder,
        progress("injected faults", len(wanted), "faults") as update,
    ):
        copy = Copy(Path(folder) / "copy")
        # In no order, so that those that are done are a sample at any time.
        order = random.Random(SEED).sample(sorted(wanted), len(wanted))
        for done, number in enumerate(order):
            fault = faults[number]
            result = copy.run(fault, tests_of(fault.path), seconds)
            found[str(number)] = asdict(fault) | result
            write_text(out, json.dumps(found, indent=1) + "\n")
            update(done + 1)
        copy.close()


if __name__ == "__main__":
    exit_status(main)
