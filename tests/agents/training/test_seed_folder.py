"""Folders of several seeds: which seeds, and what is made and taken up again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from albot_agents.training.plan import LARGEST_SEED, TrainingPlan
from albot_agents.training.plan_file import read_plan
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_folder import SeedFolder, parse_seed_list
from albot_core.errors import InputError
from tests.agents.training.conftest import Trained
from tests.agents.training.tiny import plan_file


@pytest.mark.parametrize(
    ("text", "seeds"),
    [
        ("0..2", (0, 1, 2)),
        ("7", (7,)),
        ("0,3,7", (0, 3, 7)),
        ("5, 0..1", (5, 0, 1)),
        (str(LARGEST_SEED), (LARGEST_SEED,)),
    ],
)
def test_seeds_are_ranges_and_lists(text: str, seeds: tuple[int, ...]) -> None:
    assert parse_seed_list(text) == seeds


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "--seeds: expected A..B, .* or a list of these with commas, found nothing"),
        ("0,", "or a list of these with commas, found 0,"),
        ("-1", "or a list of these with commas, found -1"),
        ("2..0", "a range A..B with B at least A, or a list .*, found 2..0"),
        ("1,2,1", "expected each seed once, found 1 twice"),
        ("0..3,2", "expected each seed once, found 2 twice"),
        (str(LARGEST_SEED + 1), "expected seeds from 0 to 4294967295, found 4294967296"),
        ("0..999999,1000000..1999999", "expected 1 to 1,000,000 seeds, found more"),
    ],
)
def test_other_seeds_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_seed_list(text)


@pytest.fixture
def plan(tmp_path: Path) -> TrainingPlan:
    return read_plan(plan_file(tmp_path / "plan.yml"), tried=False)


def test_each_seed_has_a_run_of_its_own(plan: TrainingPlan, tmp_path: Path) -> None:
    folder = SeedFolder(tmp_path / "deep" / "mine")
    runs = folder.begin(plan, (3, 1), "albot train plan.yml --seeds 3,1")
    assert list(runs) == [3, 1]
    for seed, (run, its) in runs.items():
        assert run.path == folder.path / f"seed-{seed}"
        assert read_plan(run.plan, tried=False) == its
        assert its.seed == seed
        assert run.command == "albot train plan.yml --seeds 3,1"
        assert not run.is_finished(its)


def test_a_run_that_never_began_is_made(plan: TrainingPlan, tmp_path: Path) -> None:
    folder = SeedFolder(tmp_path / "mine")
    made = folder.begin(plan, (3, 1, 2), "albot train plan.yml --seeds 3,1,2")
    shutil.rmtree(made[1][0].path)
    again = folder.resume(None, n_timesteps=80)
    assert list(again) == [3, 1, 2]
    for seed, (run, its) in again.items():
        assert (its.seed, its.n_timesteps) == (seed, 80)
        assert read_plan(run.plan, tried=False) == its
        assert run.command == made[3][0].command


def test_folders_with_runs_are_not_begun_anew(
    plan: TrainingPlan, trained: Trained, tmp_path: Path
) -> None:
    folder = SeedFolder(tmp_path / "mine")
    folder.begin(plan, (3,), "")
    with pytest.raises(InputError, match=r"without runs \(or --resume .*mine\), found seeds.json"):
        folder.begin(plan, (4,), "")
    with pytest.raises(InputError, match=r"without runs .*, found monitor.csv"):
        SeedFolder(trained[0].path).begin(plan, (4,), "")
    assert not (folder.path / "seed-4").exists()


def test_where_one_run_cannot_go_on_nothing_is_changed(
    plan: TrainingPlan, trained: Trained, tmp_path: Path
) -> None:
    folder = SeedFolder(tmp_path / "mine")
    folder.begin(plan, (3, 0), "")
    shutil.rmtree(folder.run(0).path)
    shutil.copytree(trained[0].path, folder.run(0).path)
    before = {path: path.read_bytes() for path in folder.path.rglob("*.yml")}
    with pytest.raises(InputError, match="seed-0, --steps: expected at least the 64 samples"):
        folder.resume(None, n_timesteps=63)
    with pytest.raises(InputError, match=r"task: expected Albot/Explore-v0"):
        folder.resume("Albot/Explore-v0")
    assert before == {path: path.read_bytes() for path in folder.path.rglob("*.yml")}
    finished = {seed: run.is_finished(its) for seed, (run, its) in folder.resume(None).items()}
    assert finished == {3: False, 0: True}
    run, its = folder.resume(None, n_timesteps=65)[0]
    assert not run.is_finished(its)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "seeds.json, line 1: expected valid JSON"),
        ('{"seeds": [1]}', "seeds.json, command: expected a value, found none"),
        ('{"seeds": [1, 1], "command": ""}', "seeds.json: expected each seed once, found 1 twice"),
        ('{"seeds": [], "command": ""}', "seeds.json: expected 1 to 1,000,000 seeds, found none"),
        ('{"seeds": [-1], "command": ""}', "seeds.json: expected seeds from 0 to 4294967295"),
        ('{"seeds": ["../x"], "command": ""}', r"seeds.json, seeds\[0\]: expected a whole number"),
    ],
)
def test_damaged_seeds_are_refused(
    content: str, message: str, plan: TrainingPlan, tmp_path: Path
) -> None:
    folder = SeedFolder(tmp_path / "mine")
    folder.begin(plan, (1,), "")
    folder.seeds.write_text(content)
    with pytest.raises(InputError, match=message):
        folder.resume(None)


def test_a_run_without_its_last_evaluation_is_not_finished(
    trained: Trained, tmp_path: Path
) -> None:
    """As after Ctrl-C in that evaluation, when all samples were there."""
    run, plan = RunFolder(Path(shutil.copytree(trained[0].path, tmp_path / "a"))), trained[1]
    assert run.is_finished(plan)
    from dataclasses import replace

    from albot_agents.trained.agent_file import read_agent

    agent = read_agent(run.last)
    curve = {name: values[:-1] for name, values in agent.training.curve.items()}
    replace(agent, training=replace(agent.training, curve=curve)).save(run.last)
    assert not run.is_finished(plan)
    assert run.is_finished(replace(plan, evaluation=None))
    run.last.write_bytes(b"")
    assert not run.is_finished(plan)
