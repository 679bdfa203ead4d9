"""The page on faults says what the faults do."""

from __future__ import annotations

from pathlib import Path

from albot_core.sensing.faults.registry import fault_table
from albot_env.faults.registry import FAULTS

PAGE = Path(__file__).parents[3] / "docs" / "faults.md"


def test_the_table_of_faults_is_that_of_the_registry() -> None:
    assert fault_table(FAULTS) in PAGE.read_text(encoding="utf-8")
