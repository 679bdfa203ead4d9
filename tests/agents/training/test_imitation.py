"""Networks that imitate, and the teachers that they imitate."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch")

from albot_agents.training.imitation import COMMANDS, SECTORS, Imitator

SHAPES = {"laser": (181,), "matches": (3, 8), "map_patch": (2, 8, 8)}


def lesson(robots: int, seed: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Turn away from the side on which the patch shows something; claim by the first match."""
    rng = np.random.default_rng(seed)
    seen = {
        part: rng.uniform(-1, 1, (robots, *shape)).astype(np.float32)
        for part, shape in SHAPES.items()
    }
    is_left = rng.random(robots) < 0.5
    seen["map_patch"][:] = -1.0
    for k, left in enumerate(is_left):
        seen["map_patch"][k, 1, rng.integers(8), rng.integers(4) + (0 if left else 4)] = 1.0
    actions = np.full((robots, 4), -1.0, np.float32)
    actions[:, 0] = 0.5
    actions[:, 1] = np.where(is_left, -0.5, 0.5)
    actions[:, 3] = np.where(seen["matches"][:, 0, 1] > 0, 1.0, -1.0)
    return seen, actions


def test_a_rule_is_learnt_from_examples_and_holds_for_others() -> None:
    imitator = Imitator(SHAPES, 4, seed=0)
    others, wanted = lesson(200, 1)
    assert (imitator.act(others)[:, :2] == wanted[:, :2]).all(axis=1).mean() < 0.2
    for seed in (2, 3):
        imitator.remember(*lesson(1000, seed))
    imitator.learn(300)
    done = imitator.act(others)
    assert (np.sign(done[:, 1]) == np.sign(wanted[:, 1])).mean() > 0.9
    assert (done[:, 3] == wanted[:, 3]).mean() > 0.9
    assert (done[:, 2] == -1.0).all()


def test_the_same_seed_gives_the_same_network() -> None:
    seen, wanted = lesson(20, 1)

    def learnt(seed: int) -> np.ndarray:
        imitator = Imitator(SHAPES, 4, seed)
        imitator.remember(seen, wanted)
        imitator.learn(3)
        return imitator.act(seen)

    np.testing.assert_array_equal(learnt(1), learnt(1))
    assert (learnt(1) != learnt(2)).any()


def test_a_network_sees_the_nearest_range_of_each_sector() -> None:
    imitator = Imitator({"laser": (181,)}, 3, seed=0)
    ranges = np.full((1, 181), -1.0, np.float32)
    ranges[0, 90] = 0.75
    plain, patch = imitator._inputs({"laser": ranges})
    assert plain.shape == (1, SECTORS)
    assert (plain[0].max(), (plain[0] > -1).sum(), plain[0].argmax()) == (0.75, 1, SECTORS // 2)
    assert patch.size == 0


def test_commands_turn_both_ways_and_stop() -> None:
    rows = {tuple(row) for row in COMMANDS.tolist()}
    assert {(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, -1.0)} <= rows
    assert {(speed, -turn) for speed, turn in rows} == rows
