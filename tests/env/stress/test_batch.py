"""The compiled checks of a batch let nothing pass that the exact checks find."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_env.stress.batch import BatchChecker, Step
from albot_maps import load_world

WORLDS = (
    "random:apartment:1?people=3&boxes=4&doors=2",
    "random:office:2?people=4&boxes=3",
    "random:maze:3",
    "square-loop",
)
LASER, SONAR, BODY, OBSTACLES, MOVABLES = "laser", "sonar", "body", "obstacles", "movables"


def driven(steps: int, share: float = 1.0) -> tuple[Any, BatchChecker, Step]:
    """A batch after some random steps, its checker, and what was to check last."""
    worlds = [load_world(world) for world in WORLDS]
    batch = gymnasium.make_vec(
        "Albot/Explore-v0", num_envs=len(worlds), world=worlds, mapper="none", threads=1
    ).unwrapped
    checker = BatchChecker(batch, worlds, share=share)
    batch.action_space.seed(1)
    assert checker.after_reset(*batch.reset(seed=5)) == {}
    for _ in range(steps):
        observations, rewards, _, _, infos = batch.step(batch.action_space.sample())
        assert checker.after_step(observations, rewards, infos) == {}
    return batch, checker, checker._step(observations, rewards, infos)


@pytest.fixture(scope="module")
def scene() -> Iterator[tuple[BatchChecker, Step]]:
    batch, checker, step = driven(40)
    yield checker, step
    batch.close()


def copied(step: Step) -> Step:
    """The same step, of which everything may be changed."""
    readings = step.readings
    whole = {name: getattr(readings, name).copy() for name in ("motions", "ranges", "echoes")}
    infos = {**step.infos, "pose": step.infos["pose"].copy()}
    return step._replace(
        observations=step.observations.copy(),
        infos=infos,
        readings=type(readings)(**{**vars(readings), **whole}),
        outlines=step.outlines.copy(),
    )


def judged(checker: BatchChecker, step: Step) -> tuple[np.ndarray, dict[int, set[str]]]:
    """Who is a suspect, and by environment what the exact checks say."""
    suspects = checker._suspects(step, rewarded=True)
    exact = {
        row: {found.invariant for found in checker._examine(row, step, rewarded=True)}
        for row in range(len(WORLDS))
    }
    return suspects, exact


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 2**32 - 1))
def test_whatever_the_exact_checks_find_is_a_suspect(scene: tuple[BatchChecker, Step], seed: int):
    """Poses, ranges, echoes and movables displaced by much and by little."""
    rng = np.random.default_rng(seed)
    checker, step = scene[0], copied(scene[1])
    size = 10 ** rng.uniform(-4, 0.5)
    change = rng.integers(4)
    if change == 0:
        step.infos["pose"][:, :2] += rng.normal(0, size, (len(WORLDS), 2))
    elif change == 1:
        step.readings.ranges[:, rng.integers(181, size=3)] += rng.normal(0, size, 3)
    elif change == 2:
        step.readings.echoes[:, rng.integers(8)] += rng.normal(0, size)
    else:
        step.outlines[:] += np.tile(rng.normal(0, size, 2), 2)
    np.abs(step.readings.ranges, out=step.readings.ranges)
    np.abs(step.readings.echoes, out=step.readings.echoes)
    suspects, exact = judged(checker, step)
    for row, found in exact.items():
        assert suspects[row] or not found


def test_in_a_sound_step_hardly_anyone_is_a_suspect():
    batch, checker, step = driven(25)
    suspects = 0
    for _ in range(50):
        observations, rewards, _, _, infos = batch.step(batch.action_space.sample())
        step = checker._step(observations, rewards, infos)
        suspects += int(checker._suspects(step, rewarded=True).sum())
        assert checker._check(step, rewarded=True) == {}
    batch.close()
    assert suspects < 0.1 * 50 * len(WORLDS)


@pytest.mark.parametrize("share", [1.0, 0.25])
def test_a_wrong_beam_is_found_in_its_turn(share: float):
    """At a quarter of the beams, at the latest in the fourth step."""
    batch, checker, step = driven(3, share)
    step = copied(step)
    beam = int(np.argmin(step.readings.ranges[2]))
    step.readings.ranges[2, beam] += 0.5
    turns = [checker._check(step, rewarded=True) for _ in range(round(1 / share))]
    batch.close()
    [found] = [turn for turn in turns if turn]
    assert [finding.invariant for finding in found[2]] == [LASER]
    assert f"beam {beam} sees" in found[2][0].what


@pytest.mark.parametrize(
    ("invariant", "row"), [(BODY, 2), (OBSTACLES, 0), (MOVABLES, 0), (SONAR, 3), ("readings", 3)]
)
def test_each_invariant_turns_red(scene: tuple[BatchChecker, Step], invariant: str, row: int):
    checker, step = scene[0], copied(scene[1])
    first, end = step.rows[row]
    if invariant == BODY:
        step.infos["pose"][row, :2] += 3.0
    elif invariant == OBSTACLES:  # The last of the people steps onto the robot.
        middle = step.outlines[end - 8 : end, :2].mean(axis=0)
        step.outlines[end - 8 : end] += np.tile(step.infos["pose"][row, :2] - middle, 2)
    elif invariant == MOVABLES:
        wall = checker._worlds[row].walls[0]
        middle = step.outlines[first + 2 : first + 6, :2].mean(axis=0)
        step.outlines[first + 2 : first + 6] += np.tile((wall[:2] + wall[2:]) / 2 - middle, 2)
    elif invariant == SONAR:
        step.readings.echoes[row] = 0.12
    else:
        step.readings.ranges[row, 4] = np.nan
    suspects, exact = judged(checker, step)
    assert suspects[row]
    assert invariant in exact[row]


def test_what_a_task_changes_in_a_world_is_known() -> None:
    worlds = [load_world(f"random:apartment:{seed}") for seed in (500002, 500003)]
    batch = gymnasium.make_vec(
        "Albot/HomingByMap-v0", num_envs=2, world=worlds, mapper="none", threads=1
    ).unwrapped
    checker = BatchChecker(batch, worlds)
    observations, infos = batch.reset(seed=[500012, 500018])
    assert checker.after_reset(observations, infos) == {}
    for world, checked in zip(worlds, checker._worlds, strict=True):
        assert not np.array_equal(world.walls, checked.walls), infos["change"]
    for _ in range(12):
        observations, rewards, _, _, infos = batch.step(np.zeros(batch.action_space.shape))
        assert checker.after_step(observations, rewards, infos) == {}


def test_a_share_of_no_beams_is_refused(scene: tuple[BatchChecker, Step]):
    checker = scene[0]
    with pytest.raises(InputError, match="share"):
        BatchChecker(checker._batch, checker._worlds, share=0.0)
