"""Figures of a cell and differences in the same episodes, against hand calculation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from albot_agents.benchmark.cell import EpisodeResult
from albot_agents.benchmark.protocol import find_protocol
from albot_agents.benchmark.table import FIGURES, compare, estimate, make_table
from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from tests.agents.benchmark.episodes import cell, results

PROTOCOL = find_protocol()


def changed(one: EpisodeResult, facts: dict[str, Any], **changes: Any) -> EpisodeResult:
    """An episode with other values of its info."""
    return replace(one, info={**one.info, **facts}, **changes)


def test_figures_by_hand() -> None:
    first, second, third = results(cell(), 3).episodes
    episodes = [
        changed(first, {"spl": 0.2, "right_claims": 3, "false_claims": 1, "re_entries": 5}),
        changed(second, {"spl": 0.6, "right_claims": 1, "false_claims": 0, "re_entries": 5}),
        changed(third, {"spl": 0.7, "right_claims": 0, "false_claims": 0, "re_entries": 0}),
    ]
    found = estimate(episodes)
    assert found["success_rate"].value == pytest.approx(2 / 3)
    assert found["success_rate"].ci95 == wilson(2, 3)
    assert found["spl"].value == pytest.approx(0.5)
    assert found["spl"].ci95 == pytest.approx((0.2, 0.7))
    assert found["precision"].value == pytest.approx(4 / 5)
    assert found["recall"].value == pytest.approx(4 / 10)
    assert found["collisions_per_m"].value == pytest.approx(1 / 15)
    assert found["position_error_m"].value == pytest.approx(0.1)
    # No episode has a distance that is known; none explores.
    assert not {"final_distance_m", "coverage_auc", "coverage", "rooms_share"} & set(found)


def test_what_nothing_is_known_of_is_no_figure() -> None:
    """The precision without a claim, the recall without a return."""
    silent = {"right_claims": 0, "false_claims": 0, "re_entries": 4}
    episodes = [changed(one, silent) for one in results(cell(), 4).episodes]
    found = estimate(episodes)
    assert "precision" not in found
    assert found["recall"].value == 0
    nowhere = [changed(one, {"re_entries": 0}) for one in episodes]
    assert "recall" not in estimate(nowhere)


def test_exploring_is_measured_where_an_episode_drove_far_enough() -> None:
    explored = [
        changed(one, {"coverage": 0.6, "rooms_entered": 3}, rooms=4, coverage_auc=0.3)
        for one in results(cell(), 3).episodes
    ]
    found = estimate(explored)
    assert "coverage_auc" not in found
    assert found["coverage"].value == pytest.approx(0.6)
    assert found["rooms_share"].value == pytest.approx(0.75)
    far = [replace(explored[0], driven=200.0), *explored[1:]]
    assert estimate(far)["coverage_auc"].value == pytest.approx(0.3)


def test_episodes_in_few_worlds_say_less_than_in_many() -> None:
    rng = np.random.default_rng(1)
    values = np.repeat(rng.uniform(size=5), 8)
    many = [
        changed(one, {"spl": float(value)})
        for one, value in zip(results(cell(), 40).episodes, values, strict=True)
    ]
    few = [replace(one, world=f"plan {k // 8}") for k, one in enumerate(many)]
    wide, narrow = (estimate(each)["spl"] for each in (few, many))
    assert wide.value == pytest.approx(narrow.value)
    assert np.ptp(wide.ci95) > 2 * np.ptp(narrow.ci95)


def test_a_rate_of_few_worlds_is_told_as_less_certain() -> None:
    many = [
        changed(one, {"is_success": k < 24}) for k, one in enumerate(results(cell(), 40).episodes)
    ]
    few = [replace(one, world=f"plan {k // 8}") for k, one in enumerate(many)]
    wide, narrow = (estimate(each)["success_rate"].ci95 for each in (few, many))
    assert narrow == wilson(24, 40)
    assert np.ptp(wide) > 1.5 * np.ptp(narrow)


def test_counts_that_are_all_right_are_not_certain() -> None:
    right = {"right_claims": 3, "false_claims": 0, "re_entries": 3}
    found = estimate([changed(one, right) for one in results(cell(), 4).episodes])
    assert found["precision"].ci95 == found["recall"].ci95 == wilson(12, 12)
    never = {"right_claims": 0, "false_claims": 1, "re_entries": 3}
    found = estimate([changed(one, never) for one in results(cell(), 4).episodes])
    assert found["precision"].ci95 == wilson(0, 4)
    assert found["recall"].ci95 == wilson(0, 12)


def test_episodes_in_one_world_are_drawn_one_by_one() -> None:
    probe = cell(task="Albot/Probe-Detour-v0", worlds="scene")
    episodes = [
        changed(one, {"spl": float(k % 2)}) for k, one in enumerate(results(probe, 40).episodes)
    ]
    assert len({one.world for one in episodes}) == 1
    spl = estimate(episodes)["spl"]
    half = 1.96 * 0.5 / np.sqrt(40)
    assert spl.ci95 == pytest.approx((0.5 - half, 0.5 + half), abs=0.02)
    told = compare("probe", episodes, results(probe, 40, 0.5).episodes, "spl")
    assert told is not None
    assert told.ci95 == pytest.approx((-half, half), abs=0.02)


def test_differences_are_of_the_episodes_that_both_have() -> None:
    here, there = results(cell(), 5, 0.5).episodes, results(cell("oracle"), 3, 0.9).episodes
    varied = [
        changed(one, {"spl": spl}) for one, spl in zip(here, (0.8, 0.6, 0.1, 0, 0), strict=True)
    ]
    found = compare("cell", varied, there, "spl")
    assert found is not None
    assert found.episodes == 3
    assert found.value == pytest.approx((-0.1 - 0.3 - 0.8) / 3)
    assert found.ci95 == pytest.approx((-0.8, -0.1))
    assert compare("cell", here[3:], there, "spl") is None
    success = compare("cell", here, there, "success")
    assert success is not None
    assert success.value == 0
    assert compare("cell", here, there, "coverage_auc") is None


@pytest.mark.parametrize("pose", ["start", "begin"])
def test_other_beginnings_are_refused(pose: str) -> None:
    """Episodes that were measured before something changed are not compared."""
    here, there = results(cell(), 3).episodes, results(cell("oracle"), 3).episodes
    moved = [*here[:2], replace(here[2], **{pose: np.nextafter(getattr(here[2], pose), 9)})]
    with pytest.raises(InputError, match=r"different beginnings in random:office:70002"):
        compare("cell", moved, there, "spl")


def test_the_table_is_in_the_protocols_order_and_tells_differences() -> None:
    cells = [
        cell(worlds="plans"),
        cell("random", mapper="none", odometer="poor"),
        cell("random", mapper="none"),
        cell("oracle", mapper="none", odometer="poor"),
        cell("albot1-homing", task="Albot/Explore-v0"),
    ]
    rows = make_table([results(each, 2, 0.25 * k) for k, each in enumerate(cells)], PROTOCOL)
    assert [row.cell for row in rows] == [cells[k] for k in (2, 3, 1, 0, 4)]
    assert [row.episodes for row in rows] == [2] * 5
    told = {row.cell: row.difference for row in rows}
    (poor,) = [difference for difference in told.values() if difference is not None]
    assert told[cells[1]] is poor
    assert poor.value == pytest.approx(0.25 - 0.75)


def test_a_cell_without_episodes_is_no_row() -> None:
    empty = results(cell(), 0)
    assert make_table([empty], PROTOCOL) == []


def test_all_figures_that_the_protocol_compares_are_in_the_table() -> None:
    for task in PROTOCOL.tasks.values():
        assert {"success": "success_rate"}.get(task.figure, task.figure) in FIGURES
