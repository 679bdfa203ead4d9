"""The report of an experiment, the folder to which it is written, and the page of all reports."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from albot_core.errors import InputError
from albot_core.files import atomic_write, new_folder, read_text, write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_record
from albot_experiments.mutation_table import FILE, MutatedSystem, mutation_lines, read_mutations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Scalar: TypeAlias = float | int | bool | str | None
"""A figure; None if it is not known."""
Figures: TypeAlias = "Scalar | Mapping[str, Figures]"
"""The values that a report can hold."""

_COLOURS = 96
"""Number of colours of a picture."""
COMMAND = "albot experiment run all --out docs/experiments --force"
"""The command that writes the page of all reports."""
REPORT_FILES = ("result.json", "report.md")
"""The files of every report; pictures are beside them."""
_NEEDED: dict[str, Any] = {
    "id": str, "paper": Mapping[str, Any], "measured": Mapping[str, Any], "holds": bool,
}  # fmt: skip
_OPTIONAL: dict[str, Any] = {
    "verdicts": Mapping[str, bool], "compared": Mapping[str, Mapping[str, Any]],
    "conditions": Mapping[str, tuple[str, str]], "trained": Mapping[str, str],
}  # fmt: skip
"""Keys of `result.json`, and the types of their values."""
_DIGITS = 8
"""Digits of a fingerprint in the text, as in the benchmark's table of trained agents."""
_LETTER = ("-paper", "-thesis")
"""Endings of the names of mappers that follow their paper to the letter."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """The outcome of an experiment, beside the paper's."""

    id: str
    """The experiment's name in the command."""
    title: str
    """One line: which experiment of which paper."""
    paper: Mapping[str, Figures]
    """The figures of the paper."""
    measured: Mapping[str, Figures]
    """The figures measured here, under the paper's names if there are any."""
    holds: bool
    """Whether the paper's result was reached."""
    verdicts: Mapping[str, bool] = field(default_factory=dict)
    """The same verdict for each mapper, or agent, that is judged."""
    compared: Mapping[str, Mapping[str, Scalar]] = field(default_factory=dict)
    """The figures by which the mappers are compared, each by mapper (see `compared`)."""
    conditions: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """The paper's conditions and ours by name, such as `environment`, `speed`, `sensors`."""
    trained: Mapping[str, str] = field(default_factory=dict)
    """The trained agents that took part, each with the fingerprint of its file
    (`AgentFile.fingerprint`): figures of an agent that was trained again are of another one."""
    text: str = ""
    """A description of the method, in Markdown."""
    pictures: Mapping[str, Figure] = field(default_factory=dict)
    """Pictures by file name without ending."""

    def as_json(self) -> dict[str, object]:
        """Return the report as the command prints it."""
        conditions = {name: list(both) for name, both in self.conditions.items()}
        return {
            "id": self.id,
            "paper": _in_json(self.paper),
            "measured": _in_json(self.measured),
            "holds": self.holds,
            **({"verdicts": dict(self.verdicts)} if self.verdicts else {}),
            **({"compared": _in_json(self.compared)} if self.compared else {}),
            **({"conditions": conditions} if conditions else {}),
            **({"trained": dict(self.trained)} if self.trained else {}),
        }

    def as_markdown(self) -> str:
        """Return the report in Markdown, with its pictures."""
        lines = [f"# {self.id}: {self.title}", "", self.text.strip(), ""]
        if self.conditions:
            lines += ["| conditions | paper | here |", "|---|---|---|"]
            for name, (paper, here) in self.conditions.items():
                lines.append(f"| {name} | {paper} | {here} |")
            lines.append("")
        lines += self.table()
        for head, *body in self.grouped():
            lines += ["", f"| | {' | '.join(head[1:])} |", "|---" * len(head) + "|"]
            lines += [f"| {' | '.join(row)} |" for row in body]
        lines += ["", *self.verdict_lines(), ""]
        if self.trained:
            named = ", ".join(f"`{name}` `{of[:_DIGITS]}`" for name, of in self.trained.items())
            lines += [f"Trained agents, by the fingerprints of their files: {named}.", ""]
        lines += [f"![{name}]({name}.png)\n" for name in self.pictures]
        return "\n".join(lines)

    def verdict_lines(self) -> list[str]:
        """Return the verdict as lines, by mapper if several are judged."""
        if not self.verdicts:
            return ["Reached." if self.holds else "Not reached."]
        lines = [f"- `{name}`: {_verdict(reached)}" for name, reached in self.verdicts.items()]
        return ["Reached:", "", *lines]

    def table(self) -> list[str]:
        """Return the paper's figures beside those measured, without groups, in Markdown.

        Nothing where all figures are in groups.
        """
        paper, measured = dict(rows(self.paper)), dict(rows(self.alone))
        if not paper and not measured:
            return []
        return [
            "| | paper | measured |",
            "|---|---|---|",
            *(
                f"| {name} | {cell(paper.get(name))} | {cell(measured.get(name))} |"
                for name in {**measured, **paper}
            ),
        ]

    def grouped(self) -> list[list[list[str]]]:
        """Return the figures that come in groups as tables of cells, the head of each first."""
        tables = []
        for table in self._tables:
            head = ["", *(name for name, _ in rows(next(iter(table.values()))))]
            body = [[name, *map(cell, dict(rows(each)).values())] for name, each in table.items()]
            tables.append([head, *body])
        return tables

    @property
    def alone(self) -> dict[str, Figures]:
        """The measured figures that are not part of a table."""
        return {
            name: value
            for name, value in self.measured.items()
            if not isinstance(value, Mapping) or _is_spread(value)
        }

    @property
    def _tables(self) -> list[dict[str, Mapping[str, Figures]]]:
        """The groups of figures; groups with the same names are the rows of one table."""
        tables: dict[tuple[str, ...], dict[str, Mapping[str, Figures]]] = {}
        for name, value in self.measured.items():
            if isinstance(value, Mapping) and not _is_spread(value):
                tables.setdefault(tuple(value), {})[name] = value
        return list(tables.values())

    def write(self, folder: Path) -> list[Path]:
        """Write `result.json`, `report.md` and the pictures into `folder`; return their paths."""
        paths = []
        result, report = (folder / name for name in REPORT_FILES)
        with new_folder(folder):
            for name, figure in self.pictures.items():
                path = folder / f"{name}.png"
                with atomic_write(path) as stream:
                    stream.write(_small_png(figure))
                paths.append(path)
            write_text(result, json.dumps(self.as_json(), indent=2) + "\n")
            write_text(report, self.as_markdown())
        return [result, report, *paths]


