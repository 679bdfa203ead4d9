"""Running a benchmark: what is missing is run, and a run that was stopped ends as any other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.entrant import Entrant, find_entrant
from albot_agents.benchmark.folder import ResultsFolder
from albot_agents.benchmark.protocol import Protocol, find_protocol
from albot_agents.benchmark.run import BenchmarkRun, Row, _in_batches
from albot_agents.evaluation.plan import _loaded
from albot_agents.trained.trained_agent import shipped_agents
from albot_core.errors import InputError
from albot_env.tasks.core import journeys
from albot_env.tasks.core.journeys import JourneyCache
from tests.env.quick import STROLL
from tests.inline_engine import InlineEngine

EXPLORE, HOMING = "Albot/Explore-v0", "Albot/Homing-v0"
RANDOM = find_entrant("random")


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    """A folder whose protocol has episodes of ten steps."""
    return new_folder(tmp_path / "results")


def new_folder(path: Path) -> ResultsFolder:
    """A folder whose protocol has episodes of ten steps."""
    folder = ResultsFolder(path)
    folder.protocol = short(folder.protocol)
    return folder


HERE = InlineEngine()
"""Episodes run in this process: starting others takes seconds."""


@pytest.fixture
def strolls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also the reference's journeys are a metre or two long."""
    monkeypatch.setattr(
        "albot_agents.benchmark.run.find_entrant",
        lambda name: replace(find_entrant(name), settings={"config": STROLL}),
    )


def short(protocol: Protocol) -> Protocol:
    """The protocol with episodes of ten steps."""
    tasks = {task: replace(each, steps=10) for task, each in protocol.tasks.items()}
    return replace(protocol, tasks=tasks)


def row(entrant: Entrant = RANDOM, task: str = EXPLORE, *odometers: str, **changes: str) -> Row:
    """A row in mazes."""
    worlds = (changes.get("worlds", "mazes"),)
    return Row(entrant=entrant, task=task, odometers=odometers or ("pioneer",), worlds=worlds)


def contents(folder: ResultsFolder) -> dict[str, bytes]:
    """The files of the cells."""
    files = (folder.path / "cells").rglob("*.jsonl")
    return {str(file.relative_to(folder.path)): file.read_bytes() for file in files}


def test_what_is_missing_is_run_in_the_protocols_order(folder: ResultsFolder) -> None:
    told: list[int] = []
    rows = [row(RANDOM, EXPLORE, "pioneer", "poor")]
    run = BenchmarkRun(folder, rows, 2)
    assert run.missing == 4
    run.run(HERE, told.append)
    assert run.missing == 0
    assert told[-1] == 4
    cells = folder.read()
    assert [found.cell for found in cells] == rows[0].cells
    for found in cells:
        assert [(one.world, one.seed) for one in found.episodes] == [
            ("random:maze:70000", 70000), ("random:maze:70001", 70001)
        ]  # fmt: skip
        assert {one.steps for one in found.episodes} == {10}
        assert {one.agent for one in found.episodes} == {"random"}
    # The same episodes with another odometer.
    one, other = (found.episodes[1] for found in cells)
    assert one.begin.tobytes() == other.begin.tobytes()
    before = contents(folder)
    BenchmarkRun(folder, rows, 2).run(HERE)
    assert contents(folder) == before
    assert BenchmarkRun(folder, rows, 3).missing == 2
    assert BenchmarkRun(folder, rows).missing == 2 * 98


