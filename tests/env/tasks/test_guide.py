"""The guide in docs/tasks.md is the task of visiting rooms, word by word, and that task works."""

from __future__ import annotations

import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from albot_core.errors import InputError
from albot_maps import World
from tests.conftest import ROOT
from tests.env.tasks.visit_rooms import VisitRoomsConfig, VisitRoomsTask, is_success

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
TASK = VisitRoomsTask.environment


def test_the_guides_code_is_the_task_that_the_tests_use() -> None:
    guide = (ROOT / "docs" / "tasks.md").read_text(encoding="utf-8")
    code = (Path(__file__).parent / "visit_rooms.py").read_text(encoding="utf-8")
    shown = "\n".join(BLOCK.findall(guide))
    assert [line for line in shown.splitlines() if line] == [
        line for line in code.splitlines() if line
    ]


def test_success_takes_as_many_rooms_as_are_wanted() -> None:
    assert is_success(np.array((0, 1, 2, 3)), 2).tolist() == [False, False, True, True]
    with pytest.raises(InputError, match=r"VisitRoomsConfig\.rooms"):
        VisitRoomsConfig(rooms=0)


def test_an_episode_ends_in_the_second_room_alone_in_a_batch_and_branched(
    two_rooms: World,
) -> None:
    settings = {"world": two_rooms, "mapper": "none", "config": {"rooms": 2}}
    env = gymnasium.make(TASK, **settings)
    check_env(env.unwrapped, skip_render_check=True)
    batch = gymnasium.make_vec(TASK, num_envs=2, **settings)
    env.reset(seed=1, options={"start": 0})
    batch.reset(seed=[1, 2], options={"start": 0})
    ahead, total, is_over = np.array((1.0, 0.0), np.float32), 0.0, False
    branch = None
    for step in range(100):
        seen, reward, is_over, _, info = env.step(ahead)
        rows, rewards, ended, *_ = batch.step(np.stack((ahead, ahead)))
        assert (seen.tobytes(), reward, is_over) == (rows[0].tobytes(), rewards[0], ended[0])
        assert reward == pytest.approx(sum(info["reward_terms"].values()))
        total += reward
        if step == 20:
            branch = env.unwrapped.get_state()  # type: ignore[attr-defined]
        if is_over:
            break
    assert is_over
    assert info["is_success"]
    assert info["pose"][0] > 5.0
    assert total == pytest.approx(1.0 - 0.001 * (step + 1))
    other = gymnasium.make(TASK, **settings)
    other.reset(seed=3)
    other.unwrapped.set_state(branch)  # type: ignore[attr-defined]
    for _ in range(step - 20):
        last, reward, over, *_ = other.step(ahead)
    assert (last.tobytes(), over) == (seen.tobytes(), True)
