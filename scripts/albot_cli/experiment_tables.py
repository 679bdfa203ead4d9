"""The report of an experiment as text for a terminal: aligned tables, their figures named in words.

The keys of the figures stand in the JSON and in the report's files.
"""

from __future__ import annotations

import re
import textwrap

from albot_core.mappers.registry import MAPPERS
from albot_experiments.report import Report, cell, key, rows

WIDTH = 100
"""Largest width of a line."""
_NARROWING = ((64, 14), (32, 14), (32, 9))
"""Widths at which names of rows, and of columns, are broken, tried until a table fits; a column may
need more for a long word or its figures."""
_GAP = "  "
_UNITS = {"m": "m", "deg": "°", "s": "s"}
_WORDS = {
    "asr": "ASR",
    "asrs": "ASRs",
    "slam": "SLAM",
    "spl": "SPL",
    "low": "from (95 %)",
    "high": "to (95 %)",
}
"""Words of keys that are written otherwise; `low` and `high` are a Wilson interval's ends."""

Table = list[list[str]]
"""Rows of cells, the head first, the name of each row first."""


def report_text(report: Report) -> str:
    """Return a report as text, at most `WIDTH` columns wide."""
    paper, measured = dict(rows(report.paper)), dict(rows(report.alone))
    beside = [
        [in_words(name), cell(measured.get(name)), cell(paper.get(name))]
        for name in {**measured, **paper}
    ]
    blocks = textwrap.wrap(f"{report.id}: {report.title}", WIDTH)
    alone = [(["", "ours", "paper"], *beside)] if beside else []
    for table in *alone, *map(tuple, report.grouped()):
        blocks += ["", *table_lines(_judged([list(row) for row in table], report))]
    return "\n".join([*blocks, "", *_verdict_lines(report)])


def in_words(name: str) -> str:
    """Return a figure's key in words, with its unit: `path error (m)` for `path_error_m`."""
    return ", ".join(map(_in_words, name.split(", ")))


def _in_words(name: str) -> str:
    for mapper in MAPPERS:
        name = re.sub(rf"(?<![a-z]){key(mapper)}(?![a-z])", mapper, name)
    # A number before it makes the unit part of the name: `within_0.4_m`.
    found = re.fullmatch(rf"(.*(?:^|_)[^_]*[^_\d][^_\d]*)_({'|'.join(_UNITS)})", name)
    name, unit = (found[1], f" ({_UNITS[found[2]]})") if found else (name, "")
    words = (_WORDS.get(word, word) for word in name.split("_"))
    return " ".join(words) + unit


def _judged(table: Table, report: Report) -> Table:
    """Return a table with its names in words and, if a row is judged, with the verdicts."""
    head, *body = table
    judged = [report.verdicts.get(row[0]) for row in body]
    if any(verdict is not None for verdict in judged):
        head = [*head, "reached"]
        body = [
            [*row, "" if verdict is None else cell(verdict)]
            for row, verdict in zip(body, judged, strict=True)
        ]
    return [[in_words(name) for name in head], *([in_words(name), *rest] for name, *rest in body)]


def _verdict_lines(report: Report) -> list[str]:
    """Return whether the paper's result was reached, and by which mappers or agents."""
    if not report.verdicts:
        return ["Reached." if report.holds else "Not reached."]
    named = {
        word: ", ".join(name for name, verdict in report.verdicts.items() if verdict == reached)
        for word, reached in (("Reached by", True), ("Not reached by", False))
    }
    lines = [f"{word} {names}." for word, names in named.items() if names]
    return [part for line in lines for part in textwrap.wrap(line, WIDTH)]


def table_lines(table: Table) -> list[str]:
    """Return a table as aligned lines.

    A table that is too wide gets narrower names, or rows and columns are exchanged, or it becomes
    several tables, one below the other, each with some of the columns: whatever takes the fewest.
    """
    exchanged = [*map(list, zip(*table, strict=True))]
    layouts = (
        _aligned_parts(each, *widths) for each in (table, exchanged) for widths in _NARROWING
    )
    best = min(layouts, key=len)  # The first of those that are as few.
    return [line for part in best for line in ("", *part)][1:]


def _aligned_parts(table: Table, name_width: int, head_width: int) -> list[list[str]]:
    """Return the lines of as many tables as are needed for all columns."""
    names, *columns = map(list, zip(*table, strict=True))
    row_names = [textwrap.wrap(name, name_width, subsequent_indent=_GAP) for name in names[1:]]
    left = max(len(line) for lines in row_names for line in lines)
    heads = [_broken_head(head, cells, head_width) for head, *cells in columns]
    widths = [
        max(map(len, [*head, *cells])) for head, (_, *cells) in zip(heads, columns, strict=True)
    ]
    parts: list[list[int]] = []
    for k in range(len(columns)):
        if parts and left + sum(len(_GAP) + widths[j] for j in [*parts[-1], k]) <= WIDTH:
            parts[-1].append(k)
        else:
            parts.append([k])
    return [_lines(row_names, left, [(heads[k], columns[k][1:]) for k in part]) for part in parts]


def _broken_head(head: str, cells: list[str], width: int) -> list[str]:
    """Return the lines of a column's head; a unit stays beside the word before it."""
    joined = head.replace(" (", "\N{NO-BREAK SPACE}(")
    width = max(width, *map(len, cells), *map(len, joined.split(" ")))
    lines = textwrap.wrap(joined, width, break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _lines(
    row_names: list[list[str]], left: int, columns: list[tuple[list[str], list[str]]]
) -> list[str]:
    """Return lines with names to the left, over `left` characters, and figures to the right."""
    height = max(len(head) for head, _ in columns)
    beside = []
    for head, cells in columns:
        column = [""] * (height - len(head)) + head
        for figure, name in zip(cells, row_names, strict=True):
            column += [figure, *[""] * (len(name) - 1)]
        width = max(map(len, column))
        beside.append([line.rjust(width) for line in column])
    names = [""] * height + [line for lines in row_names for line in lines]
    return [
        _GAP.join([name.ljust(left), *figures]).rstrip()
        for name, *figures in zip(names, *beside, strict=True)
    ]
