"""The program that sets trivial policies beside a scripted agent."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from albot_core.errors import InputError
from albot_maps import load_world
from albot_studies import trivial_policies
from albot_studies.map_patches import COLOURS, painted
from albot_studies.trivial_policies import (
    POLICIES,
    Episode,
    command,
    policies_for,
    run_episode,
    table,
)

FLAGS = ("speed", "turn rate")


def test_policies_that_a_task_cannot_tell_apart_are_left_out() -> None:
    explore = list(policies_for((*FLAGS, "claim"), ("laser",)))
    assert "declare at once" not in explore
    assert "scripted, all claims" in explore
    homing = list(policies_for((*FLAGS, "declare"), ("laser", "way")))
    assert {"declare at once", "home-vector", "hint-follower"} <= set(homing)
    assert not [name for name in homing if "claims" in name]
    assert "hint-follower" not in policies_for((*FLAGS, "declare", "claim"), ("laser",))
    assert list(policies_for((*FLAGS, "declare", "claim"), ("way",))) == list(POLICIES)


def test_standing_still_earns_the_price_of_time_and_declaring_at_once_the_penalty() -> None:
    world = load_world("square-loop")
    still = run_episode("Albot/Homing-v0", world, 3, "still")
    assert still.earned == pytest.approx(-3.0, abs=1e-6)
    assert -0.25 < still.discounted < 0.0
    at_once = run_episode("Albot/Homing-v0", world, 3, "declare at once")
    assert at_once.earned == pytest.approx(-5.0, abs=0.02)
    assert (at_once.success, still.success) == (False, False)


def test_the_command_prints_and_writes_the_table(tmp_path, monkeypatch) -> None:
    earned = {"still": 1.0, "scripted": 3.0}

    def run(task: str, world: object, seed: int, policy: str) -> Episode:
        return Episode(
            earned=earned.get(policy, 2.0) + seed % 2,
            discounted=0.5,
            success=policy == "scripted",
            right_claims=2,
            false_claims=1,
        )

    monkeypatch.setattr(trivial_policies, "run_episode", run)
    words = ["--task", "Albot/HomingByMap-v0", "--worlds", "square-loop", "--seeds", "2..3"]
    done = CliRunner().invoke(command, [*words, "--json", "--out", str(tmp_path / "a.md")])
    rows = {row["policy"]: row for row in json.loads(done.output)["rows"]}
    assert (rows["still"]["return"], rows["scripted"]["return"]) == (1.5, 3.5)
    assert (rows["scripted"]["low"], rows["scripted"]["high"]) == (3.0, 4.0)
    assert rows["spin"]["right_claims"] == 4
    page = (tmp_path / "a.md").read_text(encoding="utf-8")
    assert page == table(list(rows.values()))
    assert "| scripted | 3.5 (3.0 to 4.0) | 0.5 | 100% | 4, 2 |" in page
    wrong = CliRunner().invoke(command, ["--seeds", "9..3"])
    assert isinstance(wrong.exception, InputError)


def test_a_patch_is_painted_channel_by_channel() -> None:
    empty = np.full((2, 8, 8), -1.0)
    channels = {name: empty.copy() for name in ("walls", "trail", "home")}
    channels["walls"][0, 0, 1] = channels["home"][0, 7, 7] = 1.0
    channels["trail"][0, 3, 1] = 0.5
    image = painted(channels, 0)
    assert image.shape == (8, 8, 3)
    assert image[0, 1].tolist() == list(COLOURS["walls"])
    assert image[7, 7].tolist() == list(COLOURS["home"])
    assert image[3, 1] == pytest.approx(0.5 * np.array(COLOURS["trail"]))
    assert image[4, 4].tolist() == [1.0, 0.2, 0.2]
    assert painted(channels, 1)[0, 1] == pytest.approx(image[1, 1])
