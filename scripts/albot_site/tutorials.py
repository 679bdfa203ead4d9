"""The tutorials: notebooks, the pages that show them, and a run of their cells."""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from albot_core.errors import InputError
from albot_core.files import atomic_write, write_text
from albot_site.markdown import fenced
from albot_site.sources import ROOT

FOLDER = ROOT / "docs/tutorials"
OUTPUTS = FOLDER / "outputs"
"""What the cells printed and drew; git ignores it."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of a notebook."""

    number: int
    """Its number, from 1."""
    is_code: bool
    """Whether it is code; otherwise it is markdown."""
    text: str
    """Its content."""


def notebooks() -> list[Path]:
    """Return the files of all tutorials."""
    return sorted(FOLDER.glob("*.ipynb"))


def read_cells(notebook: Path) -> Iterator[Cell]:
    """Yield the cells of a notebook.

    Raises:
        InputError: A cell has outputs: they are made anew, and not kept.
    """
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    for number, cell in enumerate(cells, start=1):
        if cell.get("outputs") or cell.get("execution_count"):
            raise InputError(notebook, "no outputs", "some", place=f"cell {number}")
        text = "".join(cell["source"])
        yield Cell(number=number, is_code=cell["cell_type"] == "code", text=text)


def run_cells(notebook: Path, outputs: Path) -> None:
    """Run the cells of a notebook in this program's main module, as Jupyter does.

    Args:
        notebook: The notebook.
        outputs: Folder for what the cells print (`.txt`), and for the picture that the last line
            of a cell is (`.png`).
    """
    names = vars(sys.modules["__main__"])
    for cell in read_cells(notebook):
        if not cell.is_code:
            continue
        with redirect_stdout(StringIO()) as printed:
            shown = _run(cell.text, names, f"{notebook.stem}, cell {cell.number}")
        if printed.getvalue():
            write_text(_output(notebook, cell, "txt", outputs), printed.getvalue())
        if hasattr(shown, "_repr_png_"):
            with atomic_write(_output(notebook, cell, "png", outputs)) as stream:
                stream.write(shown._repr_png_())


def _run(code: str, names: dict[str, Any], place: str) -> Any:
    """Run code, and return the value of its last line if that is an expression."""
    tree = ast.parse(code, place)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, place, "exec"), names)  # Our own notebooks.
    if not isinstance(last, ast.Expr):
        return None
    return eval(compile(ast.Expression(last.value), place, "eval"), names)


def _output(notebook: Path, cell: Cell, suffix: str, outputs: Path = OUTPUTS) -> Path:
    return outputs / f"{notebook.stem}-{cell.number}.{suffix}"


def tutorial_pages() -> dict[str, str]:
    """Return the page of each notebook: its cells, with what they printed and drew if it is known.

    `python -m albot_site tutorials` runs the cells.
    """
    return {f"tutorials/{path.stem}.md": _page(path) for path in notebooks()}


def _page(notebook: Path) -> str:
    title, *cells = read_cells(notebook)
    button = f'<a class="md-button" href="{notebook.name}" download>This page as a notebook</a>\n'
    parts = [title.text + "\n", button]
    for cell in cells:
        parts.append(fenced(cell.text, "python") if cell.is_code else cell.text + "\n")
        printed, drawn = (_output(notebook, cell, suffix) for suffix in ("txt", "png"))
        if printed.exists():
            parts.append(fenced(printed.read_text(encoding="utf-8"), "text"))
        if drawn.exists():
            parts.append(f"![What the cell draws](outputs/{drawn.name})\n")
    return "\n".join(parts)
