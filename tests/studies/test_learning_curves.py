"""The program that measures how networks learn the tasks."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

from albot_core.errors import InputError
from albot_studies import learning_curves
from albot_studies.learning_curves import LESSONS, Classroom, Plan, Score, command, table

TINY = Plan(
    worlds="random:office?rooms=2",
    train=range(5, 7),
    test=range(8, 10),
    steps=5,
    rounds=(1, 2),
    seeds=1,
)


@pytest.mark.parametrize("task", LESSONS)
def test_each_lesson_is_taught_and_measured(task: str, monkeypatch) -> None:
    pytest.importorskip("torch")
    lesson = dataclasses.replace(LESSONS[task], limit=30, robots=2, updates=2)
    monkeypatch.setitem(LESSONS, task, lesson)
    room = Classroom(task, TINY)
    samples = []
    for count, imitator in room.learn(0):
        samples.append(count)
        scores = room.measure(learning_curves._policy(imitator))
    assert samples == [0, 10, 20]
    assert [score.world for score in scores] == [
        "random:office:8?rooms=2",
        "random:office:9?rooms=2",
    ]
    still = room.measure(room.still)
    assert still == room.measure(room.still)
    assert not any(score.success or score.right_claims for score in still)
    room.close()
    # Three seconds cost 0.03, a look around at most as much.
    assert all(-0.1 < score.earned < 0.0 for score in still) or "AndHome" in task


def test_the_command_draws_what_it_prints(tmp_path, monkeypatch) -> None:
    task = "Albot/Homing-v0"

    class Network:
        def __init__(self, earned: float) -> None:
            self.act = lambda *_: earned

    class Room:
        def __init__(self, task: str, plan: Plan) -> None:
            assert (plan.rounds, plan.seeds, plan.worlds) == ((1, 2, 3), 2, "random:maze")

        def still(self, observations, robots):
            return -1.0

        def teachers(self, robots: int):
            return Network(9.0)

        def learn(self, seed: int):
            for samples in (0, 100, 200):
                yield samples, Network(samples / 100 + seed)

        def measure(self, policy):
            earned = policy({}, None)
            return [
                Score(world=w, earned=earned + k, success=k == 0, right_claims=3, false_claims=k)
                for k, w in enumerate(("a", "b"))
            ]

        def close(self) -> None:
            pass

    monkeypatch.setattr(learning_curves, "Classroom", Room)
    pytest.importorskip("torch")
    words = ["--task", task, "--rounds", "3", "--networks", "2", "--worlds", "random:maze"]
    files = ["--out", str(tmp_path / "a.md"), "--png", str(tmp_path / "a.png")]
    done = CliRunner().invoke(command, [*words, "--json", *files])
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)["rows"]
    assert [(row["agent"], row["samples"]) for row in rows] == [
        ("scripted", None), ("still", None), ("untrained", 0), ("learner", 100), ("learner", 200),
    ]  # fmt: skip
    # The mean over two networks (0, 1) and two worlds (0, 1); worlds are drawn as a whole.
    assert [row["return"] for row in rows[2:]] == [
        [1.0, 0.5, 1.5], [2.0, 1.5, 2.5], [3.0, 2.5, 3.5],
    ]  # fmt: skip
    page = (tmp_path / "a.md").read_text(encoding="utf-8")
    assert page == table(rows)
    assert "| learner | 200 | 3.0 (2.5 to 3.5) | 50% (0% to 100%) | 3.00, 0.50 |" in page
    assert "| scripted |  | 9.5 (9.0 to 10.0) |" in page
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_networks_are_not_measured_where_they_learn() -> None:
    wrong = CliRunner().invoke(command, ["--train", "1..5", "--test", "5..6"])
    assert isinstance(wrong.exception, InputError)
    assert "5 in both" in str(wrong.exception)


def test_still_says_nothing() -> None:
    room = object.__new__(Classroom)
    room.names = ("speed", "turn rate", "declare", "claim")
    np.testing.assert_array_equal(room.still({}, np.arange(2)), [[0, 0, -1, -1]] * 2)
