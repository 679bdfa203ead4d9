"""The program that measures homing after journeys of several lengths."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from click.testing import CliRunner

from albot_agents.evaluation.trial import Outcome
from albot_agents.trained.trained_agent import shipped_agents
from albot_core.errors import InputError
from albot_studies import homing_distances
from albot_studies.homing_distances import AGENTS, command, plan_trial, table


def test_all_agents_meet_the_same_journeys() -> None:
    begins = []
    for agent in ("oracle", "patch-homing", "homing-mapless"):
        env = plan_trial(agent, 20.0, "random:office:40000", 5).make()
        _, info = env.reset(seed=5)
        begins.append((*info["pose"], info["initial_distance_home"], info["outward_length"]))
        assert info.get("change", "none") == "none"
        env.close()
    assert begins[0][-1] >= 20.0
    np.testing.assert_array_equal(begins[1:], begins[:1] * 2)


def test_journeys_have_the_length_that_was_asked_for() -> None:
    for agent in AGENTS:
        outing = plan_trial(agent, 42.0, "square-loop", 1).settings["config"].outing
        assert (outing.shortest, outing.longest) == (42.0, 42.0)


def test_the_command_counts_successes_by_agent_and_length(tmp_path, monkeypatch) -> None:
    met = []

    def run(trial) -> Outcome:
        length = trial.settings["config"].outing.longest
        met.append((trial.agent, length, trial.world, trial.seed))
        comes_home = trial.agent == "oracle" or (length < 15 and trial.seed % 2 == 0)
        info = {
            "is_success": comes_home,
            "spl": 0.5 * comes_home,
            "soft_spl": 0.5,
            "initial_distance_home": length / 2,
            "position_error": 0.0,
        }
        here = np.zeros(3)
        return Outcome(
            trial=trial, info=info, start=here, begin=here, path=np.zeros((2, 2)), collisions=0
        )

    monkeypatch.setattr(homing_distances, "run_trial", run)
    words = ["--agent", "oracle", "--agent", "path-integration", "--length", "10", "--length", "20"]
    files = ["--out", str(tmp_path / "a.md"), "--png", str(tmp_path / "a.png")]
    done = CliRunner().invoke(command, [*words, "--seeds", "6..9", "--json", *files])
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)["rows"]
    found = {(row["agent"], row["length"]): (row["success"], row["spl"]) for row in rows}
    assert found["oracle", 20.0] == (1.0, 0.5)
    assert found["path-integration", 10.0] == (0.5, 0.25)
    assert found["path-integration", 20.0] == (0.0, 0.0)
    assert len(set(met)) == len(met) == 16
    page = (tmp_path / "a.md").read_text(encoding="utf-8")
    assert page == table(rows)
    assert "| path-integration | 50% (15% to 85%) | 0% (0% to 49%) |" in page
    assert "Mean length of the shortest way home: 5.0 m, 10.0 m" in page
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    wrong = CliRunner().invoke(command, ["--seeds", "9..3"])
    assert isinstance(wrong.exception, InputError)


def test_trainings_with_several_seeds_make_one_row(tmp_path, monkeypatch) -> None:
    """Of two trainings one always comes home and one in half of the episodes: 75 % of them."""
    for seed in (0, 1):
        (tmp_path / "runs" / f"seed-{seed}").mkdir(parents=True)
        shutil.copy(shipped_agents()["homing"], tmp_path / "runs" / f"seed-{seed}" / "last.albot")

    def run(trial) -> Outcome:
        home = "seed-0" in trial.agent or trial.seed % 2 == 0
        info = {"is_success": home, "spl": 0.8 * home, "soft_spl": 0.5, "position_error": 0.0}
        here = np.zeros(3)
        return Outcome(
            trial=trial, info=info | {"initial_distance_home": 7.0}, start=here, begin=here,
            path=np.zeros((2, 2)), collisions=0,
        )  # fmt: skip

    monkeypatch.setattr(homing_distances, "run_trial", run)
    words = ["--agent", str(tmp_path / "runs"), "--length", "10", "--seeds", "6..9"]
    done = CliRunner().invoke(command, [*words, "--png", str(tmp_path / "a.png")])
    assert done.exit_code == 0, done.output
    assert "| runs, 2 trainings | 75% (50% to 100%) |" in done.stdout
    assert "| runs, 2 trainings | 0.60 (0.40 to 0.80) |" in done.stdout


@pytest.mark.parametrize(
    ("agent", "found"), [("orakle", "orakle"), ("gap-explorer", "gap-explorer"), ("", "nothing")]
)
def test_who_does_not_come_home_is_refused(agent, found) -> None:
    wrong = CliRunner().invoke(command, ["--agent", agent])
    assert isinstance(wrong.exception, InputError)
    assert found in str(wrong.exception)


def test_a_folder_without_trainings_is_refused(tmp_path) -> None:
    wrong = CliRunner().invoke(command, ["--agent", str(tmp_path)])
    assert isinstance(wrong.exception, InputError)
    assert "albot train --seeds" in str(wrong.exception)
