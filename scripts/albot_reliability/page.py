"""The page docs/reliability.md: how the project was tested to break, and with what results.

Figures of sections that are not measured again are kept: they are in a JSON file beside the page.
Measuring occupies the processors for some time, at low priority.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import click

from albot_cli.number_types import CountType, RealType
from albot_cli.path_type import PathType
from albot_core.errors import InputError
from albot_core.files import write_text
from albot_reliability import campaigns, fuzzing, injected_faults, interruptions, survival

Figures = Mapping[str, Any]


class Effort(NamedTuple):
    """How much is measured."""

    share: float
    """Share of the whole."""
    jobs: int
    """Number of processes."""
    minutes: float | None
    """Length of the fuzzing in rounds; None for as many inputs as the share says."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """A section of the page."""

    measure: Callable[[Effort, Figures], Figures]
    """Measures the section, given the figures before. The result can be written as JSON."""
    render: Callable[[Figures], Iterable[str]]
    """Yields the section's lines, given its figures."""


SECTIONS: Mapping[str, Section] = {
    "interruptions": Section(
        measure=lambda effort, _: interruptions.measure(effort.share, effort.jobs),
        render=interruptions.render,
    ),
    "campaigns": Section(
        measure=lambda effort, before: campaigns.measure(effort.share, effort.jobs, before),
        render=campaigns.render,
    ),
    "fuzzing": Section(measure=lambda effort, _: fuzzing.measure(*effort), render=fuzzing.render),
    "survival": Section(
        measure=lambda effort, before: survival.measure(effort.share, before),
        render=survival.render,
    ),
    "faults": Section(
        measure=lambda effort, before: injected_faults.measure(effort.share, effort.jobs, before),
        render=injected_faults.render,
    ),
}
"""The sections by their names, in the order of the page."""
_HEAD = """\
# Reliability

What was tried to break the project, and what came of it. This page is written by one command:

```
python -m albot_reliability page
```
"""


@click.command()
@click.option(
    "--section",
    "sections",
    multiple=True,
    type=click.Choice(list(SECTIONS)),
    help="Measure only this one; repeatable. The others' figures stay.",
)
@click.option(
    "--share",
    default=1.0,
    show_default=True,
    type=RealType(0, 1, min_open=True),
    help="Measure less, to try it.",
)
@click.option(
    "--minutes",
    type=RealType(0, min_open=True),
    help="Length of the section fuzzing, with one seed after the other.",
)
@click.option("--jobs", type=CountType(1), help="Processes.  [default: one a core]")
@click.option(
    "--out",
    default=Path("docs/reliability.md"),
    show_default=True,
    type=PathType(dir_okay=False),
    help="The page; the figures go into a JSON file beside it.",
)
def command(
    sections: tuple[str, ...], share: float, minutes: float | None, jobs: int | None, out: Path
) -> None:
    """Try to break the project, and write the page on the results."""
    os.nice(10)
    kept = out.with_suffix(".json")
    figures = _read(kept)
    for name in sections or SECTIONS:
        effort = Effort(share, jobs or os.cpu_count() or 1, minutes)
        figures[name] = SECTIONS[name].measure(effort, figures.get(name, {}))
        write_text(kept, json.dumps(figures, indent=1) + "\n")
        present = [name for name in SECTIONS if name in figures]
        lines = [line for name in present for line in ("", *SECTIONS[name].render(figures[name]))]
        write_text(out, _HEAD + "\n".join(lines) + "\n")


def _read(path: Path) -> dict[str, Figures]:
    if not path.exists():
        return {}
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(path, "figures in JSON", str(error)) from None
    if not isinstance(figures, dict):
        raise InputError(path, "figures by section", type(figures).__name__)
    return figures
