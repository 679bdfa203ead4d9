"""The section on injected faults: how many one-line faults the nearest tests detect."""

from __future__ import annotations

import logging
import math
import random
import re
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import cache
from pathlib import Path
from queue import Queue
from typing import Any

from albot_cli.progress import progress
from albot_reliability.fault_sampling import FOLDERS, ROOT, Fault, draw_faults
from albot_reliability.project_copy import MISSED, SEEN, ProjectCopy

_LOG = logging.getLogger(__name__)
SEED = 1
"""Seed of the faults."""
SHARE = 0.6
"""Share of each folder's modules that get a fault."""
SECONDS = 15.0
"""Processor time after which the tests that passed are enough (s)."""
_TESTS = ROOT / "tests"
_LONG = ("test_processors", "test_warm_up", "test_linking", "test_fuzz")
"""Files of tests that compile everything again in separate processes, or try thousands of cases."""
_SETTINGS = "tests/test_configurations.py"
_IMPORTS = re.compile(
    r"^\s*(?:from ((?:albot|tests)[\w.]*) import ([\w, ]*)|import ((?:albot|tests)[\w.]*))",
    re.MULTILINE,
)


# The tests near a module.


@cache
def _imports(path: Path) -> frozenset[str]:
    """Return the names of our modules, including tests, that a file imports."""
    found = set()
    for module, names, plain in _IMPORTS.findall(path.read_text(encoding="utf-8")):
        found |= {module or plain, *(f"{module}.{name.strip()}" for name in names.split(","))}
    return frozenset(found)


