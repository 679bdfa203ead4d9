"""Reports of experiments in the terminal: aligned, in words, within a line's width, all figures."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from albot_cli.experiment_tables import WIDTH, in_words, report_text, table_lines
from albot_experiments.registry import EXPERIMENTS
from albot_experiments.report import Report, cell, read_report, rows

REPORTS = Path(__file__).parents[2] / "docs" / "experiments"


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("seeds", "seeds"),
        ("path_error_m", "path error (m)"),
        ("turn_error_where_lost_deg", "turn error where lost (°)"),
        ("longest_elsewhere_s", "longest elsewhere (s)"),
        ("within_0.4_m", "within 0.4 m"),
        ("within_1.6_m_disturbed", "within 1.6 m disturbed"),
        ("albot1_thesis_path_error_m", "albot1-thesis path error (m)"),
        ("large_room_one_asr", "large room one ASR"),
        ("Freiburg 101_path_error_m", "Freiburg 101 path error (m)"),
        ("ring, backwards, path_m", "ring, backwards, path (m)"),
        ("home_m", "home (m)"),
        ("m", "m"),
        ("40° right", "40° right"),
        ("low", "from (95 %)"),
    ],
)
def test_keys_in_words(key: str, words: str) -> None:
    assert in_words(key) == words


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_report_fits_and_has_all_its_figures(name: str) -> None:
    report = read_report(REPORTS / name)
    text = report_text(report)
    assert max(map(len, text.splitlines())) <= WIDTH
    assert "_" not in text
    shown = text.split()
    for _, value in (*rows(report.measured), *rows(report.paper)):
        for word in cell(value).split():
            assert word in shown
            shown.remove(word)


def test_a_report_is_ours_beside_the_papers_and_the_verdicts() -> None:
    report = Report(
        id="toy",
        title="A toy",
        paper={"error_m": 1.5},
        measured={
            "error_m": {"median": 1.25, "worst": 2.0},
            "albot1": {"shape_kept": True, "turn_deg": 0.5},
            "odometry": {"shape_kept": False, "turn_deg": None},
        },
        holds=True,
        verdicts={"albot1": True, "albot1-thesis": False},
    )
    assert report_text(report).splitlines() == [
        "toy: A toy",
        "",
        "                     ours  paper",
        "error (m)  1.25 (worst 2)    1.5",
        "",
        "          shape kept  turn (°)  reached",
        "albot1           yes       0.5      yes",
        "odometry          no         –",
        "",
        "Reached by albot1.",
        "Not reached by albot1-thesis.",
    ]


@given(st.integers(1, 20), st.integers(1, 20))
def test_a_table_of_any_size_fits_and_loses_nothing(columns: int, height: int) -> None:
    table = [
        ["", *(f"head {k} of error (m)" for k in range(columns))],
        *(
            [f"row {j}, a name of some length", *(f"{j}/{k}" for k in range(columns))]
            for j in range(height)
        ),
    ]
    lines = table_lines(table)
    assert max(map(len, lines)) <= WIDTH
    assert sorted(word for line in lines for word in line.split() if "/" in word) == sorted(
        figure for row in table[1:] for figure in row[1:]
    )


def test_a_wide_table_is_exchanged_if_that_saves_parts() -> None:
    table = [["", *(f"figure{k}" for k in range(14))], *([f"m{j}", *"0" * 14] for j in range(2))]
    lines = table_lines(table)
    assert lines[0].split() == ["m0", "m1"]
    assert len(lines) == 15
