"""The table of broken mechanisms: which test fails, and which experiment's verdict turns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_value

FILE = "mutations.json"
"""The file of the table's figures, beside the reports' folders."""
COMMAND = "python -m albot_reliability mutations"
"""The command that measures them."""


@dataclass(frozen=True, kw_only=True)
class MutationResult:
    """What a fault in one line of a mechanism changed."""

    fault: str
    """The fault in words."""
    file: str
    """The module's path, relative to the project's folder."""
    old: str
    """The text in the line."""
    new: str
    """The text with the fault."""
    test: str | None
    """The first test that fails; None if all pass."""
    judged: Mapping[str, int]
    """The number of seeds of each experiment that was run with the fault."""
    verdicts: tuple[str, ...]
    """The verdicts that were reached without the fault, and are not with it: `albot1-c2 albot1`."""


@dataclass(frozen=True, kw_only=True)
class MutatedSystem:
    """The faults of a mapping system."""

    paper: str
    """The paper whose mechanisms are broken."""
    mutations: tuple[MutationResult, ...]


def read_mutations(path: Path) -> dict[str, MutatedSystem]:
    """Read the figures by system; none if the file is not there.

    Raises:
        InputError: The file is damaged.
    """
    if not path.exists():
        return {}
    found: dict[str, MutatedSystem] = read_value(
        Mapping[str, MutatedSystem], read_json(path), Location(path)
    )
    return found


def mutation_lines(systems: Mapping[str, MutatedSystem]) -> list[str]:
    """Return the section of the page in Markdown; no lines if there are no figures."""
    if not systems:
        return []
    lines = [
        "## Mechanisms broken on purpose",
        "",
        "Each row is a fault in one line of a paper's mechanism, in a copy of the project: the",
        "first test that fails with it, and the verdicts that are reached without it and not with",
        "it, over the seeds in brackets. A dash in the last column: the verdicts do not depend on",
        "it, or no experiment is about it. The faults stand in",
        "`scripts/albot_reliability/mutation_cases/`; the figures are measured by",
        "",
        "```",
        COMMAND,
        "```",
    ]
    for name, system in systems.items():
        lines += ["", f"### {name} ({system.paper})", "", *_rows(system.mutations)]
    return lines


def _rows(mutations: Sequence[MutationResult]) -> list[str]:
    unseen = [each for each in mutations if each.test is None and not each.verdicts]
    seen = f"{len(mutations) - len(unseen)} of {len(mutations)} are seen"
    by_tests = sum(each.test is not None for each in mutations)
    by_verdicts = sum(bool(each.verdicts) for each in mutations)
    lines = [
        f"{seen}: {by_tests} by tests, {by_verdicts} by verdicts.",
        "",
        "| fault | the change | test | verdicts |",
        "|---|---|---|---|",
    ]
    for each in mutations:
        change = f"`{Path(each.file).name}`: {_code(each.old)} → {_code(each.new)}"
        test = "–" if each.test is None else f"`{_short(each.test)}`"
        seeds = ", ".join(f"{name} {count}" for name, count in each.judged.items())
        verdicts = ", ".join(each.verdicts) or "–"
        lines.append(f"| {each.fault} | {change} | {test} | {verdicts} ({seeds or 'none run'}) |")
    return lines


def _code(text: str) -> str:
    """Return source text for a cell of a table."""
    return f"`{' '.join(text.split())}`".replace("|", "\\|")


def _short(test: str) -> str:
    """Return a test's name without its folder and without the values of its parameters."""
    return Path(test.partition("[")[0]).name.replace("|", "\\|")