@cache
def _modules() -> Mapping[str, Path]:
    """Return the files of all modules by their names."""
    found = {}
    for folder in FOLDERS:
        packages = [ROOT / folder] if folder != "." else [ROOT / "albot_env", _TESTS]
        for path in (path for package in packages for path in package.rglob("*.py")):
            name = ".".join(path.relative_to(ROOT / folder).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


def _reached(path: Path) -> dict[Path, int]:
    """Return the files that a file imports, with the number of imports on the way to each."""
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

    The test with the module's own name in the mirrored folder comes first, even if the module is
    only loaded by its name; then come the tests that import the module, then others, those of its
    folder first.
    """
    module = ROOT / path
    folder = _mirror(module)
    ranked = []
    for test in sorted(_TESTS.rglob("test_*.py")):
        is_own = test.parent == folder and test.stem == f"test_{module.stem}"
        distance = _reached(test).get(module, 1 if is_own else None)
        if distance is None or test.stem in _LONG:
            continue
        away = 0 if test.is_relative_to(folder) else 1
        ranked.append((not is_own, distance > 1, away, distance, test.stat().st_size, test))
    return [str(rank[-1].relative_to(ROOT)) for rank in sorted(ranked)]


def _tests_for(fault: Fault) -> list[str]:
    """Return the tests near a fault; for a number also those of all settings."""
    near = tests_of(fault.path)
    return [*near[:1], _SETTINGS, *near[1:]] if fault.kind == "constant" else near


def _mirror(module: Path) -> Path:
    """Return the folder of tests that mirrors a module's, or the nearest existing one above."""
    parts = module.relative_to(ROOT).parts[:-1]
    parts = parts[1:] if parts[0] != "albot_env" else parts
    folder = _TESTS.joinpath(parts[0].removeprefix("albot_"), *parts[1:])
    while not folder.exists():
        folder = folder.parent
    return folder


# The section.


def measure(share: float, jobs: int, before: Mapping[str, Any]) -> dict[str, Any]:
    """Inject this share of the remaining faults, in `jobs` processes.

    Earlier results are kept for faults that are unchanged and were seen; after an interrupt the
    results so far are kept. A fault is left out, and tried again the next time, if the test that
    saw it fails without a fault.
    """
    faults = {fault.path: fault for fault in draw_faults(SEED, SHARE)}
    kept = before.get("faults", {})
    found = {
        path: asdict(fault) | {key: kept[path][key] for key in _OUTCOME if key in kept[path]}
        for path, fault in faults.items()
        if path in kept and (kept[path]["old"], kept[path]["new"]) == (fault.old, fault.new)
    }
    # Faults that were not seen come first. The others are in random order, so that those done are a
    # random sample at any time.
    again = [path for path, each in found.items() if each["outcome"] != SEEN and not _reason(each)]
    others = [path for path in faults if path not in found]
    left = again + random.Random(SEED).sample(others, len(others))
    left = left[: math.ceil(share * len(left))]
    copies: Queue[ProjectCopy] = Queue()
    with (
        tempfile.TemporaryDirectory() as folder,
        ThreadPoolExecutor(jobs) as pool,
        progress("injected faults", len(left), "faults") as update,
    ):
        for number in range(jobs):
            copies.put(ProjectCopy(Path(folder) / str(number) / "copy"))

        def work(path: str) -> None:
            copy = copies.get()
            found[path] = asdict(faults[path]) | copy.run(
                faults[path], _tests_for(faults[path]), SECONDS
            )
            copies.put(copy)

        try:
            for done, _ in enumerate(pool.map(work, left), start=1):
                update(done)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
        copy = copies.get()
        seen_by = {each["by"] for each in found.values() if "::" in each.get("by", "")}
        wrong = copy.failing(seen_by)
        copies.put(copy)
        while not copies.empty():
            copies.get().close()
    if wrong:
        _LOG.warning("left out, for they fail without a fault: %s", ", ".join(wrong))
    ordered = {path: found[path] for path in sorted(found) if found[path].get("by") not in wrong}
    first = before.get("first")
    return {"seed": SEED, "drawn": len(faults), "first": first, "faults": ordered}


def render(figures: Mapping[str, Any]) -> Iterable[str]:
    """Yield the section's lines."""
    faults = list(figures["faults"].values())
    equal = [fault for fault in faults if _reason(fault) is not None]
    counted = [fault for fault in faults if _reason(fault) is None]
    seen = [fault for fault in counted if fault["outcome"] == SEEN]
    yield from ("## Faults put in by hand", "", *_INTRODUCTION.splitlines(), "")
    yield (
        f"Of {figures['drawn']} such faults (seed {figures['seed']}) {len(faults)} were tried, in "
        f"no order. {len(equal)} of them change nothing that comes out; of the other "
        f"{len(counted)} the tests see {len(seen)}, {len(seen) / max(len(counted), 1):.1%}."
    )
    first = figures.get("first")
    if first:
        yield (
            f"Before there were tests for those that were not seen, it was {first['seen']} of the "
            f"first {first['tried']}."
        )
    yield from ("", "| operator | faults | seen |", "|---|---|---|")
    for kind in sorted({fault["kind"] for fault in counted}):
        of_kind = [fault for fault in counted if fault["kind"] == kind]
        yield f"| {kind} | {len(of_kind)} | {sum(each in seen for each in of_kind)} |"
    missed = [fault for fault in counted if fault["outcome"] == MISSED]
    if missed:
        yield from ("", "Not seen:", "")
        yield from (_told(fault, UNSEEN.get(fault["path"], "")) for fault in missed)
    if equal:
        yield from ("", "Change nothing that comes out:", "")
        yield from (_told(fault, _reason(fault) or "") for fault in equal)


def _reason(fault: Mapping[str, Any]) -> str | None:
    """Return why a fault that was not seen has no effect; None if it has one."""
    return EQUAL.get((fault["path"], fault["new"].strip())) if fault["outcome"] == MISSED else None


def _told(fault: Mapping[str, Any], why: str) -> str:
    place = f"`{fault['path']}`, line {fault['line']}"
    line = f"- {place}: `{fault['old'].strip()}` → `{fault['new'].strip()}`"
    return f"{line}: {why}" if why else line


_OUTCOME = ("outcome", "by", "passed", "seconds")
EQUAL: Mapping[tuple[str, str], str] = {
    (
        "albot_env/sim/obstacle_tables.py",
        "walls = world.walls if world is not None or movables.walkers else np.empty((0, 4))",
    ): "walls that no walker looks at are kept for nothing, and without a world there is none",
    (
        "scripts/albot_cli/evaluate.py",
        "write_text(scratch / _FIGURES, json.dumps(facts))",
    ): "the same JSON on one line",
    (
        "core/albot_core/mappers/precompile.py",
        "stamps=np.ones(1),",
    ): "a reading that is taken in for its compiling alone",
    (
        "albot_env/tasks/core/way_home.py",
        "if len(self._kept) >= KEPT:",
    ): "one fewer is kept of what is worked out again where it is not kept",
    # Two as they were when they were tried, before tasks were run by `albot_agents.engine`.
    (
        "agents/albot_agents/training/journeys.py",
        "others = run_parallel(_JourneyRunner(task, single), numbered[1:], "
        "min(jobs, len(tickets) + 1))",
    ): "no more processes are begun than there are journeys to make",
    (
        "agents/albot_agents/workers.py",
        'self._step = CONTEXT.RawValue("q", 1)',
    ): "it is set to 0 again before the process gets its first task",
    (
        "agents/albot_agents/engine/local.py",
        'self._step = CONTEXT.RawValue("q", 1)',
    ): "it is set to 0 again before the process gets its first task",
    (
        "core/albot_core/mappers/slam/particle_slam.py",
        'check_fields(self, POSITIVE, "drift", "drift_by_turn", "twist_by_way", "twist")',
    ): "the same fields are checked; where both are wrong, either may be named",
    (
        "core/albot_core/mappers/slam/scan_entry.py",
        "_block_counts = scratch(SIZES)",
    ): "counts of blocks are exact as floating-point numbers, too",
    (
        "albot_env/tasks/explore_and_home/reward.py",
        "farthest=np.ones(robots),",
    ): "the first observation of every episode sets it to 0, and nobody reads it before",
    (
        "albot_env/tasks/explore_and_home/reward.py",
        "driven=np.ones(robots),",
    ): "the first observation of every episode sets it to 0, and nobody reads it before",
}
"""Faults that do not affect any result, by module and changed line, with the reason."""
UNSEEN: Mapping[str, str] = {}
"""The reasons why faults of some modules are not seen."""
_INTRODUCTION = f"""\
One line of a module is made wrong, in a copy of the project, and the tests nearest to the module
run until one fails: its own, those that import it, then others, for {SECONDS:.0f} s of processor
time after the first. {SHARE:.0%} of the modules of every folder of `albot_core`, `albot_maps`,
`albot_env`, `albot_agents` and `albot_cli` get one fault each. Its kind is drawn from the operators
of mutation testing, its place from those where the module can have it, both by a seed
(`scripts/albot_reliability/fault_sampling.py`). Left out by rule: errors and assertions, texts,
types, the constants of pictures, statements that only tidy up or tell, and arguments that only
guard against another's fault. A test that sees a fault must pass without it. Programs that keep all
faults beside the code cannot be used here: compiled kernels are made from whole files."""
