"""How the page opens: who is set beside whom, over which episodes, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.mapper_page import MapperReport
from albot_agents.benchmark.overview import (
    Column,
    agents_lines,
    agents_sentence,
    make_overview,
    mappers_lines,
)
from albot_agents.benchmark.page import Report, page_data, render_page
from albot_agents.registry import BY_MAP, EXPLORE, PLACES
from tests.agents.benchmark.episodes import PROTOCOL, cell, results

HOMING = "Albot/Homing-v0"
KINDS = PROTOCOL.tasks[HOMING].worlds


def everywhere(agent: str, episodes: int, spl: float, **changes: Any) -> list[CellResults]:
    """An agent's episodes in all kinds of worlds."""
    return [results(cell(agent, worlds=kind, **changes), episodes, spl) for kind in KINDS]


def overview(*found: Sequence[CellResults]) -> list[Column]:
    return make_overview([one for some in found for one in some], PROTOCOL)


def agents(column: Column) -> list[str]:
    return [one.agent for one in column.standings]


def test_an_agent_stands_with_as_many_episodes_of_each_kind() -> None:
    uneven = everywhere("mine", 5, 0.5)
    uneven[2] = results(uneven[2].cell, 3, 1.0)
    (column,) = overview(everywhere("oracle", 4, 1.0), uneven)
    assert agents(column) == ["oracle", "mine"]
    oracle, mine = column.standings
    assert (len(oracle.episodes), len(mine.episodes)) == (4 * 7, 3 * 7)
    assert mine.is_short
    # The mean over the kinds, each counted as much: six of 0.5 and one of 1.
    assert mine.figures["spl"].value == pytest.approx((6 * 0.5 + 1.0) / 7)
    assert mine.figures["success_rate"].value == pytest.approx(2 / 3)  # Of 0, 1, 2 all but 0.


def test_a_whole_row_is_not_short() -> None:
    (column,) = overview(everywhere("oracle", 200, 1.0))
    assert [one.is_short for one in column.standings] == [False]
    assert len(column.standings[0].episodes) == 700  # 100 of each, of the floor plans too.
    assert "| *episodes an agent* | 700 |" in list(agents_lines([column], "pioneer"))


def test_who_lacks_a_kind_of_the_first_agents_is_left_out() -> None:
    lacking = everywhere("mine", 4, 0.5)[1:]
    (column,) = overview(everywhere("oracle", 4, 1.0), lacking)
    assert agents(column) == ["oracle"]
    # And the first agent decides, whatever others were run in.
    few = [found for found in everywhere("oracle", 4, 1.0) if found.cell.worlds != "plans"]
    (column,) = overview(few, everywhere("mine", 4, 0.5))
    assert agents(column) == ["oracle", "mine"]
    assert {len(one.episodes) for one in column.standings} == {24}


def test_other_odometers_do_not_count() -> None:
    assert overview(everywhere("oracle", 4, 1.0, odometer="poor")) == []


def test_probes_are_one_column() -> None:
    probes = ("Albot/Probe-Detour-v0", "Albot/Probe-Sunburst-v0")
    found = [results(cell("oracle", task=probe, worlds="scene"), 4) for probe in probes]
    columns = overview(everywhere("oracle", 2, 1.0), found)
    assert [column.name for column in columns] == ["homing", "probes"]
    assert len(columns[1].standings[0].episodes) == 8


def test_who_is_first_is_told_with_the_difference_in_the_same_episodes() -> None:
    found = [everywhere("oracle", 3, 1.0), everywhere("a", 3, 0.75), everywhere("b", 3, 0.5)]
    assert agents_sentence(overview(*found)) == (
        "First over all kinds of worlds: in homing `a` (albot1) (SPL 0.75, 21 episodes), ahead "
        "of `b` (albot1) by 0.250 (0.250–0.250)."
    )


def test_who_is_not_told_apart_is_not_said_to_be_behind() -> None:
    noise = np.random.default_rng(1).uniform(-0.4, 0.4, (7, 4))
    other = [
        replace(
            found,
            episodes=[
                replace(one, info={**one.info, "spl": 0.5 + extra})
                for one, extra in zip(found.episodes, some.tolist(), strict=True)
            ],
        )
        for found, some in zip(everywhere("b", 4, 0.5), noise, strict=True)
    ]
    said = agents_sentence(overview(everywhere("oracle", 4, 1.0), everywhere("a", 4, 0.5), other))
    assert "not told apart from `" in said
    assert "ahead" not in said


def test_no_sentence_is_made_of_too_few_episodes() -> None:
    two = [everywhere("a", 2, 0.75), everywhere("b", 2, 0.5)]
    assert agents_sentence(overview(*two)) == ""  # Of 14 each.
    enough = [everywhere("a", 3, 0.75), everywhere("b", 3, 0.5)]
    assert agents_sentence(overview(*enough)) != ""
    assert agents_sentence(overview(enough[0])) == ""  # Nor of one agent.
    luckier = everywhere("c", 2, 0.9)
    assert "`c`" not in agents_sentence(overview(*enough, luckier))