def rows(figures: Mapping[str, Figures]) -> list[tuple[str, Scalar]]:
    """Return the figures one by one; one inside a group has the group's name too: `ring, error_m`.

    A median with its worst value is one figure.
    """
    found: list[tuple[str, Scalar]] = []
    for name, value in figures.items():
        if not isinstance(value, Mapping):
            found.append((name, value))
        elif _is_spread(value):
            median, worst = (cell(entry) for _, entry in rows(value))
            found.append((name, f"{median} (worst {worst})"))
        else:
            found += [(f"{name}, {inner}", entry) for inner, entry in rows(value)]
    return found


def _in_json(figures: Figures) -> object:
    """Return the figures for JSON, which has no infinity and no NaN: such a figure becomes None."""
    if isinstance(figures, Mapping):
        return {name: _in_json(value) for name, value in figures.items()}
    return None if isinstance(figures, float) and not math.isfinite(figures) else figures


def _is_spread(figures: Mapping[str, Figures]) -> bool:
    return tuple(figures) == ("median", "worst")


def _verdict(reached: bool) -> str:
    return "reached" if reached else "not reached"


def compared(
    measured: Mapping[str, Figures], mappers: Sequence[str], names: Sequence[str]
) -> dict[str, dict[str, Scalar]]:
    """Return some figures of the groups named after mappers, each by mapper."""
    found: dict[str, dict[str, Scalar]] = {}
    for mapper in mappers:
        group = measured[mapper]
        for name, value in rows(group) if isinstance(group, Mapping) else ():
            if name in names:
                found.setdefault(name, {})[mapper] = value
    return {name: found[name] for name in names}


def key(name: str) -> str:
    """Return a mapper's name in the form used in a figure's name."""
    return name.replace("-", "_")


