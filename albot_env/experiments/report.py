"""What an experiment reports, and the folder that it is written to."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from albot_core.files import replacing, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Figures: TypeAlias = "float | int | bool | str | Mapping[str, Figures]"
"""What a report can hold."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """The outcome of an experiment, beside the paper's."""

    id: str
    """The experiment's name in the command."""
    title: str
    """One line: which experiment of which paper."""
    paper: Mapping[str, Figures]
    """What the paper reports."""
    measured: Mapping[str, Figures]
    """What was measured here, under the paper's names where there are any."""
    holds: bool
    """Whether what the paper reports was reached."""
    text: str = ""
    """How it was done, in Markdown."""
    pictures: Mapping[str, Figure] = field(default_factory=dict)
    """Pictures by file name without ending."""

    def as_json(self) -> dict[str, object]:
        """The report as the command prints it."""
        return {
            "id": self.id,
            "paper": dict(self.paper),
            "measured": dict(self.measured),
            "holds": self.holds,
        }

    def as_markdown(self) -> str:
        """The report for reading, with its pictures."""
        lines = [f"# {self.id}: {self.title}", "", self.text.strip(), ""]
        lines += ["| | paper | measured |", "|---|---|---|"]
        for name, value in self.measured.items():
            lines.append(f"| {name} | {_cell(self.paper.get(name))} | {_cell(value)} |")
        lines += ["", "Reached." if self.holds else "Not reached.", ""]
        lines += [f"![{name}]({name}.png)\n" for name in self.pictures]
        return "\n".join(lines)

    def write(self, folder: Path) -> list[Path]:
        """Write `result.json`, `report.md` and the pictures into `folder`; return their paths."""
        paths = []
        for name, figure in self.pictures.items():
            path = folder / f"{name}.png"
            with replacing(path) as stream:
                figure.savefig(stream, format="png", dpi=100)
            paths.append(path)
        write_text(folder / "result.json", json.dumps(self.as_json(), indent=2) + "\n")
        write_text(folder / "report.md", self.as_markdown())
        return [folder / "result.json", folder / "report.md", *paths]


def _cell(value: Figures | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, Mapping):
        return "<br>".join(f"{key}: {_cell(entry)}" for key, entry in value.items())
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)
