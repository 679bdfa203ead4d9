"""Faults put by hand into the mechanisms of the papers, held against tests and verdicts."""

from __future__ import annotations

import json
import logging
import os
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Queue

import click

from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.files import read_text, write_text
from albot_core.plain_data import Location, read_config
from albot_core.yaml_document import read_yaml
from albot_experiments.mutation_table import (
    FILE,
    MutatedSystem,
    MutationResult,
    read_mutations,
)
from albot_experiments.registry import FIRST_SEED, find_experiment
from albot_reliability.fault_sampling import ROOT, Fault
from albot_reliability.project_copy import SEEN, ProjectCopy

_LOG = logging.getLogger(__name__)
CASES = Path(__file__).with_name("mutation_cases")
"""The folder with the faults of each system, in a YAML file of its name."""
SECONDS = 240.0
"""Processor time after which the tests that passed are enough (s)."""
_BROKEN = "does not run"
"""The verdict of an experiment that fails with a fault."""


@dataclass(frozen=True, kw_only=True)
class Mutation:
    """A fault in one line of a mechanism."""

    fault: str
    """The fault in words."""
    file: str
    """The module's path, relative to the project's folder."""
    find: str
    """Text that stands in the file once, in one line."""
    replace: str
    """The text in its place."""
    tests: tuple[str, ...] | None = None
    """The tests to run; None for the system's."""
    experiments: Mapping[str, int] | None = None
    """The experiments to run, and over how many seeds; None for the system's."""

    def as_fault(self) -> Fault:
        """Return the fault of its line.

        Raises:
            InputError: The text does not stand in the file, or more than once.
        """
        text = read_text(ROOT / self.file)
        count, old = text.count(self.find), self.find
        if count != 1 or "\n" in old:
            raise InputError(self.file, f"the text {old!r} once, in one line", f"{count} times")
        line = text.count("\n", 0, text.index(old)) + 1
        before = text.splitlines()[line - 1]
        return Fault(
            path=self.file,
            line=line,
            kind="mechanism",
            old=before,
            new=before.replace(old, self.replace),
        )


@dataclass(frozen=True, kw_only=True)
class Cases:
    """The faults of a mapping system."""

    paper: str
    """The paper whose mechanisms are broken."""
    tests: tuple[str, ...]
    """The tests of the system: files or folders."""
    experiments: Mapping[str, int]
    """The experiments of the system, and over how many seeds each runs."""
    mutations: tuple[Mutation, ...]

    def tests_of(self, mutation: Mutation) -> list[str]:
        """Return the tests to run with a fault."""
        return list(self.tests if mutation.tests is None else mutation.tests)

    def experiments_of(self, mutation: Mutation) -> dict[str, int]:
        """Return the experiments to run with a fault, and the number of seeds of each."""
        chosen = self.experiments if mutation.experiments is None else mutation.experiments
        return dict(chosen)


def read_cases(name: str) -> Cases:
    """Read the faults of a system.

    Raises:
        InputError: There are none, or its file is damaged.
    """
    path = CASES / f"{name}.yml"
    if not path.is_file():
        raise InputError("SYSTEM", f"one of {', '.join(systems())}", name)
    document = read_yaml(path)
    cases = read_config(Cases, document.data, Location(path, place=document.place))
    for mutation in cases.mutations:
        mutation.as_fault()
        for experiment, count in cases.experiments_of(mutation).items():
            find_experiment(experiment)
            if count < 1:
                raise InputError(path, "at least 1 of its seeds", str(count), place=experiment)
    return cases


def systems() -> list[str]:
    """Return the names of the systems that have faults."""
    return sorted(path.stem for path in CASES.glob("*.yml"))


@click.command()
@click.argument("names", metavar="[SYSTEM]...", nargs=-1)
@click.option("--jobs", type=CountType(1), help="Processes.  [default: one a core]")
@click.option(
    "--out",
    default=Path("docs/experiments") / FILE,
    show_default=True,
    type=PathType(dir_okay=False),
    help="The file with the figures; those of other systems stay.",
)
def command(names: tuple[str, ...], jobs: int | None, out: Path) -> None:
    """Break the mechanisms of each SYSTEM one by one; tell which tests and verdicts see it.

    `albot experiment page docs/experiments --force` then writes the table.
    """
    os.nice(10)
    found = read_mutations(out)
    for name in names or systems():
        found[name] = _measure(name, read_cases(name), jobs or os.cpu_count() or 1)
        known = {system: asdict(found[system]) for system in sorted(found)}
        write_text(out, json.dumps(known, indent=1) + "\n")
    click.echo(str(out))


def _measure(name: str, cases: Cases, jobs: int) -> MutatedSystem:
    """Run the tests and experiments of a system with each of its faults."""
    copies: Queue[ProjectCopy] = Queue()
    runs = sorted(
        {run for mutation in cases.mutations for run in cases.experiments_of(mutation).items()}
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        ThreadPoolExecutor(jobs) as pool,
        progress(name, len(runs) + len(cases.mutations), "runs") as update,
    ):
        for number in range(jobs):
            copies.put(ProjectCopy(Path(folder) / str(number) / "copy"))

        def reached(run: tuple[str, int]) -> set[str]:
            copy = copies.get()
            verdicts = copy.experiment(run[0], _seeds(run[1]), None) or {}
            copies.put(copy)
            return {mapper for mapper, is_reached in verdicts.items() if is_reached}

        def work(mutation: Mutation) -> MutationResult:
            copy = copies.get()
            result = _judge(copy, cases, mutation, before)
            copies.put(copy)
            return result

        before = {}
        for run, verdicts in zip(runs, pool.map(reached, runs), strict=True):
            before[run] = verdicts
            update(len(before))
            if not verdicts:
                _LOG.warning("%s over %d seeds: no verdict is reached without a fault", *run)
        results = []
        for result in pool.map(work, cases.mutations):
            results.append(result)
            update(len(before) + len(results))
        copy = copies.get()
        wrong = copy.failing({each.test for each in results if each.test and "::" in each.test})
        copies.put(copy)
        while not copies.empty():
            copies.get().close()
    if wrong:
        raise InputError(name, "tests that pass without a fault", ", ".join(wrong))
    return MutatedSystem(paper=cases.paper, mutations=tuple(results))


def _judge(
    copy: ProjectCopy,
    cases: Cases,
    mutation: Mutation,
    before: Mapping[tuple[str, int], set[str]],
) -> MutationResult:
    """Run the tests and the experiments with a fault."""
    fault, judged = mutation.as_fault(), cases.experiments_of(mutation)
    seen = copy.run(fault, cases.tests_of(mutation), SECONDS)
    turned = []
    for run in judged.items():
        verdicts = copy.experiment(run[0], _seeds(run[1]), fault)
        if verdicts is None:
            turned.append(f"{run[0]} {_BROKEN}")
            continue
        turned += [
            f"{run[0]} {mapper}".strip()
            for mapper in sorted(before[run])
            if not verdicts.get(mapper, False)
        ]
    return MutationResult(
        fault=mutation.fault,
        file=mutation.file,
        old=mutation.find,
        new=mutation.replace,
        test=seen["by"] if seen["outcome"] == SEEN else None,
        judged=judged,
        verdicts=tuple(turned),
    )


def _seeds(count: int) -> range:
    return range(FIRST_SEED, FIRST_SEED + count)
