"""The pages of the API: one for each public module, read from the docstrings."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

from albot_site.sources import PACKAGES, module_page, modules


def api_pages() -> dict[str, str]:
    """Return the page of each public module, and of each package with a table of what is in it."""
    found = dict(modules())
    pages = {}
    for module, path in found.items():
        text = f"# {module}\n\n::: {module}\n"
        if path.name == "__init__.py":
            text += "\n" + _table(module, found)
        pages[module_page(module)] = text
    return pages


def _table(package: str, found: dict[str, Path]) -> str:
    inside = [name for name in found if name.rpartition(".")[0] == package]
    if not inside:
        return ""
    rows = [f"| [{name}]({name}.md) | {_summary(found[name])} |" for name in inside]
    return "\n".join(("| module | |", "|---|---|", *rows, ""))


def _summary(path: Path) -> str:
    """Return the first line of a module's docstring, as a cell of a table."""
    doc = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return doc.partition("\n")[0].replace("|", "\\|")


def api_nav() -> list[Any]:
    """Return the navigation of the API: packages, and in them their packages and modules."""
    found = dict(modules())
    return [{package: _entries(package, found)} for package in PACKAGES]


def _entries(package: str, found: dict[str, Path]) -> list[Any]:
    entries: list[Any] = [module_page(package)]
    for name, path in found.items():
        before, _, last = name.rpartition(".")
        if before == package:
            is_package = path.name == "__init__.py"
            entries.append({last: _entries(name, found) if is_package else module_page(name)})
    return entries