def cell(value: Scalar) -> str:
    """Return a figure as text; a dash if it is unknown."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _small_png(figure: Figure) -> bytes:
    """Return the figure as a PNG with few colours, a third of the usual size."""
    from PIL import Image  # slow to load, as all that draws

    drawn, packed = BytesIO(), BytesIO()
    figure.savefig(drawn, format="png", dpi=80)
    with Image.open(drawn) as picture:
        picture.convert("RGB").quantize(_COLOURS, Image.Quantize.MAXCOVERAGE).save(
            packed, format="png", optimize=True
        )
    return packed.getvalue()


def read_report(folder: Path) -> Report:
    """Read a report that `Report.write` wrote, for the page: without its text, the pictures empty.

    Raises:
        InputError: The folder holds no report, or a damaged one.
    """
    from matplotlib.figure import Figure

    result, report = (folder / name for name in REPORT_FILES)
    if not (result.is_file() and report.is_file()):
        raise InputError(str(folder), "a report: " + ", ".join(REPORT_FILES), "none")
    lines = read_text(report, errors="replace").splitlines()
    title = lines[0].partition(": ")[2] if lines else ""
    if not title:
        expected = f"a heading `# {folder.name}: TITLE` in its first line"
        raise InputError(report, expected, lines[0] if lines else "an empty file")
    pictures = [line[2:].partition("]")[0] for line in lines if line.startswith("![")]
    figures, where = read_json(result), Location(result)
    given = figures if isinstance(figures, dict) else {}
    known = _NEEDED | {name: kind for name, kind in _OPTIONAL.items() if name in given}
    return Report(
        title=title,
        pictures={name: Figure() for name in pictures},
        **read_record(known, figures, where),
    )


def write_index(reports: Sequence[Report], folder: Path) -> Path:
    """Write the page of the reports that stand in `folder`, each in a folder of its name."""
    page = index_path(folder)
    write_text(page, index(reports, folder.name, read_mutations(folder / FILE)))
    return page


def index_path(folder: Path) -> Path:
    """Return the page beside a folder with the same name: `experiments.md` for `experiments/`."""
    return folder.with_name(f"{folder.name}.md")


def index(
    reports: Sequence[Report], folder: str, mutations: Mapping[str, MutatedSystem] | None = None
) -> str:
    """Return the page in Markdown; its links lead into `folder`."""
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
        "`albot experiment list` names the experiments, `albot experiment run ID` runs one, and",
        "`albot experiment page FOLDER` writes this page anew. A worst figure is that of the worst",
        "seed.",
        "",
        "Where a paper's system runs to the letter, its mapper ends in `-paper` or `-thesis`.",
        "",
        "| | experiment | reached to the letter | reached by ours |",
        "|---|---|---|---|",
    ]
    for report in reports:
        link = f"[{report.id}]({folder}/{report.id}/report.md)"
        letter: list[str] = []
        ours: list[str] = []
        for name, reached in report.verdicts.items():
            is_letter = name.partition(" ")[0].endswith(_LETTER)
            (letter if is_letter else ours).append(f"{name}: {cell(reached)}")
        if not report.verdicts:
            ours.append(cell(report.holds))
        verdict = f"{', '.join(letter) or '–'} | {', '.join(ours) or '–'}"
        lines.append(f"| {link} | {report.title} | {verdict} |")
    for report in reports:
        lines += ["", f"## {report.id}: {report.title}", "", *report.table(), ""]
        lines += [f"![{name}]({folder}/{report.id}/{name}.png)" for name in report.pictures]
    if mutations:
        lines += ["", *mutation_lines(mutations)]
    return "\n".join(lines) + "\n"


ABLATION_COMMAND = "albot experiment ablation docs/experiments --force"
"""The command that writes the ablation table."""


def ablation(reports: Sequence[Report], folder: str) -> str:
    """Return the figures by which mappers are compared, over all experiments, in Markdown.

    Args:
        reports: Reports with `compared` figures; others are left out.
        folder: The reports' folder, for links.
    """
    comparing = [report for report in reports if report.compared]
    rows_of = [by_mapper for report in comparing for by_mapper in report.compared.values()]
    mappers = list(dict.fromkeys(mapper for by_mapper in rows_of for mapper in by_mapper))
    lines = [
        "# What each idea brings",
        "",
        "Three mappers, each with one idea more than the one before, on every experiment of the",
        "Albot1 thesis and on the public logs. `albot1-thesis` is the thesis to the letter.",
        "`albot1-tracked` fits lines, searches the turn, and lets all landmarks that it has",
        "tracked from view to view localise it together. `albot1` matches each view with all that",
        "it remembers nearby. `odometry` lays each view where the odometer says. Medians, and the",
        "worst seed or run in brackets. This page is written by",
        "",
        "```",
        ABLATION_COMMAND,
        "```",
        "",
        f"| experiment | figure | {' | '.join(f'`{mapper}`' for mapper in mappers)} |",
        "|---" * (2 + len(mappers)) + "|",
    ]
    for report in comparing:
        link = f"[{report.id}]({folder}/{report.id}/report.md)"
        verdicts = [report.verdicts.get(mapper) for mapper in mappers]
        judged = {"**reached**": dict(zip(mappers, verdicts, strict=True))}
        for name, by_mapper in (*report.compared.items(), *judged.items()):
            cells = " | ".join(cell(by_mapper.get(mapper)) for mapper in mappers)
            lines.append(f"| {link} | {name} | {cells} |")
    return "\n".join(lines) + "\n"


def each_seed(seeds: range, progress: Callable[[int], None]) -> Iterator[int]:
    """Yield the seeds one after the other; call `progress` with the number of seeds done.

    Raises:
        InputError: No seeds.
    """
    if not len(seeds):
        raise InputError("seeds", "at least one", "none")
    for done, seed in enumerate(seeds, start=1):
        yield seed
        progress(done)
