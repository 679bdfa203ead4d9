"""The small programs in scripts/, which neither the type checker nor other tests load."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

PROGRAMS = sorted((Path(__file__).parents[1] / "scripts").glob("*.py"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_all_that_a_program_imports_is_there(program: Path) -> None:
    assert runpy.run_path(str(program), run_name="program")["__doc__"]
