"""`albot train` as people call it, and what becomes of its agents."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from albot_agents.engine.local import LocalEngine
from albot_agents.training import recent_episodes, run_files, seed_processes, sweep
from albot_agents.training.checkpoint import checkpoints
from albot_agents.training.plan import LARGEST_SEED
from albot_agents.training.plan_file import read_plan, shipped_plan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_folder import SeedFolder, SeedRun
from albot_agents.training.sweep_folder import SweepFolder
from albot_cli import train
from albot_cli.main import main
from albot_core.config_document import parameters
from albot_core.errors import InputError
from tests.agents.training.tiny import TASK, plan_file
from tests.processes import ALBOT, running, wait_until

Albot = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Albot:
    """Runs the command: exit status, stdout and stderr."""

    def albot(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["albot", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return int(ended.value.code or 0), out, err

    return albot


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return plan_file(tmp_path / "plan.yml", n_timesteps=32)


def test_train_resume_evaluate_and_tell(
    run: Albot, config: Path, tmp_path: Path, in_process: None
) -> None:
    folder = tmp_path / "run"
    words = ("train", TASK, "--config", config, "--out", folder, "--seed", 5)
    status, out, err = run(*words, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert (found["samples"], found["seed"], found["stopped"]) == (32, 5, False)
    assert Path(found["checkpoint"]).is_file()

    status, out, err = run("train", "--resume", folder, "--steps", 48)
    assert (status, err) == (0, "")
    assert "48 samples" in out

    status, out, err = run("train", "--resume", folder, "--steps", 47)
    assert (status, out) == (2, "")
    assert err.endswith(
        "expected at least the 48 samples that are done, as the samples in all, found 47\n"
    )
    assert err.count("\n") == 1

    status, out, _ = run("agents", "card", found["files"]["last"], "--json")
    card, picture = map(Path, json.loads(out)["files"])
    assert f"albot train {TASK} --config {config}" in card.read_text()
    assert picture.is_file()

    parts = ("--worlds", "square-loop", "--seeds", "3", "--steps", 5, "--json")
    words = ("evaluate", TASK, "--agent", found["files"]["best"], "--outward", "1..2", *parts)
    status, out, err = run(*words)
    assert status == 0
    assert err.startswith("albot: --outward 1..2: a journey goes on")
    evaluation = json.loads(out)
    assert (evaluation["mapper"], evaluation["episodes"]) == ("none", 1)
    assert evaluation["world_specs"] == ["square-loop"]
    (tmp_path / "e.json").write_text(out)
    words = ("agents", "card", found["files"]["best"], "--evaluation", tmp_path / "e.json")
    assert run(*words)[0] == 0


def _one_after_the_other(runs: dict[int, SeedRun], jobs: int, reporter: Any) -> Any:
    """As `train_seeds`, in this process."""
    for seed, (folder, plan) in runs.items():
        TrainingRun(folder, plan).run(reporter.begin(seed, 0))
    return {}, False


def test_several_seeds_give_one_curve(
    run: Albot, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seed_processes, "train_seeds", _one_after_the_other)
    folder = tmp_path / "runs" / "mine"
    status, out, err = run("train", config, "--seeds", "2,5", "--out", folder, "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert [(row["seed"], row["samples"], row["finished"]) for row in found["runs"]] == [
        (2, 32, True),
        (5, 32, True),
    ]
    assert found["curve"]["seeds"] == [2, 5]
    mean, lowest, highest = found["curve"]["return"]
    each = [row["figures"]["return"] for row in found["runs"]]
    assert (mean, lowest, highest) == (sum(each) / 2, min(each), max(each))
    assert sorted(path.name for path in folder.iterdir()) == [
        "config.yml", "curve.csv", "curve.json", "curve.png", "seed-2", "seed-5", "seeds.json",
    ]  # fmt: skip

    # Those that have ended are left as they are; the curve is made again.
    before = {path: path.stat().st_mtime_ns for path in folder.glob("seed-*/*.albot")}
    (folder / "curve.png").unlink()
    status, out, err = run("train", "--resume", folder)
    assert (status, err) == (0, "")
    assert "2 seeds (2, 5)" in out
    assert before == {path: path.stat().st_mtime_ns for path in folder.glob("seed-*/*.albot")}
    assert Path(found["files"]["png"]).is_file()

    status, out, _ = run("agents", "curve", folder, "--json", "--figure", tmp_path / "curve.pdf")
    assert (status, json.loads(out)["seeds"]) == (0, [2, 5])
    assert (tmp_path / "curve.pdf").is_file()
    one_by_one = (folder / "seed-2", folder / "seed-5")
    assert "--out: expected a folder, for the curve" in run("agents", "curve", *one_by_one)[2]
    status, out, _ = run("agents", "curve", *one_by_one, "--out", tmp_path / "curves")
    assert (status, len(out.splitlines())) == (0, 4)
    table = (tmp_path / "curves" / "curve.csv").read_text()
    assert table == (folder / "curve.csv").read_text()
    assert "--force" in run("agents", "curve", folder, "--out", tmp_path / "curves")[2]
    files = [each / "last.albot" for each in one_by_one]
    assert "--out: expected a folder, for the curve" in run("agents", "curve", files[0])[2]
    assert run("agents", "curve", *files, "--out", tmp_path / "curves", "--force")[0] == 0
    assert (tmp_path / "curves" / "curve.csv").read_text() == table

    best = found["runs"][1]["files"]["best"]
    status, out, _ = run("agents", "card", best, "--runs", folder, "--json")
    card, _ = map(Path, json.loads(out)["files"])
    assert "This agent is that of seed 5, of 2 seeds (2, 5)." in card.read_text()
    others = run("agents", "card", best, "--runs", folder / "seed-2", "--force")
    assert "--runs: expected the run of the agent's seed, 5, too, found 2" in others[2]

    again = run("train", config, "--seeds", "3", "--out", folder)
    assert "expected a folder without runs" in again[2]
    again = run("train", config, "--out", folder)
    assert "expected a folder without runs" in again[2]


def test_the_curve_shows_those_that_did_not_fail(
    run: Albot, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_fails(runs: dict[int, SeedRun], jobs: int, reporter: Any) -> Any:
        _one_after_the_other({5: runs[5]}, jobs, reporter)
        return {2: InputError("disk", "room")}, False

    monkeypatch.setattr(seed_processes, "train_seeds", one_fails)
    status, out, err = run("train", config, "--seeds", "2,5", "--out", tmp_path / "mine")
    assert (status, out) == (2, "")
    assert err == (
        f"albot: {tmp_path / 'mine'}: expected runs that come to their end, found errors with "
        "seed 2, as told above\n"
    )
    facts = json.loads((tmp_path / "mine" / "curve.json").read_text())
    assert facts["seeds"] == [5]


def test_ctrl_c_stops_all_seeds_and_they_go_on(
    run: Albot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan_file(tmp_path / "plan.yml", n_timesteps=1_000_000, evaluation=None)
    folder = tmp_path / "mine"
    words = ("train", "plan.yml", "--seeds", "0..1", "--out", "mine", "--json")
    with running([*ALBOT, *words], tmp_path) as process:
        wait_until((folder / "seed-0" / "last.albot").exists)
        os.killpg(process.pid, signal.SIGINT)  # As the terminal does: all processes get it.
        out, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (130, b"")
    found = json.loads(out)
    assert (found["stopped"], found["files"]) == (True, {})
    done, none = (row["samples"] for row in found["runs"])
    assert 0 == none < done < 1_000_000
    assert checkpoints(folder / "seed-0" / "checkpoints")[-1].stem == f"{done:012d}"

    monkeypatch.setattr(seed_processes, "train_seeds", _one_after_the_other)
    status, out, err = run("train", "--resume", folder, "--steps", done + 16, "--json")
    assert (status, err) == (0, "")
    assert [row["samples"] for row in json.loads(out)["runs"]] == [done + 16] * 2


@pytest.mark.parametrize(
    "name", [file.name for file in (resources.files("albot_agents.training") / "configs").iterdir()]
)
def test_a_plan_is_printed_and_given_back(run: Albot, tmp_path: Path, name: str) -> None:
    task = f"Albot/{name.removesuffix('.yml')}"
    status, out, err = run("train", task, "--print-plan", "--seed", 7)
    assert (status, err) == (0, "")
    assert "\n# Discount factor per step.\ngamma: " in out
    file = tmp_path / "plan.yml"
    file.write_text(out)
    plan = read_plan(file, tried=False)
    assert plan == shipped_plan(task, tried=False, seed=7)
    assert all(parameter.meaning for parameter in parameters(plan))
    assert run("train", file, "--print-plan") == (0, out, "")
    status, out, _ = run("train", file, "--print-plan", "--json", "--steps", 9)
    assert (status, json.loads(out)["n_timesteps"]) == (0, 9)


@pytest.mark.parametrize(
    ("was", "becomes", "told"),
    [
        ("gamma: 0.995", "gamma: 2", "gamma: expected a number within [0, 1], found 2"),
        ("n_steps:", "nsteps:", "(did you mean n_steps?)"),
    ],
)
def test_a_wrong_plan_is_one_error(
    run: Albot, tmp_path: Path, was: str, becomes: str, told: str
) -> None:
    text = run("train", TASK, "--print-plan")[1]
    file = tmp_path / "plan.yml"
    file.write_text(text.replace(was, becomes))
    line = text[: text.index(f"\n{was}")].count("\n") + 2
    status, out, err = run("train", file)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"plan.yml, line {line}, " in err
    assert told in err
    assert "beside the plan" in run("train", file, "--config", file)[2]
    assert "--print-plan" in run("train", "--resume", tmp_path, "--print-plan")[2]


def test_without_a_terminal_lines_tell_how_it_goes(
    run: Albot, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train, "_EVERY", 0.0)
    monkeypatch.setattr(recent_episodes, "ENOUGH", 1)
    words = ("train", config, "--out")
    status, out, err = run(*words, tmp_path / "run")
    assert status == 0
    last = err.splitlines()[-1]
    assert f"train {TASK}: 32 of 32 samples, " in last
    for parts in ("samples/s", " left, ", " episodes, ", "return ", "% success"):
        assert parts in last
    for flag in ("--quiet", "--json"):
        status, out, err = run(*words, tmp_path / flag, flag)
        assert (status, err) == (0, "")
    json.loads(out)


def test_ctrl_c_says_how_to_go_on(
    run: Albot, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from albot_agents.training.curriculum import Curriculum

    step = Curriculum.step_wait

    def interrupted(course: Curriculum) -> object:
        if course.episodes:
            raise KeyboardInterrupt
        return step(course)

    monkeypatch.setattr(Curriculum, "step_wait", interrupted)
    status, out, err = run("train", "--config", config, "--out", tmp_path / "run")
    assert (status, err) == (130, "")
    assert "stopped before the end" in out
    assert f"continue with: albot train --resume {tmp_path / 'run'}" in out
    assert list((tmp_path / "run" / "checkpoints").glob("*.checkpoint"))


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("Albot/Homming-v0",), "did you mean Albot/Homing-v0"),
        ((), "expected a TASK, a PLAN or --resume"),
        (("--config", "none.yml"), "none.yml: file not found"),
        (("--resume", "nowhere"), "nowhere: expected the folder of a training run"),
        (("--resume", "nowhere", "--seed", "3"), "--seed: expected no such option"),
        (("--resume", "nowhere", "--seeds", "3"), "--seeds: expected no such option"),
        (("--config", "{config}", "--seed", "3", "--seeds", "3"), "--seed: expected no such"),
        (("--config", "{config}", "--jobs", "2"), "--jobs: expected no such option without"),
        (("--config", "{config}", "--seeds", "1,1"), "--seeds: expected each seed once"),
        (("--config", "{config}", "--seeds", "4294967296"), "--seeds: expected seeds from 0 to"),
        (("--config", "{config}", "--seeds", "1", "--print-plan"), "--seeds: expected no such"),
        (
            ("--config", "{config}", "--seed", str(2**32)),
            "'--seed': 4294967296 is not in the range",
        ),
        (("--config", "{config}", "--out", "{config}"), "Invalid value for '--out'"),
        (("--config", "{config}", "--out", "{config}/x"), "expected a folder to write to"),
        (("Albot/Explore-v0", "--config", "{config}"), "task: expected Albot/Explore-v0"),
    ],
)
def test_bad_input_is_one_line(
    run: Albot, config: Path, words: tuple[str, ...], found: str
) -> None:
    words = tuple(word.format(config=config) for word in words)
    status, out, err = run("train", *words)
    assert (status, out) == (2, "")
    assert found in err
    assert err.count("\n") == 1


SWEEP = {"parameters": {"gamma": {"choices": [0.9, 0.99]}}, "trials": None, "metric": "return"}


def _swept(folder: SweepFolder, plan: Any, runs: dict[int, SeedRun], engine: Any, to: Any) -> Any:
    """As `run_sweep`, in this process."""
    for number, (run, its) in runs.items():
        TrainingRun(run, its).run()
        to.progress((number + 1) * plan.n_timesteps, "a note")
    folder.end(1)
    return {}, True


def test_a_sweep_tells_its_trials_and_goes_on(
    run: Albot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep, "run_sweep", _swept)
    monkeypatch.setattr(train, "make_engine", lambda *_: LocalEngine(1))
    plan, folder = plan_file(tmp_path / "plan.yml", sweep=SWEEP), tmp_path / "out"
    status, out, err = run("train", plan, "--out", folder)
    assert (status, out) == (2, "")
    assert err.endswith("--engine: expected ray, for the trials of the plan's sweep, found local\n")
    status, _, err = run("train", plan, "--out", folder, "--seeds", "0..1")
    assert status == 2
    assert "--seeds: expected no such option with a plan that has a sweep" in err
    assert not folder.exists()

    status, out, err = run("train", plan, "--out", folder, "--engine", "ray")
    assert (status, err) == (130, "")
    assert "2 trials, stopped before the end" in out
    assert f"continue with: albot train --resume {folder} --engine ray" in out
    assert "64 samples, ended early" in out

    status, out, _ = run("train", "--resume", folder, "--engine", "ray", "--json")
    found = json.loads(out)
    assert status == 130
    assert [row["values"] for row in found["trials"]] == [{"gamma": 0.9}, {"gamma": 0.99}]
    assert [row["ended_early"] for row in found["trials"]] == [False, True]
    scores = [row["best"] for row in found["trials"]]
    best = max(range(2), key=lambda k: (scores[k], -k))
    agent = str(folder / f"trial-{best}" / "best.albot")
    assert found["best"] == {"trial": best, "score": scores[best], "agent": agent}
    assert Path(agent).is_file()

    status, _, err = run("train", "--resume", folder, "--engine", "ray", "--steps", 100)
    assert status == 2
    assert "--steps: expected no such option with the --resume of a sweep" in err
    status, _, err = run("train", plan, "--out", folder, "--engine", "ray")
    assert status == 2
    assert "found those of several seeds or trials" in err


def test_where_no_cluster_answers_no_folder_is_made(run: Albot, tmp_path: Path) -> None:
    words = ("--engine", "ray", "--address", "localhost:1", "--out", tmp_path / "out")
    one = plan_file(tmp_path / "one.yml")
    search = plan_file(tmp_path / "search.yml", sweep=SWEEP)
    for plan in ((one, "--seeds", "0..1"), (search,)):
        status, out, err = run("train", *plan, *words)
        assert (status, out) == (2, "")
        assert "--address: expected the head of a Ray cluster, found nothing that answers" in err
        assert not (tmp_path / "out").exists()


def test_two_processes_do_not_train_in_one_folder(
    run: Albot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: None
) -> None:
    monkeypatch.setattr(run_files, "_PATIENCE", 0.0)
    monkeypatch.setattr(train, "make_engine", lambda *_: LocalEngine(1))
    plan, search = plan_file(tmp_path / "plan.yml"), plan_file(tmp_path / "s.yml", sweep=SWEEP)
    one, some = RunFolder(tmp_path / "run"), SeedFolder(tmp_path / "seeds")
    swept = SweepFolder(tmp_path / "sweep")
    one.begin(read_plan(plan), "albot train")
    some.begin(read_plan(plan), (1, 2), "albot train")
    swept.begin(read_plan(search), "albot train", search)
    for folder, words in ((one, ()), (some, ()), (swept, ("--engine", "ray"))):
        before = {path: path.stat().st_mtime_ns for path in folder.path.rglob("*")}
        with folder.locked():
            status, out, err = run("train", "--resume", folder.path, *words)
        assert (status, out) == (2, "")
        assert f"{folder.path}: expected a folder that no other process writes into" in err
        assert {path: path.stat().st_mtime_ns for path in folder.path.rglob("*")} == before


def test_the_largest_seed_trains(run: Albot, config: Path, tmp_path: Path) -> None:
    words = ("train", "--config", config, "--out", tmp_path / "run", "--json", "--quiet")
    status, out, err = run(*words, "--seed", LARGEST_SEED)
    assert (status, err) == (0, "")
    assert json.loads(out)["seed"] == LARGEST_SEED == 2**32 - 1


def test_a_plan_that_is_refused_leaves_no_folder(run: Albot, tmp_path: Path) -> None:
    plan = plan_file(tmp_path / "bad.yml", policy={"initial_action": [1]})
    status, out, err = run("train", "--config", plan, "--out", tmp_path / "run")
    assert (status, out) == (2, "")
    assert "bad.yml, line" in err
    assert "policy.initial_action: expected 3 numbers, found 1" in err
    assert not (tmp_path / "run").exists()


def test_a_run_may_stand_in_a_folder_that_is_not_there_yet(
    run: Albot, config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (("--out", "deep/runs/mine"), ()):
        status, _, err = run("train", "--config", config, "--quiet", *words)
        assert (status, err) == (0, "")
    assert Path("deep/runs/mine/last.albot").is_file()
    assert Path("runs/Homing-v0-ppo-1/last.albot").is_file()


def test_what_is_not_installed_is_told(run: Albot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train, "_NEEDED", ("torch", "no_such_package"))
    status, _, err = run("train", TASK)
    assert status == 2
    assert "in a clone of the project: pip install -c constraints.txt '.[train]'" in err
    assert "no no_such_package" in err
