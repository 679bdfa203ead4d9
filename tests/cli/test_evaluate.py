"""`albot evaluate` and `albot agents` as people call them, worker processes included."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from albot_agents.engine import choice
from albot_agents.engine.engine import Crash
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_cli.main import main
from tests.inline_engine import InlineEngine, stopping_after

TINY = ("--worlds", "square-loop", "--outward", "5..6", "--steps", "15")
KEYS = {
    "task", "agent", "episodes", "success_rate", "ci95", "spl", "soft_spl",
    "mean_final_distance_m", "collisions_per_m", "worlds",
}  # fmt: skip


Albot = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Albot:
    """Runs the command: exit status, stdout and stderr."""

    def albot(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["albot", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return int(ended.value.code or 0), out, err

    return albot


def test_the_whole_command_with_workers(run: Albot, tmp_path: Path) -> None:
    status, out, err = run(
        "evaluate", "Albot/Homing-v0", "--agent", "random", "--seeds", "3..4", "--jobs", "2",
        "--out", str(tmp_path / "new"), "--json", *TINY,
    )  # fmt: skip
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert found.keys() >= KEYS
    assert (found["episodes"], found["task"]) == (2, "Albot/Homing-v0")
    assert [row["world"] for row in found["worlds"]] == ["square-loop"]
    assert found == json.loads((tmp_path / "new" / "evaluation.json").read_text())
    assert (tmp_path / "new" / "failures.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "new" / "episodes.csv").read_text().splitlines()) == 1 + 2


def test_no_picture_of_failures_if_nothing_failed(
    run: Albot, tmp_path: Path, in_process: None
) -> None:
    words = ("evaluate", "Albot/Homing-v0", "--agent", "oracle", "--seeds", "3..3", "--jobs", "1")
    out, figure = tmp_path / "new", tmp_path / "failures.pdf"
    out.mkdir()
    (out / "failures.png").write_text("of an earlier run")
    status, told, _ = run(*words, "--out", str(out), "--figure", str(figure), "--force", "--json")
    assert status == 0
    assert json.loads(told)["success_rate"] == 1.0
    assert json.loads(told)["files"].keys() == {"figures", "episodes"}
    assert {path.name for path in out.iterdir()} == {"evaluation.json", "episodes.csv"}
    assert not figure.exists()


def test_two_agents_in_the_same_episodes(run: Albot, tmp_path: Path, in_process: None) -> None:
    words = ("evaluate", "homing", "--agent", "path-integration", "--against", "homing", *TINY)
    status, out, err = run(*words, "--seeds", "3..5", "--out", str(tmp_path), "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert (found["agent"], found["episodes"]) == ("path-integration", 3)
    against = found["against"]
    assert (against["agent"], against["mapper"], against["episodes"]) == ("homing", "albot1", 3)
    difference = against["differences"]["soft_spl"]
    assert difference["mean"] == pytest.approx(found["soft_spl"] - against["soft_spl"])
    assert difference["ci95"][0] <= difference["mean"] <= difference["ci95"][1]
    with (tmp_path / "episodes.csv").open() as file:
        rows = list(csv.DictReader(file))
    agents = ("path-integration", "homing")
    assert [(row["agent"], row["seed"]) for row in rows] == [
        (agent, seed) for agent in agents for seed in ("3", "4", "5")
    ]
    for ours, theirs in zip(rows[:3], rows[3:], strict=True):
        for name in ("start", "begin", "initial_distance_home", "outward_length"):
            assert ours[name] == theirs[name]
    status, out, _ = run(*words, "--seeds", "3..5")
    assert "less homing, mapper albot1, in the same episodes" in out
    status, _, err = run(*words[:5], words[3], *TINY)
    assert (status, "--against: expected an agent other than path-integration" in err) == (2, True)


def test_a_world_that_is_named_twice_is_run_once(run: Albot, in_process: None) -> None:
    words = ("evaluate", "homing", "--agent", "random", "--seeds", "3..4", "--json", *TINY)
    found = json.loads(run(*words, "--worlds", "square-loop", "--worlds", "office-ring")[1])
    assert found["episodes"] == 4
    assert [row["episodes"] for row in found["worlds"]] == [2, 2]


def test_a_full_disk_leaves_no_folder(
    run: Albot, tmp_path: Path, in_process: None, full_disk: None
) -> None:
    words = ("evaluate", "Albot/Homing-v0", "--agent", "random", "--seeds", "3", *TINY)
    status, _, err = run(*words, "--out", str(tmp_path / "new"))
    assert status == 2
    assert f"albot: cannot write {tmp_path / 'new' / 'episodes.csv'}: No space" in err
    assert not list(tmp_path.iterdir())


def test_the_same_seeds_give_the_same_figures(run: Albot, in_process: None) -> None:
    words = ("evaluate", "Albot/Homing-v0", "--agent", "oracle", "--seeds", "3", "--json", *TINY)
    one, other = (json.loads(run(*words)[1]) for _ in range(2))
    for figures in (one, other):
        figures.pop("seconds")
    assert one == other


def test_a_mapper_is_evaluated_with_other_thresholds(
    run: Albot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    tried: list[Any] = []

    engine = InlineEngine(lambda trial: tried.append(trial.settings["mapper_config"]))
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: engine)
    file = tmp_path / "thresholds.yaml"
    file.write_text("margin: 0.5\n")
    words = ("evaluate", "Albot/Explore-v0", "--agent", "gap-explorer", "--seeds", "3", "--json")
    words += ("--worlds", "square-loop", "--steps", "5", "--mapper-config", str(file))
    status, out, _ = run(*words)
    assert (status, json.loads(out)["mapper_config"]) == (0, str(file))
    assert [config.margin for config in tried] == [0.5]
    file.write_text("margins: 0.5\n")
    status, _, err = run(*words)
    assert status == 2
    assert "thresholds.yaml" in err and "did you mean margin" in err


def test_ctrl_c_tells_what_there_is(run: Albot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: stopping_after(1))
    status, out, _ = run(
        "evaluate", "Albot/Homing-v0", "--agent", "random", "--seeds", "3..9", "--json", *TINY
    )
    assert status == 130
    found = json.loads(out)
    assert (found["stopped"], found["episodes"]) == (True, 1)


@pytest.mark.parametrize(
    ("task", "agent", "texts"),
    [
        ("Homing-v0", "path-integration", ("success", "SPL", "from home", "covered")),
        ("ExploreAndHome-v1", "round-trip", ("success", "SPL", "from home", "covered")),
        ("Explore-v0", "random", ("covered", "exploring", "rooms")),
        ("PlaceRecognition-v0", "random", ("success", "places")),
    ],
)
def test_every_task_has_its_figures_in_words(
    run: Albot, in_process: None, task: str, agent: str, texts: tuple[str, ...]
) -> None:
    words = ("--worlds", "square-loop", "--seeds", "3..3", "--steps", "15", "--jobs", "1")
    status, out, err = run("evaluate", f"Albot/{task}", "--agent", agent, *words)
    assert (status, err) == (0, "")
    for word in texts:
        assert word in out


def test_a_trained_agent_with_another_mapper_is_told_of(run: Albot, in_process: None) -> None:
    words = ("evaluate", "Albot/Homing-v0", "--agent", "homing", "--seeds", "3", "--json", *TINY)
    status, out, err = run(*words, "--mapper", "none")
    assert status == 0
    untrained = "mapper none (trained with albot1)"
    assert err == f"albot: homing was not trained with {untrained}\n"
    assert json.loads(out)["untrained"] == [untrained]
    status, out, err = run(*words)
    assert (status, err, json.loads(out)["untrained"]) == (0, "", [])


def test_exploring_has_no_success(run: Albot, in_process: None) -> None:
    words = ("evaluate", "Albot/Explore-v0", "--agent", "gap-explorer", "--seeds", "1")
    status, out, _ = run(*words, "--worlds", "square-loop", "--steps", "15")
    assert status == 0
    assert "of the ground" in out
    assert "success" not in out
    assert "no recall: no place was seen again" in out  # So soon there is nothing to claim.


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("Albot/Homming-v0", "--agent", "random"), "did you mean Albot/Homing-v0"),
        (("Albot/Homing-v0", "--agent", "randon"), "did you mean random"),
        (
            ("Albot/Homing-v0", "--agent", "gap-explorer"),
            "found gap-explorer, which is for Albot/Explore-v0",
        ),
        (("Albot/Homing-v0", "--agent", "random", "--seeds", "5..3"), "--seeds: expected"),
        (("Albot/Homing-v0", "--agent", "random", "--seeds", "x"), "--seeds: expected A..B"),
        (("Albot/Homing-v0", "--agent", "random", "--worlds", "nowhere"), "world: expected"),
        (("Albot/Homing-v0", "--agent", "random", "--mapper", "albot9"), "albot9"),
        (("Albot/Homing-v0", "--agent", "random", "--noise", "loud"), "loud"),
        (("Albot/Homing-v0", "--agent", "random", "--outward", "9..3"), "--outward: expected"),
        (("Albot/Explore-v0", "--agent", "random", "--outward", "1..3"), "has an outward journey"),
        (("homing", "--agent", "random", "--outward", "1..1000000"), "--outward: expected lengths"),
    ],
)
def test_bad_input_is_one_line(run: Albot, words: tuple[str, ...], found: str) -> None:
    status, out, err = run("evaluate", *words)
    assert (status, out) == (2, "")
    assert found in err
    assert err.count("\n") == 1


class _Crashing(InlineEngine):
    """Every process dies in its third step where the seed is 4."""

    def run(self, work: Any, tasks: Iterable[Any], *, fresh: bool = False) -> Any:
        crash = Crash(step=3, cause="the process died: signal SIGKILL", tries=4)
        for done in super().run(work, tasks):
            trials = done.task if isinstance(done.task, list) else [done.task]
            seeds = {trial.seed for trial in trials}
            yield replace(done, result=crash) if 4 in seeds else done


@pytest.mark.parametrize("batch", ["1", "2"])
def test_what_crashes_is_listed_with_its_command(
    run: Albot, monkeypatch: pytest.MonkeyPatch, batch: str
) -> None:
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: _Crashing())
    words = ("evaluate", "explore", "--agent", "random", "--worlds", "square-loop")
    words += ("--seeds", "2..5", "--steps", "5", "--batch", batch)
    status, out, _ = run(*words, "--json")
    found = json.loads(out)
    failed = [4] if batch == "1" else [4, 5]
    assert (status, found["episodes"]) == (1, 4 - len(failed))
    assert [each["seed"] for each in found["failed"]] == failed
    first = found["failed"][0]
    assert (first["step"], first["what"]) == (3, "the process died: signal SIGKILL")
    assert first["command"].endswith("--agent random --seed 4 --steps 3")
    assert first["command"].startswith("albot play Albot/Explore-v0 --world square-loop")
    status, out, _ = run(*words)
    assert f"failed: random in square-loop, seed 4, step 3: {first['what']}, 4 times\n" in out
    assert f"  {first['command']}" in out


def test_a_trial_tells_its_steps() -> None:
    settings = {"mapper": "none", "max_episode_steps": 4, "journeys": 1}
    from tests.env.quick import STROLL

    trial = Trial(
        task="Albot/Homing-v0", agent="path-integration", world="square-loop", seed=1,
        settings={**settings, "config": STROLL},
    )  # fmt: skip
    steps: list[int] = []
    outcome = run_trial(trial, steps.append)
    assert isinstance(outcome, Outcome)
    assert steps == list(range(len(outcome.path)))
    assert outcome.driven == pytest.approx(outcome.info["way_driven"])


def test_the_agents_are_listed(run: Albot) -> None:
    status, out, _ = run("agents", "list", "--json")
    rows = json.loads(out)["agents"]
    assert status == 0
    assert {row["name"] for row in rows} >= {"random", "path-integration", "oracle"}
    assert [row["name"] for row in rows if row["knows_truth"]] == ["oracle"]
    status, out, _ = run("agents", "list")
    assert len(out.splitlines()) == len(rows)
