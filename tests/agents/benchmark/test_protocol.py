"""The protocol of the benchmark: it is frozen, complete, and its seeds are disjoint."""

from __future__ import annotations

import os
from pathlib import Path

import gymnasium
import pytest

from albot_agents.benchmark.protocol import LATEST, SeedRanges, find_protocol, task_folder
from albot_agents.evaluation.plan import parse_seeds
from albot_agents.registry import agent_names, check_agent, find_agent
from albot_agents.task import own_world, task_names, untwinned
from albot_core.errors import InputError
from albot_env.sim import ODOMETERS
from albot_maps import World
from albot_maps.generators.spec import KINDS
from albot_maps.load import load_worlds

PROTOCOL = find_protocol()


def test_every_task_and_every_kind_of_worlds_is_measured() -> None:
    assert set(PROTOCOL.tasks) == {task for task in task_names() if untwinned(task) == task}
    specs = {kind.spec for kind in PROTOCOL.worlds.values() if kind.spec}
    assert specs == {f"random:{kind}" for kind in KINDS}
    for task, measured in PROTOCOL.tasks.items():
        assert ("scene" in measured.worlds) == (own_world(task) is not None), task


def test_time_limits_are_those_of_the_environments() -> None:
    for task, measured in PROTOCOL.tasks.items():
        assert measured.steps == gymnasium.spec(task).max_episode_steps, task


def test_odometers_are_presets() -> None:
    assert set(PROTOCOL.odometers) <= set(ODOMETERS)


def test_references_are_agents_of_their_tasks() -> None:
    for task, measured in PROTOCOL.tasks.items():
        check_agent(measured.reference, task)


def test_each_cell_has_as_many_different_episodes_as_the_protocol_asks() -> None:
    test = parse_seeds(PROTOCOL.seeds.test)
    for task, measured in PROTOCOL.tasks.items():
        for kind in measured.worlds:
            keys = PROTOCOL.keys(task, kind)
            assert len(set(keys)) == len(keys) >= PROTOCOL.episodes, (task, kind)
            assert {key.seed for key in keys} <= set(test)


def test_all_floor_plans_come_once_before_any_comes_twice() -> None:
    keys = PROTOCOL.keys("Albot/Homing-v0", "plans")
    files = PROTOCOL.worlds["plans"].files
    assert files is not None
    assert [key.world for key in keys[: len(files)]] == list(files)
    assert len({key.seed for key in keys[: len(files)]}) == 1
    assert len(keys) == 112


def test_worlds_are_those_of_the_protocol() -> None:
    """A generator that draws other worlds needs a new protocol."""
    for kind, worlds in PROTOCOL.worlds.items():
        if worlds.files is None:
            PROTOCOL.check_worlds(kind, None)


@pytest.mark.skipif("ALBOT_DATA" not in os.environ, reason="needs the floor plans in ALBOT_DATA")
def test_floor_plans_are_those_of_the_protocol(tmp_path: Path) -> None:
    PROTOCOL.check_worlds("plans", Path(os.environ["ALBOT_DATA"]) / "plans")
    name = next(iter(PROTOCOL.worlds["plans"].files or ()))
    (tmp_path / name).write_text("<plan/>")
    with pytest.raises(InputError, match="expected the floor plan with the SHA-256 hash"):
        PROTOCOL.check_worlds("plans", tmp_path)


def test_floor_plans_need_their_folder() -> None:
    with pytest.raises(InputError, match="expected --plans"):
        PROTOCOL.check_worlds("plans", None)


def test_shipped_agents_were_never_trained_in_a_test_seed() -> None:
    test = set(parse_seeds(PROTOCOL.seeds.test))
    trained = [name for name in agent_names() if find_agent(name).file is not None]
    assert trained
    for name in trained:
        file = find_agent(name).file
        assert file is not None
        plan = file.training.plan
        specs = [plan.env, *(stage.env for stage in plan.curriculum)]
        for spec in specs:
            worlds = spec.get("world", [])
            for world in [worlds] if isinstance(worlds, str) else worlds:
                assert not world.endswith(".xml"), name
                seeds = {int(each.source.split(":")[2].split("?")[0]) for each in _ends(world)}
                assert max(seeds, default=0) < min(test), (name, world)
        if plan.evaluation is not None:
            assert not test & set(parse_seeds(str(plan.evaluation.seeds))), name


def _ends(spec: str) -> list[World]:
    """The first and the last world of a spec, if they are random."""
    worlds = load_worlds(spec)
    return [worlds[0], worlds[len(worlds) - 1]] if spec.startswith("random:") else []


@pytest.mark.parametrize(
    ("samples", "budget"),
    [(0, 1_000_000), (10**6, 10**6), (10**6 + 1, 10**7), (10**8, 10**8), (10**8 + 1, None)],
)
def test_a_training_is_filed_under_the_budget_that_holds_it(
    samples: int, budget: int | None
) -> None:
    assert PROTOCOL.budget(samples) == budget


def test_unknown_protocols_are_refused() -> None:
    with pytest.raises(
        InputError, match=f"protocol: expected a known version: 1, found {LATEST + 1}"
    ):
        find_protocol(LATEST + 1)


def test_ranges_of_seeds_may_not_overlap() -> None:
    with pytest.raises(InputError, match=r"validation: expected seeds above 9, found 9\.\.20"):
        SeedRanges(training="0..9", validation="9..20", test="30..40")
    with pytest.raises(InputError, match=r"test: expected seeds above 20"):
        SeedRanges(training="0..9", validation="10..20", test="0..4")


def test_tasks_have_different_names_in_files() -> None:
    names = [task_folder(task) for task in PROTOCOL.tasks]
    assert len(set(names)) == len(names)
    assert task_folder("Albot/ExploreAndHome-v1") == "explore-and-home-v1"
