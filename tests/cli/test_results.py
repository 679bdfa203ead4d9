"""`albot results` on figures that are there already."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from albot_agents.evaluation import comparison
from albot_agents.evaluation.comparison import OFFICES, Comparison, Figures
from tests.cli.conftest import expect_error, figures

TOY = Comparison(
    task="Albot/Homing-v0", agents=("oracle",), figure="spl", kinds=(OFFICES,), settings={}
)
ROW = {
    "task": "Albot/Explore-v0",
    "agent": "walker",
    "odometer": "none",
    "kind": "parks",
    "command": "albot results",
    "figure": "spl",
    "episodes": 3,
    "spl": 0.5,
}


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A page with one row; what is measured for it takes no time."""

    def measure(planned: list[comparison.PairedTrials], jobs: int, tell: object) -> Figures:
        return {planned[0].rows[0]: {"episodes": len(planned), "spl": 1.0}}

    monkeypatch.setattr(comparison, "COMPARISONS", (TOY,))
    monkeypatch.setattr(comparison, "run_paired_trials", measure)
    (tmp_path / "page.json").write_text(json.dumps([ROW]))
    (tmp_path / "page.md").write_text("An old page.")
    return tmp_path / "page.md"


def test_rows_of_other_tasks_stay(page: Path, call: Callable[..., Result]) -> None:
    for seeds, episodes in (("1..2", 2), ("1..5", 5)):  # What is measured again is replaced.
        found = figures(call("results", "--out", page, "--seeds", seeds, "--json"))
        rows = {row["agent"]: row["episodes"] for row in found["rows"]}
        assert rows == {"walker": 3, "oracle": episodes}
    assert json.loads(page.with_suffix(".json").read_text()) == found["rows"]
    text = page.read_text()
    assert "An old page." not in text
    assert "`walker`" in text
    assert "`oracle`" in text
    assert "albot results --seeds 1..5" in text


def test_figures_that_are_none_are_not_written_over(
    page: Path, call: Callable[..., Result]
) -> None:
    page.with_suffix(".json").write_text("{}")
    expect_error(call("results", "--out", page, "--seeds", "1..2"), "page.json")
    assert page.read_text() == "An old page."


def test_the_page_is_the_projects_only_in_a_clone(
    page: Path, call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = page.parent
    monkeypatch.chdir(folder)
    found = figures(call("results", "--seeds", "1..2", "--json"))
    assert found["files"] == {"page": "results.md", "figures": "results.json"}
    assert (folder / "results.md").is_file()
    (folder / "docs").mkdir()
    page.rename(folder / "docs" / "results.md")
    (folder / "page.json").rename(folder / "docs" / "results.json")
    found = figures(call("results", "--seeds", "1..2", "--json"))
    assert found["files"]["page"] == "docs/results.md"
    assert "docs/results.md in a clone" in " ".join(call("results", "--help").stdout.split())