def test_a_run_that_was_stopped_ends_as_one_that_was_not(tmp_path: Path) -> None:
    whole, stopped = new_folder(tmp_path / "whole"), new_folder(tmp_path / "stopped")
    rows = [row(RANDOM, EXPLORE, "pioneer", "ideal", "poor")]
    BenchmarkRun(whole, rows, 2).run(HERE)

    def stop(done: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        BenchmarkRun(stopped, rows, 2).run(HERE, stop)
    assert 0 < BenchmarkRun(stopped, rows, 2).missing < 6
    BenchmarkRun(stopped, rows, 2).run(HERE)
    assert contents(stopped) == contents(whole)


@pytest.mark.usefixtures("strolls")
def test_episodes_that_run_together_are_those_that_run_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Agents with the same equipment share their journey; others share the way that it takes."""
    monkeypatch.setattr(journeys, "_LATEST", JourneyCache())
    together, alone = new_folder(tmp_path / "together"), new_folder(tmp_path / "alone")
    entrants = [
        replace(find_entrant(name), settings={"config": STROLL})
        for name in ("oracle", "path-integration", "albot1-homing", "homing-blind")
    ]
    rows = [row(entrant, HOMING, "pioneer", "poor") for entrant in entrants]
    BenchmarkRun(together, rows, 1).run(HERE)
    for each in reversed(rows):
        for odometer in reversed(each.odometers):
            _loaded.cache_clear()  # In a new world no way and no journey is known.
            BenchmarkRun(alone, [replace(each, odometers=(odometer,))], 1).run(HERE)
    assert contents(together) == contents(alone)
    assert len(together.read()) == 8
    begins = {one.begin.tobytes() for found in together.read() for one in found.episodes}
    assert len(begins) == 1


def test_batches_of_a_trained_agent_are_its_episodes(tmp_path: Path) -> None:
    """An agent that explores is run in batches; one episode after another it does the same."""
    together, alone = new_folder(tmp_path / "together"), new_folder(tmp_path / "alone")
    rows = [row(find_entrant("exploring"), EXPLORE, "pioneer", "poor")]
    BenchmarkRun(together, rows, 3).run(HERE)
    for episodes in (1, 2, 3):
        BenchmarkRun(alone, rows, episodes).run(HERE)
    assert contents(together) == contents(alone)
    assert _in_batches(rows[0])
    assert not _in_batches(row(find_entrant("gap-explorer"), EXPLORE))
    assert not _in_batches(row(find_entrant("homing"), HOMING))


@pytest.mark.usefixtures("strolls")
def test_a_trained_agents_plan_and_facts_are_kept(folder: ResultsFolder, tmp_path: Path) -> None:
    file = tmp_path / "mine.albot"
    file.write_bytes(shipped_agents()["homing"].read_bytes())
    entrant = find_entrant(str(file))
    agent = entrant.entry.file
    assert agent is not None
    assert entrant.fingerprint is not None
    assert entrant.name == f"mine-{entrant.fingerprint[:8]}"
    entrant = replace(entrant, settings={"config": STROLL})
    BenchmarkRun(folder, [row(entrant, HOMING)], 1).run(HERE)
    facts = folder.read_agents()[entrant.name]
    assert facts["fingerprint"] == entrant.fingerprint
    assert facts["mapper"] == "albot1"
    assert facts["command"] == agent.training.command
    assert facts["samples"] == agent.training.samples
    assert (folder.path / "agents" / f"{entrant.name}.yml").exists()
    assert folder.read()[0].fingerprint == entrant.fingerprint


@pytest.mark.usefixtures("strolls")
def test_results_of_another_agent_of_the_name_are_refused(folder: ResultsFolder) -> None:
    homing = replace(find_entrant("homing"), settings={"config": STROLL})
    BenchmarkRun(folder, [row(homing, HOMING)], 1).run(HERE)
    BenchmarkRun(folder, [row(homing, HOMING)], 2)
    other = replace(homing, entry=find_entrant("homing-blind").entry)
    with pytest.raises(InputError, match="expected results of the same agent homing; remove its"):
        BenchmarkRun(folder, [row(other, HOMING)], 2)
    with pytest.raises(InputError, match="expected results of the same agent homing; remove its"):
        BenchmarkRun(folder, [row(other, HOMING, worlds="rings")], 2)  # Another cell.


def altered(name: str, path: Path, **settings: Any) -> Entrant:
    """The entrant of a trained agent with other settings, in a file."""
    agent = find_entrant(name).entry.file
    assert agent is not None
    replace(agent, settings={**agent.settings, **settings}).save(path)
    return find_entrant(str(path))


def test_settings_of_a_trained_agent_are_part_of_what_it_is(tmp_path: Path) -> None:
    agent = find_entrant("place-recognition").entry.file
    assert agent is not None
    config = agent.settings["config"]
    tour = {**config, "tour": {**config["tour"], "revisits": 0.0}}
    one = altered("place-recognition", tmp_path / "a.albot")
    other = altered("place-recognition", tmp_path / "b.albot", config=tour)
    assert one.fingerprint == find_entrant("place-recognition").fingerprint
    assert one.fingerprint != other.fingerprint


@pytest.mark.parametrize("robot", ["pioneer-3dx", "peoplebot"])
def test_an_agent_alone_meets_the_protocols_episodes(
    folder: ResultsFolder, tmp_path: Path, robot: str
) -> None:
    rows = [row(altered("exploring", tmp_path / "mine.albot", robot=robot))]
    if robot == "pioneer-3dx":  # The default, told.
        assert BenchmarkRun(folder, rows, 1).missing == 1
        return
    said = "expected the episodes of gap-explorer, found robot peoplebot, not pioneer-3dx"
    with pytest.raises(InputError, match=said):
        BenchmarkRun(folder, rows, 1)


@pytest.mark.parametrize("name", sorted(shipped_agents()))
def test_the_shipped_agents_meet_the_protocols_episodes(folder: ResultsFolder, name: str) -> None:
    task = find_entrant(name).entry.tasks[0]
    assert BenchmarkRun(folder, [row(find_entrant(name), task, worlds="offices")], 1).missing == 1


def test_a_hidden_file_is_no_entrant(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a file whose name begins with no dot"):
        altered("exploring", tmp_path / ".my.v2.albot")


def test_no_cell_is_in_two_rows(folder: ResultsFolder) -> None:
    with pytest.raises(AssertionError, match="a cell is in two rows"):
        BenchmarkRun(folder, [row(), row()], 1)
    with pytest.raises(AssertionError, match="a cell is in two rows"):
        BenchmarkRun(folder, [row(RANDOM, EXPLORE, "poor", "poor")], 1)


def test_a_process_after_another_runs_what_is_still_missing(folder: ResultsFolder) -> None:
    one, other = BenchmarkRun(folder, [row()], 1), BenchmarkRun(folder, [row()], 2)
    one.run(HERE)
    told: list[int] = []
    other.run(HERE, told.append)
    assert told == [1]
    assert len(folder.read()[0].episodes) == 2


def test_it_is_complete_with_all_episodes_of_the_protocol(folder: ResultsFolder) -> None:
    run = BenchmarkRun(folder, [row()], 1)
    run.run(HERE)
    assert run.missing == 0
    assert not run.is_complete
    folder.protocol = replace(folder.protocol, episodes=1)
    assert BenchmarkRun(folder, [row()]).is_complete


def test_agents_that_would_meet_other_episodes_are_refused(folder: ResultsFolder) -> None:
    quick = replace(RANDOM, settings={"robot": "kobuki"})
    rows = [row(find_entrant("gap-explorer")), row(quick)]
    with pytest.raises(InputError, match="agent random: expected the episodes of gap-explorer"):
        BenchmarkRun(folder, rows, 1)
    assert not folder.path.exists()


def test_worlds_of_another_generator_are_refused(
    folder: ResultsFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("albot_agents.benchmark.protocol.world_digest", lambda spec: "0" * 16)
    with pytest.raises(InputError, match="protocol 1, mazes: expected random:maze:70000 with"):
        BenchmarkRun(folder, [row()], 1)


def test_a_second_process_is_refused(folder: ResultsFolder) -> None:
    folder.begin()
    run = BenchmarkRun(folder, [row()], 1)
    with folder.locked(), pytest.raises(InputError, match="no other process writes into"):
        run.run(HERE)


def test_all_cells_grow_evenly(folder: ResultsFolder) -> None:
    """A table of a run that was stopped has figures everywhere."""
    order: list[tuple[int, Cell]] = []

    def note(group: Any) -> None:
        order.extend((member.key.seed, member.cell) for member in group.members)

    tasks = (EXPLORE, "Albot/ExploreAndHome-v1")
    rows = [row(RANDOM, task, *find_protocol().odometers) for task in tasks]
    BenchmarkRun(folder, rows, 3).run(InlineEngine(note))
    assert [seed for seed, _ in order] == [70000] * 6 + [70001] * 6 + [70002] * 6
    assert [cell for _, cell in order[:6]] == [cell for each in rows for cell in each.cells]