@pytest.mark.parametrize("more", [4, 6, 100])
def test_agents_of_more_episodes_are_compared_in_the_first_ones(more: int) -> None:
    found = everywhere("b", more, 0.5)
    said = agents_sentence(overview(everywhere("a", 3, 0.75), found, everywhere("c", 3, 0.25)))
    assert "`a` (albot1) (SPL 0.75, 21 episodes), ahead of `b` (albot1) by 0.250" in said


def test_an_agent_of_far_fewer_episodes_is_left_out_and_told() -> None:
    found = [everywhere(name, 60, spl) for name, spl in (("a", 0.75), ("b", 0.5), ("c", 0.4))]
    text = agents_sentence(overview(*found, everywhere("lucky", 3, 0.9)))
    assert "`a` (albot1) (SPL 0.75, 420 episodes; 1 agent with fewer left out), ahead of" in text
    assert "lucky" not in text


def mappers(count: int = 3) -> list[CellResults]:
    """Two mappers in three tasks: coming home with two odometers."""
    tasks = {BY_MAP: "map-homing", EXPLORE: "gap-explorer", PLACES: "place-judge"}
    found = [
        results(
            Cell(task=task, agent=agent, mapper=mapper, odometer="pioneer", worlds="offices"), count
        )
        for task, agent in tasks.items()
        for mapper in ("none", "albot1")
    ]
    poor = replace(found[1].cell, odometer="poor")
    silent = {"right_claims": 0, "false_claims": 0, "re_entries": 4}
    places = {"right_known": 3, "false_known": 1, "revisits": 4}
    for k, counts in ((2, silent), (5, places)):
        told = [replace(one, info={**one.info, **counts}) for one in found[k].episodes]
        found[k] = replace(found[k], episodes=told)
    return [*found, results(poor, count)]


def test_a_row_a_mapper_with_the_tasks_as_columns() -> None:
    lines = list(mappers_lines(MapperReport.of(mappers(), PROTOCOL, {"albot1": 6.5})))
    assert lines[4] == (
        "| mapper | home, pioneer | home, poor | claims | places | cost a reading (× `odometry`) |"
    )
    assert lines[6:] == [
        "| `none` | 67% (21%–94%) | – | none | – | – |",
        "| `albot1` | 67% (21%–94%) | 67% (21%–94%) | – | 75.0% · 75% (75%–75%) | 6.5 |",
        "| *episodes a mapper* | **3** | **3** | **3** | **3** | – |",
    ]


def test_mappers_that_were_compared_in_places_alone_have_rows() -> None:
    found = [each for each in mappers() if each.cell.task == PLACES]
    report = MapperReport.of(found, PROTOCOL, {})
    assert [(row.mapper, row.episodes, row.places) for row in report.rows] == [
        ("none", 0, 3),
        ("albot1", 0, 3),
    ]
    assert list(mappers_lines(report))[-2] == "| `albot1` | – | – | 75.0% · 75% (75%–75%) |"
    # One agent with its own mapper in each task is no comparison.
    own = [each for each in mappers() if each.cell.mapper == "albot1"]
    assert MapperReport.of(own, PROTOCOL, {}).rows == []


def test_the_page_opens_with_sentences_tables_and_picture() -> None:
    found = [*everywhere("oracle", 3, 1.0, mapper="none"), *everywhere("albot1-homing", 3, 0.75)]
    found += [*everywhere("homing", 3, 0.5), *mappers()]
    report = replace(Report.of_results(found, PROTOCOL), picture="results-mappers.png")
    page = render_page(report)
    marks = (
        "# Results\n\nFirst over all kinds of worlds: in homing",
        "**Agents**, over all kinds of worlds",
        "| `albot1-homing` (albot1) | 67% · 0.75 (0.75–0.75) |",
        "**Mappers**, in offices",
        "![success in coming home against what the map was like](results-mappers.png)",
        "The albot-env benchmark, protocol 1",
        "**Not complete:**",
        "## Agents by worlds",
        "## Mappers",
    )
    places = [page.find(mark) for mark in marks]
    assert places == sorted(places)
    assert min(places) == 0
    data = page_data(report)
    assert len(data["sentences"]) == 1
    assert [row["agent"] for row in data["overview"]][:3] == ["oracle", "albot1-homing", "homing"]


def test_cells_of_other_sources_are_told() -> None:
    report = Report.of_results(everywhere("albot1-homing", 3, 0.75), PROTOCOL)
    assert report.outdated == 7  # Made-up ones.
    assert "**Of other sources:** 7 cells were measured" in render_page(report)
    unknown = Report.of_results(everywhere("mine", 3, 0.75), PROTOCOL)
    assert "Of other sources" not in render_page(unknown)
