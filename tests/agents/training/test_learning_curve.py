"""Learning curves with their spread: closed forms, and which runs may be put together."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.card import write_card
from albot_agents.training.learning_curve import (
    FILES,
    LearningCurves,
    check_agent,
    read_curves,
)
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.plan_file import save_plan
from albot_agents.training.run_files import RunFolder
from albot_core.errors import InputError
from tests.agents.training.conftest import Trained

PLAN = TrainingPlan(task="Albot/Homing-v0")
CURVES = LearningCurves(
    PLAN,
    {
        0: {"samples": [10.0, 20.0, 30.0], "return": [1.0, 2.0, 6.0], "spl": [0.0, 0.5, 1.0]},
        4: {"samples": [10.0, 20.0, 30.0], "return": [3.0, 2.0, 0.0], "spl": [0.5, 0.5, 0.5]},
        7: {"samples": [10.0, 20.0, 30.0], "return": [5.0, 5.0, 3.0]},
    },
)


def test_mean_and_range_over_the_seeds() -> None:
    assert CURVES.names == ("return",)  # Of one seed, no SPL is known.
    samples, mean, lowest, highest = CURVES.spread("return")
    assert samples.tolist() == [10.0, 20.0, 30.0]
    assert mean.tolist() == [3.0, 3.0, 3.0]
    assert lowest.tolist() == [1.0, 2.0, 0.0]
    assert highest.tolist() == [5.0, 5.0, 6.0]
    assert CURVES.last == {"return": (3.0, 0.0, 6.0)}


def test_curves_of_other_samples_are_interpolated_where_all_were_measured() -> None:
    """Straight lines, whose values between the points are known."""
    curves = LearningCurves(
        PLAN,
        {
            1: {"samples": [10.0, 20.0, 40.0], "return": [1.0, 2.0, 4.0]},
            2: {"samples": [15.0, 35.0], "return": [30.0, 70.0]},
        },
    )
    samples, mean, lowest, highest = curves.spread("return")
    assert samples.tolist() == [15.0, 20.0, 35.0]
    np.testing.assert_allclose(lowest, samples / 10)
    np.testing.assert_allclose(highest, samples * 2)
    np.testing.assert_allclose(mean, samples * 1.05)
    apart = {3: {"samples": [50.0], "return": [1.0]}}
    assert LearningCurves(PLAN, {**curves.curves, **apart}).last == {}


def test_table_and_picture_have_the_same_numbers(tmp_path: Path) -> None:
    CURVES.write(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)
    rows = list(csv.DictReader((tmp_path / "curve.csv").read_text().splitlines()))
    assert [row["figure"] for row in rows] == ["return"] * 3
    assert [float(row["min"]) for row in rows] == [1.0, 2.0, 0.0]
    assert [float(row["seed_7"]) for row in rows] == [5.0, 5.0, 3.0]
    facts = json.loads((tmp_path / "curve.json").read_text())
    assert (facts["seeds"], facts["spread"]) == ([0, 4, 7], "min to max")
    assert facts["return"]["max"] == [5.0, 5.0, 6.0]
    assert facts["return"]["seeds"]["4"] == [3.0, 2.0, 0.0]
    axes = CURVES.figure().axes[0]
    mean, *seeds = axes.get_lines()
    np.testing.assert_array_equal(mean.get_ydata(), [3.0, 3.0, 3.0])
    assert len(seeds) == 3
    (band,) = axes.collections
    assert band.get_datalim(axes.transData).ymax == 6.0


def test_one_seed_has_no_spread() -> None:
    axes = LearningCurves(PLAN, {0: CURVES.curves[0]}).figure().axes
    assert [len(panel.get_lines()) for panel in axes] == [1, 1]
    assert not any(panel.collections for panel in axes)


@pytest.fixture
def seeds(trained: Trained, tmp_path: Path) -> Path:
    """A folder with copies of a run as those of seeds 0 and 3."""
    for seed in (0, 3):
        run = RunFolder(Path(shutil.copytree(trained[0].path, tmp_path / f"mine/seed-{seed}")))
        save_plan(replace(trained[1], seed=seed), run.plan)
    return tmp_path / "mine"


def _change(run: Path, **changes: Any) -> None:
    agent = read_agent(run / "last.albot")
    replace(agent, training=replace(agent.training, **changes)).save(run / "last.albot")


def _change_plan(file: Path, **changes: Any) -> None:
    agent = read_agent(file)
    plan = replace(agent.training.plan, **changes)
    replace(agent, training=replace(agent.training, plan=plan)).save(file)


def test_runs_are_read_from_their_folders(seeds: Path, trained: Trained) -> None:
    curves = read_curves([seeds])
    assert list(curves.curves) == [0, 3]
    assert curves.curves[3] == read_agent(trained[0].last).training.curve
    one_by_one = read_curves([seeds / "seed-3", seeds / "seed-0"])
    assert list(one_by_one.curves) == [0, 3]
    sent = Path(shutil.copy(seeds / "seed-3" / "last.albot", seeds / "sent.albot"))
    _change_plan(sent, seed=3)
    assert read_curves([sent, seeds / "seed-0"]).csv == curves.csv
    _change(seeds / "seed-3", curve={})
    assert list(read_curves([seeds]).curves) == [0]
    (seeds / "seed-0" / "last.albot").unlink()
    with pytest.raises(InputError, match="mine: expected a run that has been measured, found none"):
        read_curves([seeds])


def test_runs_that_do_not_belong_together_are_refused(seeds: Path, trained: Trained) -> None:
    with pytest.raises(InputError, match=r"another seed than that of .*seed-0, found 0"):
        read_curves([seeds, trained[0].path])
    save_plan(replace(trained[1], seed=3, gamma=0.5), seeds / "seed-3" / "config.yml")
    with pytest.raises(
        InputError, match=r"seed-3/config.yml: expected a plan that .* in its seed, found gamma 0.5"
    ):
        read_curves([seeds])
    with pytest.raises(InputError, match="expected the folder of a training run or of several"):
        read_curves([seeds / "seed-3" / "checkpoints"])
    sent = Path(shutil.copy(seeds / "seed-0" / "last.albot", seeds / "sent.albot"))
    with pytest.raises(InputError, match=r"sent.albot: .* another seed .*seed-0, found 0"):
        read_curves([seeds / "seed-0", sent])
    with pytest.raises(InputError, match=r"monitor.csv: expected an intact agent file"):
        read_curves([seeds / "seed-0" / "monitor.csv"])


def test_a_card_shows_the_seeds_of_its_agent(seeds: Path, trained: Trained, tmp_path: Path) -> None:
    agent, curves = read_agent(trained[0].best), read_curves([seeds])
    check_agent(curves, agent.training.plan)
    card, picture = write_card(agent, "best", tmp_path / "best.md", runs=curves)
    text = card.read_text()
    assert "Mean of 2 seeds; shaded: min to max; thin lines: each seed." in text
    assert "This agent is that of seed 0, of 2 seeds (0, 3)." in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="--runs: expected the run of the agent's seed, 4, too"):
        check_agent(curves, replace(agent.training.plan, seed=4))
    with pytest.raises(InputError, match=r"the plan of this agent, found gamma 0\.5, not"):
        check_agent(curves, replace(agent.training.plan, gamma=0.5))
