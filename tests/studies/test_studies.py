"""The studies as subcommands: all are there, and the pages name those that there are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from albot_cli.experiment import STUDIES
from albot_cli.group import albot

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]


@pytest.mark.parametrize("name", STUDIES)
def test_each_study_tells_what_it_takes(name: str) -> None:
    words = ["experiment", "study", name, "--help"]
    result = CliRunner().invoke(albot, words, catch_exceptions=False)
    assert result.exit_code == 0
    assert f"albot experiment study {name} [OPTIONS]" in result.output


def test_the_studies_are_the_modules_of_their_package() -> None:
    modules = {path.stem for path in (ROOT / "scripts/albot_studies").glob("[!_]*.py")}
    assert modules == {name.replace("-", "_") for name in STUDIES}


def test_the_pages_name_the_studies_that_there_are() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert set(re.findall(r"albot experiment study ([a-z-]+)", text)) == set(STUDIES)


def test_an_unknown_study_is_refused_with_the_nearest() -> None:
    result = CliRunner().invoke(albot, ["experiment", "study", "slam-grow"])
    assert result.exit_code != 0
    assert "slam-growth" in result.output
