"""The table of results: who meets whom, what is kept, and what the page says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from albot_agents.evaluation import comparison
from albot_agents.evaluation.comparison import (
    OFFICES,
    PLANS,
    Comparison,
    Figures,
    PairedTrials,
    TableRow,
    plan_paired_trials,
    run_paired_trials,
)
from albot_agents.evaluation.results_page import read_figures, render_page, save_figures
from albot_cli.main import main
from albot_core.errors import InputError
from tests.env.quick import STROLL

SHORT = Comparison(
    task="Albot/Homing-v0",
    agents=("random", "path-integration"),
    figure="spl",
    kinds=(OFFICES, PLANS),
    settings={"journeys": 4, "config": STROLL, "max_episode_steps": 20},
)


def test_all_agents_meet_in_each_world_with_each_seed() -> None:
    worlds = {OFFICES: ["square-loop", "office-ring"]}
    planned = plan_paired_trials([SHORT], worlds, {OFFICES: range(5, 8)})
    assert len(planned) == 6
    for paired in planned:
        assert [row.agent for row in paired.rows] == list(SHORT.agents)
        assert [trial.agent for trial in paired.trials] == list(SHORT.agents)
        assert len({(trial.world, trial.seed) for trial in paired.trials}) == 1
        assert {trial.settings["odometer"] for trial in paired.trials} == {"pioneer"}


def test_agents_that_meet_begin_at_the_same_place_and_figures_are_of_all(tmp_path: Path) -> None:
    planned = plan_paired_trials([SHORT], {OFFICES: ["square-loop"]}, {OFFICES: range(2)})
    figures = run_paired_trials(planned, jobs=1)
    chance, integration = figures.values()
    assert chance["mean_initial_distance_m"] == integration["mean_initial_distance_m"]
    assert chance["episodes"] == integration["episodes"] == 2

    path = tmp_path / "results.json"
    path.write_text(
        json.dumps(
            [
                {
                    "task": task,
                    "agent": "a",
                    "odometer": "o",
                    "kind": "k",
                    "command": "c",
                    "figure": "spl",
                }
                | {"episodes": 3, "spl": 0.5}
                for task in ("Albot/Homing-v0", "Albot/Explore-v0")
            ]
        )
    )
    rows = save_figures(figures, "albot results", path)
    assert rows == read_figures(path)
    # Homing comes first on the page, though it was measured last.
    assert [row["task"] for row in rows] == [*2 * ["Albot/Homing-v0"], "Albot/Explore-v0"]
    assert rows[0]["success_rate"] == chance["success_rate"]
    # The first agent is what others are compared with.
    assert "difference" not in rows[0]
    low, high = rows[1]["difference_ci95"]
    assert low <= rows[1]["difference"] == integration["spl"] - chance["spl"] <= high
    text = render_page(rows)
    assert "| k | o | `a` | 3 | 0.50 | – |" in text
    assert "| SPL less the first's |" in text
    assert "albot results" in text


def test_rates_are_written_with_their_intervals() -> None:
    row = {"task": "T", "agent": "a", "odometer": "o", "kind": "k", "command": "c", "episodes": 9}
    row["figure"] = "spl"
    row |= {"success_rate": 0.5, "ci95": [0.25, 0.75], "spl": 0.123}
    text = render_page([row | {"difference": -0.02, "difference_ci95": [-0.1, 0.06]}])
    assert "| k | o | `a` | 9 | 50% (25%–75%) | 0.12 | -0.02 (-0.10 to +0.06) |" in text


def test_a_row_without_a_figure_that_others_have_shows_a_dash(tmp_path: Path) -> None:
    judged, silent = (
        TableRow(task="T", agent=agent, odometer="o", kind="k", figure="recall")
        for agent in ("judge", "silent")
    )
    figures = {
        judged: {"episodes": 2, "precision": 0.5, "recall": 0.25},
        silent: {"episodes": 2, "precision": None, "recall": 0.0},
    }
    rows = save_figures(figures, "c", tmp_path / "results.json")
    text = render_page(rows)
    assert "| k | o | `judge` | 2 | 50.0% | 25% | – |" in text
    assert "| k | o | `silent` | 2 | – | 0% | – |" in text


def test_a_row_of_an_unknown_figure_is_refused(tmp_path: Path) -> None:
    row = {"task": "T", "agent": "a", "odometer": "o", "kind": "k", "command": "c", "episodes": 9}
    path = tmp_path / "results.json"
    path.write_text(json.dumps([row | {"figure": "speed"}]))
    with pytest.raises(InputError, match=r"results\.json, \[0\]\.figure: expected one of success"):
        read_figures(path)


@pytest.mark.parametrize("text", ["{", "{}", '[{"task": 1}]', '["row"]', "[1]"])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "results.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"results\.json"):
        read_figures(path)


def test_the_command_refuses_before_it_works(
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(comparison, "COMPARISONS", (SHORT,))
    (tmp_path / "notes.md").write_text("mine")
    plans = tmp_path_factory.mktemp("plans")
    (plans / "a.xml").write_text("")
    (plans / "docs").mkdir()
    monkeypatch.chdir(plans)  # What is refused too late writes no page of the project's.
    for words, said in (
        (["--task", "Albot/Homing-v1"], "did you mean Albot/Homing-v0"),
        (["--task", "explore"], "--task: expected one of Albot/Homing-v0, found Albot/Explore-v0"),
        (["--task", "homing", "--seeds", "1.."], "--seeds: expected A..B"),
        (["--out", str(tmp_path / "page.json")], "--out: expected a name that ends in .md"),
        (["--out", str(tmp_path / "notes.md")], "expected a page with its figures in notes.json"),
        (["--seeds", "5..3"], "--seeds"),
        (["--out", str(tmp_path)], "directory"),
        (["--plan-seeds", "1..2"], "--plan-seeds: expected --plans"),
        (["--plans", str(tmp_path)], "--plans: expected a folder of floor plans in XML"),
        (["--plans", str(plans), "--plan-seeds", "5..3"], "--plan-seeds: expected a range A..B"),
    ):
        monkeypatch.setattr("sys.argv", ["albot", "results", *words])
        with pytest.raises(SystemExit) as stopped:
            main()
        assert stopped.value.code == 2
        assert said in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["notes.md"]


def test_ctrl_c_keeps_the_tasks_that_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured: list[PairedTrials] = []

    def stop_at_the_second(planned: list[PairedTrials], jobs: int, tell: object) -> Figures:
        if measured:
            raise KeyboardInterrupt
        measured.extend(planned)
        return {planned[0].rows[0]: {"episodes": 1, "success_rate": 1.0}}

    monkeypatch.setattr(comparison, "COMPARISONS", (SHORT, SHORT))
    monkeypatch.setattr(comparison, "run_paired_trials", stop_at_the_second)
    out = tmp_path / "page.md"
    monkeypatch.setattr("sys.argv", ["albot", "results", "--seeds", "1..1", "--out", str(out)])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 130
    assert "| 100% " in out.read_text()
    assert len(read_figures(tmp_path / "page.json")) == 1


def test_no_agent_comes_home_by_a_shorter_way_than_the_oracle() -> None:
    """In no row of the page has an agent a mean SPL above the oracle's by more than chance."""
    page = Path(__file__).parents[3] / "docs" / "results.json"
    rows = [row for row in read_figures(page) if row["task"] == "Albot/Homing-v0"]
    assert {row["agent"] for row in rows} > {"oracle", "albot1-homing", "homing"}
    for row in rows:
        if row["agent"] == "oracle":
            assert row["spl"] > 0.98, row["kind"]
        else:
            assert not row["difference_ci95"][0] > 0, (row["kind"], row["agent"])
