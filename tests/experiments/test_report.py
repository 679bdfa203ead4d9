"""Reports read well: figures in tables, pages over them, pictures small."""

from __future__ import annotations

import dataclasses
import importlib
import json
import math
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from PIL import Image

from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.trained_agent import shipped_agents
from albot_core.errors import InputError
from albot_env.tasks.probe.task import PROBES
from albot_experiments.registry import EXPERIMENTS
from albot_experiments.report import Report, index, read_report, rows, write_index

PAGE = Path(__file__).parents[2] / "docs" / "experiments.md"
SPREAD = {"median": 0.25, "worst": 1.5}
REPORT = Report(
    id="one-e1",
    title="One",
    paper={"error_m": SPREAD, "kept": True},
    measured={
        "kept": False,
        "error_m": SPREAD,
        "ring": {"views": 7, "error_m": SPREAD},
        "hall": {"views": 9, "error_m": None},
    },
    holds=False,
)


def test_figures_are_named_after_what_they_stand_in() -> None:
    assert rows(REPORT.measured)[:3] == [
        ("kept", False),
        ("error_m", "0.25 (worst 1.5)"),
        ("ring, views", 7),
    ]


def test_groups_of_the_same_figures_make_one_table() -> None:
    page = REPORT.as_markdown()
    assert "| kept | yes | no |\n| error_m | 0.25 (worst 1.5) | 0.25 (worst 1.5) |" in page
    assert (
        "| | views | error_m |\n|---|---|---|\n| ring | 7 | 0.25 (worst 1.5) |\n| hall | 9 | – |"
    ) in page
    assert "Not reached." in page


def test_the_page_links_every_report(tmp_path: Path) -> None:
    written = write_index([REPORT], tmp_path / "runs")
    assert written == tmp_path / "runs.md"
    page = written.read_text()
    assert "| [one-e1](runs/one-e1/report.md) | One | – | no |" in page
    assert "| error_m | 0.25 (worst 1.5) | 0.25 (worst 1.5) |" in page
    assert page == index([REPORT], "runs")


def test_the_letter_and_ours_are_judged_in_columns_of_their_own() -> None:
    verdicts = {"one-thesis": False, "two-paper": True, "one": True}
    page = index([dataclasses.replace(REPORT, verdicts=verdicts)], "runs")
    assert "| One | one-thesis: no, two-paper: yes | one: yes |" in page


def test_the_paper_s_conditions_stand_beside_ours(tmp_path: Path) -> None:
    conditions = {"speed": ("0.3 m/s", "0.5 m/s"), "trials": ("2", "20")}
    dataclasses.replace(REPORT, conditions=conditions).write(tmp_path)
    assert ("| conditions | paper | here |\n|---|---|---|\n| speed | 0.3 m/s | 0.5 m/s |") in (
        tmp_path / "report.md"
    ).read_text()
    assert read_report(tmp_path).conditions == conditions


def test_the_trained_agents_of_a_report_are_known(tmp_path: Path) -> None:
    trained = {"homing": "0123456789abcdef"}
    dataclasses.replace(REPORT, trained=trained).write(tmp_path)
    assert "files: `homing` `01234567`.\n" in (tmp_path / "report.md").read_text()
    assert read_report(tmp_path).trained == trained


def test_a_report_that_was_written_makes_the_same_page(tmp_path: Path) -> None:
    figure = Figure(figsize=(1, 1))
    report = dataclasses.replace(REPORT, text="How: so.", pictures={"maps": figure, "b": figure})
    report.write(tmp_path)
    assert index([read_report(tmp_path)], "runs") == index([report], "runs")
    (tmp_path / "report.md").unlink()
    with pytest.raises(InputError, match="expected a report"):
        read_report(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("result.json", "{", r"result\.json, line 1: expected valid JSON"),
        ("result.json", "[]", r"result\.json: expected a mapping"),
        ("result.json", '{"id": 3}', r"result\.json, id: expected text, found 3"),
        ("result.json", '{"id": "a", "paper": {}}', r"result\.json, measured: expected a value"),
        ("report.md", "", r"report\.md: expected a heading .* found an empty file"),
        ("report.md", "words", r"report\.md: expected a heading .* found words"),
        ("report.md", b"\xff\xfd", r"report\.md: expected a heading"),
        ("report.md", b"\xff\xfe", r"report\.md: expected UTF-8 text, found UTF-16"),
    ],
)
def test_a_damaged_report_is_refused(
    tmp_path: Path, name: str, content: str | bytes, message: str
) -> None:
    REPORT.write(tmp_path)
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=message):
        read_report(tmp_path)


def test_a_figure_that_is_not_finite_is_not_known(tmp_path: Path) -> None:
    measured = {"error_m": {"median": 0.25, "worst": math.inf}, "share": math.nan, "count": 3}
    report = dataclasses.replace(REPORT, measured=measured)
    report.write(tmp_path)
    known = {"error_m": {"median": 0.25, "worst": None}, "share": None, "count": 3}
    assert json.loads((tmp_path / "result.json").read_text())["measured"] == known
    assert rows(report.measured)[0] == ("error_m", "0.25 (worst –)")
    assert index([read_report(tmp_path)], "runs") == index([report], "runs")


def test_pictures_are_small_and_keep_their_colours(tmp_path: Path) -> None:
    figure = Figure(figsize=(4, 4))
    figure.add_axes((0, 0, 1, 1)).fill([0, 1, 1, 0], [0, 0, 1, 1], color="#0a8a5f")
    report = Report(id="x", title="x", paper={}, measured={}, holds=True, pictures={"p": figure})
    report.write(tmp_path)
    with Image.open(tmp_path / "p.png") as picture:
        assert picture.mode == "P"
        assert picture.convert("RGB").getpixel((160, 160)) == (0x0A, 0x8A, 0x5F)


WITHOUT_PAPERS_FIGURES = ("hssh-gateways", "hssh-homing")


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_is_its_module(name: str) -> None:
    experiment = EXPERIMENTS[name]
    module = importlib.import_module(experiment.module)
    if experiment.task:
        assert name == experiment.id == module.experiment_id(experiment.task)
        assert experiment.task in PROBES
    else:
        assert name == experiment.id == module.ID
        assert bool(module.PAPER) != (name in WITHOUT_PAPERS_FIGURES)
    assert experiment.seeds >= (5 if name == "hssh-gateways" else 20)  # Of each of 14 plans.


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_page_in_docs_says_what_the_report_says(name: str) -> None:
    report = read_report(PAGE.parent / "experiments" / name)
    task, module = EXPERIMENTS[name].task, importlib.import_module(EXPERIMENTS[name].module)
    paper, title = (module.PAPERS.get(task, {}), PROBES[task].scene.title) if task else (
        module.PAPER, module.TITLE,
    )  # fmt: skip
    assert report.paper == paper
    assert report.title == title
    # Other conditions depend on the seeds.
    assert report.conditions == getattr(module, "CONDITIONS", report.conditions)
    # Of the agents as they are shipped now: one that was trained again is measured again.
    present = [agent for agent in shipped_agents() if agent in report.measured]
    assert report.trained.keys() == set(present)
    for agent in present:
        assert report.trained[agent] == read_agent(shipped_agents()[agent]).fingerprint
    row = next(line for line in index([report], "experiments").splitlines() if name in line)
    section = index([report], "experiments").split("## ")[1].split("![")[0].strip()
    page = PAGE.read_text()
    assert row in page
    assert section in page
    assert report.measured["seeds"] == EXPERIMENTS[name].seeds
