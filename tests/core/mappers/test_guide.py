"""The guide in docs/mappers.md is the topological mapper, word by word."""

from __future__ import annotations

import re
from pathlib import Path

from tests.conftest import ROOT

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def test_the_guides_code_is_the_mapper_that_the_tests_use() -> None:
    guide = (ROOT / "docs" / "mappers.md").read_text(encoding="utf-8")
    code = (Path(__file__).parent / "topological.py").read_text(encoding="utf-8")
    shown = "\n".join(BLOCK.findall(guide))
    assert [line for line in shown.splitlines() if line] == [
        line for line in code.splitlines() if line
    ]
