"""The page of results: what it says, and that it says where episodes are missing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.mapper_page import MapperReport
from albot_agents.benchmark.page import Report, page_data, render_lines, render_page
from albot_agents.benchmark.protocol import find_protocol
from albot_agents.benchmark.table import make_table
from albot_agents.registry import BY_MAP
from tests.agents.benchmark.episodes import cell, results
from tests.conftest import ROOT

PROTOCOL = find_protocol()
MINE: dict[str, Any] = {
    "task": "Albot/Homing-v0", "fingerprint": "ab" * 32, "samples": 16_000_000,
    "asked": 15_990_000, "algorithm": "ppo", "seed": 1, "command": "albot train plan.yml",
    "seconds": 7200.0,
}  # fmt: skip


def report(*found: CellResults, **agents: Any) -> Report:
    """The report of some cells."""
    rows = make_table(found, PROTOCOL)
    return Report(protocol=PROTOCOL, rows=rows, agents=agents)


def lines(text: str, start: str) -> Sequence[str]:
    """The lines that begin so."""
    return [line for line in text.splitlines() if line.startswith(start)]


def test_a_row_an_agent_with_worlds_as_columns() -> None:
    page = render_page(
        report(
            results(cell("oracle", mapper="none"), 100, 1.0),
            results(cell(), 100, 0.5),
            results(cell(worlds="mazes"), 4, 0.25),
            results(cell("mine"), 100, 0.75),
            mine=MINE,
        )
    )
    assert "| agent | budget | offices | mazes | episodes a cell |" in page
    assert lines(page, "| `oracle` | –") == ["| `oracle` | – | 75% · 1.00 (1.00–1.00) | – | 100 |"]
    assert lines(page, "| `albot1-homing` (albot1) | –")[0] == (
        "| `albot1-homing` (albot1) | – | 75% · 0.50 (0.50–0.50) | 75% · 0.25 (0.25–0.25) | **4** |"
    )
    # Filed under the budget of 100 million samples.
    assert lines(page, "| `mine`")[0].startswith("| `mine` (albot1) | 100 M |")
    assert "| `mine` | Albot/Homing-v0 | ppo | 1 | 16,000,000 | 100 M | 2.0 |" in page
    assert "`albot train plan.yml` | `abababab` |" in page


def test_it_says_which_cells_have_too_few_episodes() -> None:
    short = render_page(report(results(cell(), 3), results(cell("oracle"), 100)))
    assert "**Not complete:** 1 of 2 cells have fewer episodes" in short
    assert "the smallest has 3." in " ".join(short.split())
    assert "Not complete" not in render_page(report(results(cell(), 100)))
    plans = cell(worlds="plans")
    page = render_page(report(results(plans, 100)))
    assert "than the 112 that the protocol asks for, the smallest has 100." in " ".join(
        page.split()
    )
    assert lines(page, "| `albot1-homing`")[0].endswith("| **100** |")
    assert "Not complete" not in render_page(report(results(plans, 112)))


def test_cells_of_mappers_count_among_the_incomplete() -> None:
    by_map = {"task": BY_MAP, "agent": "map-homing", "odometer": "pioneer", "worlds": "offices"}
    found = [results(Cell(**by_map, mapper=name), 3) for name in ("none", "albot1")]
    alone = Report(
        protocol=PROTOCOL, rows=[], agents={}, mappers=MapperReport.of(found, PROTOCOL, {})
    )
    page = render_page(alone)
    assert "**Not complete:** 2 of 2 cells have fewer" in page
    assert "## Agents" not in page
    _, row = lines(page, "| `albot1`")
    assert row.endswith("| **3** · **0** · **0** |")
    assert "home in 90%" not in page


def test_only_what_lies_beside_the_page_is_linked(tmp_path: Path) -> None:
    some = report(results(cell("homing"), 2), homing=MINE)
    for page in (render_page(some), render_page(some, tmp_path)):
        assert "](" not in page
        assert "(benchmark.md)" in page
    docs = render_page(some, ROOT / "docs")
    for link in (
        "[benchmark.md](benchmark.md)",
        "[environments.md](environments.md)",
        "[`homing`](../agents/albot_agents/trained/homing.md)",
    ):
        assert link in docs


def test_all_figures_stand_with_their_intervals_and_differences() -> None:
    page = render_page(report(results(cell("oracle"), 4, 1.0), results(cell(), 4, 0.5)))
    assert "| SPL less the first's |" in page
    (row,) = lines(page, "| offices | pioneer | `albot1-homing`")
    assert row.startswith("| offices | pioneer | `albot1-homing` (albot1) | 4 | 75% (30%–95%) |")
    assert row.endswith("| -0.50 (-0.50 to -0.50) |")
    (first,) = lines(page, "| offices | pioneer | `oracle`")
    assert first.endswith("| – |")


def test_other_odometers_have_tables_of_their_own() -> None:
    only = render_page(report(results(cell(), 4)))
    assert "## Odometers" not in only
    both = render_page(report(results(cell(), 4), results(cell(odometer="poor"), 4)))
    assert both.index("With the odometer `pioneer`") < both.index("## Odometers")
    assert both.index("## Odometers") < both.index("With the odometer `poor`:")
    assert "`ideal`" not in both


def test_probes_share_one_table() -> None:
    probes = ("Albot/Probe-Detour-v0", "Albot/Probe-Sunburst-v0")
    found = [results(cell(task=probe, worlds="scene"), 4) for probe in probes]
    page = render_page(report(*found))
    assert "| agent | budget | detour | sunburst | episodes a cell |" in page
    assert "75% (30%–95%) | 75% (30%–95%) | **4** |" in page


def test_one_episode_has_no_interval_but_that_of_a_rate() -> None:
    page = render_page(report(results(cell("oracle"), 1, 1.0), results(cell(), 1, 0.5)))
    assert "| `albot1-homing` (albot1) | – | 0% · 0.50 | **1** |" in page
    (row,) = lines(page, "| offices | pioneer | `albot1-homing`")
    assert "| 0% (0%–79%) | 0.50 | 0.50 |" in row
    assert row.endswith("| -0.50 |")


def test_the_data_are_json_with_the_budget_of_each_agent() -> None:
    data = page_data(report(results(cell("oracle"), 2), results(cell("mine"), 2), mine=MINE))
    assert json.loads(json.dumps(data, allow_nan=False)) == json.loads(json.dumps(data))
    assert data["protocol"] == 1
    assert data["agents"]["mine"]["budget"] == 100_000_000
    assert [row["agent"] for row in data["rows"]] == ["oracle", "mine"]
    assert data["rows"][1]["difference"]["value"] == 0.0
    assert data["rows"][0]["difference"] is None


def test_lines_of_one_agent() -> None:
    every = report(results(cell("oracle"), 4, 1.0), results(cell(), 4, 0.5))
    text = "\n".join(render_lines(every.only({"albot1-homing"})))
    assert "oracle" not in text
    assert "| `albot1-homing` (albot1) | – | 75% · 0.50 (0.50–0.50) | **4** |" in text
    assert "-0.50 (-0.50 to -0.50) |" in text  # Of the same episodes as the reference's.


def test_a_page_of_nothing() -> None:
    assert render_page(report()).startswith("# Results\n")


@pytest.mark.parametrize("samples", [10**9])
def test_more_samples_than_any_budget(samples: int) -> None:
    page = render_page(report(results(cell("mine"), 2), mine=MINE | {"asked": samples}))
    assert "| `mine` (albot1) | more |" in page
