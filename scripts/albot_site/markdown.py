"""Markdown that several generated pages are made of."""

from __future__ import annotations

from collections.abc import Iterable


def cell(text: object) -> str:
    """Return text as a cell of a table: on one line, without a bar."""
    return " ".join(str(text).split()).replace("|", "\\|")


def code_cell(text: object) -> str:
    """Return text as code in a cell of a table; nothing for nothing."""
    return f"`{cell(text)}`" if str(text) else ""


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table, whose cells are markdown without bars and line breaks."""
    heads = list(heads)
    lines = ["| " + " | ".join(cells) + " |" for cells in (heads, ["---"] * len(heads), *rows)]
    return "\n".join(lines) + "\n"


def fenced(text: str, language: str = "") -> str:
    """Return text as a block of code."""
    return f"```{language}\n{text.rstrip()}\n```\n"
