"""The page that sets all experiments' figures beside the papers'."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from albot_core.files import write_text
from albot_experiments.report import Report, cell

COMMAND = "albot experiment run all --out docs/experiments"


def write_index(reports: Sequence[Report], folder: Path) -> Path:
    """Write the page over the reports that stand in `folder`, each in a folder of its name.

    The page stands beside the folder and is called after it: `experiments.md` over
    `experiments/`.
    """
    page = folder.with_name(f"{folder.name}.md")
    write_text(page, index(reports, folder.name))
    return page


def index(reports: Sequence[Report], folder: str) -> str:
    """The page in Markdown; links lead into `folder`."""
    lines = [
        "# The papers' experiments",
        "",
        "Each experiment is repeated in the simulator or on real logs and held against what its",
        "paper reports; a link leads to all its figures and to how it was done. This page and the",
        "reports are written by one command:",
        "",
        "```",
        COMMAND,
        "```",
        "",
        "`albot experiment list` names the experiments, `albot experiment run ID` runs one. A",
        "worst figure is that of the worst seed.",
        "",
        "| | experiment | reached |",
        "|---|---|---|",
    ]
    for report in reports:
        link = f"[{report.id}]({folder}/{report.id}/report.md)"
        lines.append(f"| {link} | {report.title} | {cell(report.holds)} |")
    for report in reports:
        lines += ["", f"## {report.id}: {report.title}", "", *report.table(), ""]
        lines += [f"![{name}]({folder}/{report.id}/{name}.png)" for name in report.pictures]
    return "\n".join(lines) + "\n"
