"""The table of mappers, its curve, sentences and picture, from made-up episodes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.homing_curve import LEAST, HomingCurve, fit_curve
from albot_agents.benchmark.mapper_page import MapperReport, mapper_section, sentences
from albot_agents.benchmark.mapper_picture import mappers_figure
from albot_agents.benchmark.mappers import (
    AGENTS,
    has_own_mapper,
    make_mapper_table,
    mapper_rows,
    sensors_for,
    suits,
)
from albot_agents.registry import BY_MAP, EXPLORE, HOMING, PLACES, find_agent
from albot_core.drawing.palette import SERIES, TEXT
from albot_core.evaluation.logistic import Logistic
from albot_core.mappers.registry import installed_mappers
from tests.agents.benchmark.episodes import PROTOCOL, results

HOMING_CURVE = "albot_agents.benchmark.homing_curve"
ERRORS = {"albot1": 0.1, "odometry": 4.0, "none": 4.0, "ratslam": 1.0}
"""Median error of home of each mapper (m)."""


def _cell(mapper: str, task: str = BY_MAP, agent: str = "", odometer: str = "pioneer") -> Cell:
    agent = agent or AGENTS[task]
    return Cell(task=task, agent=agent, mapper=mapper, odometer=odometer, worlds="offices")


def _results(cell: Cell, infos: list[dict[str, Any]]) -> CellResults:
    """Results whose episodes have these infos."""
    made = results(cell, len(infos))
    episodes = [
        replace(one, info={**one.info, **info})
        for one, info in zip(made.episodes, infos, strict=True)
    ]
    return replace(made, episodes=episodes)


def _homing(
    mapper: str, home: int, error: float, odometer: str = "pioneer", **info: Any
) -> CellResults:
    """Ten episodes of which some came home, with errors about one."""
    infos = [
        {
            "is_success": k < home,
            "spl": 1.0 if k < home else 0.0,
            "change": "none",
            "home_error_begin": error * 1.05 ** (k - 4.5),
            "home_error": 0.1 if k < home else 3.0,
            **info,
        }
        for k in range(10)
    ]
    return _results(_cell(mapper, odometer=odometer), infos)


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interval of a test may be rough."""
    monkeypatch.setattr("albot_core.evaluation.logistic._RESAMPLES", 60)


@pytest.fixture
def measured() -> list[CellResults]:
    """Four mappers: the better home is known, the more come home."""
    home = {"albot1": 10, "ratslam": 6, "odometry": 1, "none": 0}
    found = [_homing(name, home[name], error) for name, error in ERRORS.items()]
    claims = {"right_claims": 3, "false_claims": 1, "re_entries": 4, "coverage": 0.5}
    maps = {"map_entropy": -1.0, "true_map_entropy": -2.5}
    found.append(_results(_cell("albot1", EXPLORE), [claims | maps] * 10))
    places = {"right_known": 9, "false_known": 1, "revisits": 12, "recall": 0.75}
    return [*found, _results(_cell("albot1", PLACES), [places] * 10)]


def _report(measured: list[CellResults], **costs: float) -> MapperReport:
    curve = fit_curve(measured, "map-homing")
    assert curve is not None
    rows = make_mapper_table(measured, PROTOCOL)
    return MapperReport(rows=rows, curves={"map-homing": curve}, costs=costs)


def test_a_row_has_the_figures_of_all_tasks(measured: list[CellResults]) -> None:
    rows = make_mapper_table(measured, PROTOCOL)
    assert [row.mapper for row in rows] == ["none", "albot1", "odometry", "ratslam"]
    found = {name: each.value for name, each in rows[1].figures.items()}
    assert found == pytest.approx(
        {
            "success_rate": 1.0,
            "uncarried_rate": 1.0,
            "spl": 1.0,
            "home_error_begin": 0.1,
            "home_error": 0.1,
            "claims_precision": 0.75,
            "claims_recall": 0.75,
            "blur": 1.5,
            "places_precision": 0.9,
            "places_recall": 0.75,
        },
        rel=1e-2,
    )
    low, high = rows[3].figures["home_error_begin"].ci95
    assert low < 1.0 < high
    assert "blur" not in rows[3].figures


def test_episodes_in_which_the_robot_was_carried_are_told_apart() -> None:
    carried = _homing("albot1", 8, 5.0, change="carried")
    infos = [dict(one.info) for one in carried.episodes]
    infos[4:] = [{**info, "change": "none", "home_error_begin": 0.2} for info in infos[4:]]
    rows = make_mapper_table([_results(carried.cell, infos), _homing("none", 0, 5.0)], PROTOCOL)
    none, albot1 = (row.figures for row in rows)
    assert (albot1["success_rate"].value, albot1["carried_rate"].value) == (0.8, 1.0)
    assert albot1["carried_rate"].ci95 == pytest.approx((0.51, 1.0), abs=0.01)
    assert albot1["uncarried_rate"].value == pytest.approx(4 / 6)
    assert albot1["home_error_begin"].value == pytest.approx(0.2)
    assert "carried_rate" not in none


def test_an_agent_with_one_mapper_compares_none() -> None:
    assert make_mapper_table([_homing("albot1", 9, 0.1)], PROTOCOL) == []


def test_the_curve_finds_the_error_at_which_half_come_home() -> None:
    """Successes are drawn by a logistic curve of the error's logarithm with its middle at 2 m."""
    rng = np.random.default_rng(4)
    found = []
    for mapper in ("albot1", "odometry", "ratslam", "karto", "none", "gmapping"):
        errors = 10 ** rng.uniform(-1.0, 1.3, 100)
        home = rng.random(100) < 1 / (1 + (errors / 2.0) ** 3)
        infos = [
            {"is_success": s, "change": "none", "home_error_begin": e, "home_error": e}
            for s, e in zip(home.tolist(), errors.tolist(), strict=True)
        ]
        # Were they counted, these would move the curve.
        infos[:10] = [dict(infos[0], change="carried", home_error_begin=0.1, is_success=False)] * 10
        found.append(_results(_cell(mapper), infos))
    curve = fit_curve(found, "map-homing")
    assert curve is not None
    assert len(curve.errors) == 540
    half, most = curve.levels[0.5], curve.levels[0.9]
    assert half.ci95[0] < 2.0 < half.ci95[1]
    assert half.value == pytest.approx(2.0, rel=0.15)
    assert most.ci95[0] < 2.0 / 9 ** (1 / 3) < most.ci95[1]
    assert [one.episodes for one in curve.bins] == [
        int(((curve.errors >= low) & (curve.errors < high)).sum())
        for low, high in ((0.1, 0.2), (0.2, 0.5), (0.5, 1), (1, 2), (2, 5), (5, 10), (10, 99))
    ]
    for one in curve.bins:
        low, high = one.success.ci95
        assert low <= one.success.value <= high
    assert fit_curve(found, "patch-homing") is None


def test_a_failure_is_the_maps_if_home_is_believed_elsewhere_in_the_end() -> None:
    found = [_homing("albot1", 8, 0.1, home_error=0.9), _homing("odometry", 0, 4.0)]
    curve = fit_curve(found, "map-homing")
    assert curve is not None
    assert (curve.failures, curve.lost) == (12, 10)


def test_an_error_that_was_never_measured_is_not_told() -> None:
    """All come home, so no error is known at which only half do."""
    curve = fit_curve([_homing("albot1", 10, 0.1), _homing("ratslam", 10, 0.4)], "map-homing")
    assert curve is not None
    assert 0.5 not in curve.levels


def test_few_episodes_are_not_spoken_of(measured: list[CellResults]) -> None:
    report = _report(measured)
    assert all(row.episodes == 10 for row in report.rows)
    assert sentences(report) == []
    rows = [replace(row, episodes=20) for row in report.rows]
    assert len(sentences(replace(report, rows=rows))) == 1
    some = [rows[0], *report.rows[1:3], rows[3]]  # Only `none` and `ratslam` have enough.
    assert "0 of 1 mappers bring" in " ".join(sentences(replace(report, rows=some)))
    # The curve is over 40 episodes, but they are ten of the protocol, met by four mappers.
    curve = report.curves["map-homing"]
    assert (len(curve.errors), curve.keys) == (40, 10)
    enough = replace(report, curves={"map-homing": replace(curve, keys=20)})
    (said,) = sentences(enough)
    assert said.startswith("When home is believed ")


def test_one_episode_has_no_interval_but_that_of_a_rate() -> None:
    infos = [{"is_success": True, "spl": 1.0, "home_error_begin": 0.1, "home_error": 0.2}]
    found = [_results(_cell(name), infos) for name in ("none", "albot1")]
    report = MapperReport.of(found, PROTOCOL, {})
    row = next(line for line in mapper_section(report) if line.startswith("| `albot1`"))
    assert row == ("| `albot1` | 100% (21%–100%) | 1.00 | 0.10 | 0.20 | **1** · **0** · **0** |")


def test_resamples_without_a_level_widen_its_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    fits = [Logistic(intercept=0.0, slope=-1.0)] * 90 + [Logistic(intercept=0.0, slope=0.5)] * 10
    monkeypatch.setattr(f"{HOMING_CURVE}.bootstrap_logistic", lambda *_: fits)
    found = [_homing("albot1", 9, 0.1), _homing("odometry", 1, 10.0)]
    curve = fit_curve(found, "map-homing")
    assert curve is not None
    assert curve.levels[0.5].ci95 == pytest.approx((1.0, 1000.0))
    monkeypatch.setattr(f"{HOMING_CURVE}.bootstrap_logistic", lambda *_: fits[90:])
    always = fit_curve(found, "map-homing")
    assert always is not None
    assert always.levels[0.5].ci95 == pytest.approx((1000.0, 1000.0))
    monkeypatch.setattr(f"{HOMING_CURVE}.bootstrap_logistic", lambda *_: [])
    none = fit_curve(found, "map-homing")
    assert none is not None
    assert not none.levels


def test_the_sentences_say_what_the_figures_are(
    measured: list[CellResults], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("albot_agents.benchmark.mapper_page.FEWEST", 10)
    report = _report(measured, albot1=2.04, odometry=1.0)
    curve = report.curves["map-homing"]
    reached, need = sentences(report)
    most, half = (
        f"{error.value:.2g} m ({error.ci95[0]:.2g} to {error.ci95[1]:.2g} m) off"
        for error in (curve.levels[0.9], curve.levels[0.5])
    )
    assert need == (
        f"When home is believed {most} as the return begins, `map-homing` comes home in 90% of the "
        f"episodes, and in 50% when it is {half}; of the 23 failures, 100% ended with home "
        "believed more than 1 m off: there the map failed."
    )
    assert reached == (
        "With the odometer `pioneer`, 1 of 3 mappers bring `map-homing` home in 90% or more "
        "(`albot1`; `albot1` is the cheapest of them, at 2.0 times the cost of `odometry`); "
        "without a mapper it is 0%."
    )
    stuck = [*measured[1:], _homing("albot1", 5, 0.1, home_error=0.5)]
    assert sentences(_report(stuck))[1].endswith(
        "; of the 28 failures, 82% ended with home believed more than 1 m off: there the map "
        "failed, in the others the driving."
    )
    worse = [each if each.cell.mapper != "albot1" else _homing("albot1", 7, 0.1)
             for each in measured if each.cell.task == BY_MAP]  # fmt: skip
    assert (
        "0 of 3 mappers bring `map-homing` home in 90% or more; the best, `albot1`, does in 70%"
        in (" ".join(sentences(_report(worse))))
    )


def test_the_section_has_a_table_an_odometer(measured: list[CellResults]) -> None:
    more = [*measured, _homing("albot1", 10, 0.1, "poor")]
    lines = list(mapper_section(_report(more, albot1=620.4)))
    assert [line for line in lines if line.startswith("Driver")] == [
        "Driver `map-homing`, odometer `pioneer`:",
        "Driver `map-homing`, odometer `poor`:",
    ]
    row = next(line for line in lines if line.startswith("| `albot1`"))
    assert "| 100% (72%–100%) | 1.00 (1.00–1.00) | 0.10 (" in row
    assert row.endswith("| +1.50 (+1.50 to +1.50) | 75.0% (75.0%–75.0%) | 75% (75%–75%) "
                        "| 90.0% (90.0%–90.0%) | 75% (75%–75%) | 620 | 10 · 10 · 10 |")  # fmt: skip
    assert next(line for line in lines if line.startswith("| `ratslam`")).endswith(
        "| – | 10 · 0 · 0 |"
    )
    assert list(mapper_section(MapperReport())) == []


def _first(line: Line2D) -> tuple[float, float]:
    """The first point of a line."""
    x, y = np.asarray(line.get_xydata(), np.float64)[0].tolist()
    return x, y


def test_the_picture_has_a_point_for_each_row_at_its_figures(measured: list[CellResults]) -> None:
    report = _report([*measured, _homing("albot1", 9, 0.2, "poor")], albot1=3.0, odometry=1.0)
    curve: HomingCurve = report.curves["map-homing"]
    figure = mappers_figure(report.rows, curve, report.costs)
    errors, blur, costs = figure.axes
    points = {
        (*_first(line), line.get_color())
        for line in errors.get_lines()
        if line.get_marker() in ("o", "s")
    }
    assert points == {
        (row.figures["home_error_begin"].value, row.figures["uncarried_rate"].value,
         TEXT if row.mapper == "none"
         else SERIES[["albot1", "odometry", "ratslam"].index(row.mapper)])
        for row in report.rows
    }  # fmt: skip
    assert len([line for line in blur.get_lines() if line.get_marker() == "o"]) == 1
    assert sorted(_first(line)[0] for line in costs.get_lines() if line.get_marker() == "o") == [
        1.0,
        3.0,
    ]
    bare = mappers_figure(report.rows[2:3], curve, {})
    assert len(bare.axes) == 1


def test_errors_that_the_curve_does_not_tell_apart_are_drawn_as_one() -> None:
    found = [_homing("albot1", 10, 1e-7), _homing("odometry", 3, 4.0), _homing("none", 3, 4.0)]
    report = _report(found)
    (axes,) = mappers_figure(report.rows, report.curves["map-homing"], {}).axes
    points = [line for line in axes.get_lines() if line.get_marker() == "o"]
    assert _first(points[0])[0] == LEAST
    drawn = [
        np.asarray(part.vertices, np.float64)[:, 0]
        for each in axes.collections
        for part in each.get_paths()
    ]
    assert np.concatenate(drawn).min() == pytest.approx(LEAST)
    ticks = axes.xaxis.get_major_formatter()
    assert [ticks(error) for error in (0.01, 0.1, 10.0)] == ["≤ 0.01", "0.1", "10"]
    # No mapper is drawn last, and hollow: what lies below shows.
    assert (points[-1].get_fillstyle(), points[0].get_fillstyle()) == ("none", "full")
    assert _first(points[-1])[0] == pytest.approx(_first(points[-2])[0])


def test_each_mapper_has_a_style_of_its_own() -> None:
    found = [_homing(name, 5, 1.0) for name in ("none", *installed_mappers())]
    curve = fit_curve(found, "map-homing")
    assert curve is not None
    rows = make_mapper_table(found, PROTOCOL)
    (axes,) = mappers_figure(rows, curve, {}).axes
    points = [line for line in axes.get_lines() if line.get_marker() == "o"]
    assert len({(line.get_color(), line.get_fillstyle()) for line in points}) == len(rows)


def test_mappers_get_the_sensors_that_they_need_and_only_agents_that_see_the_same() -> None:
    assert sensors_for("ratslam-scenes") == {"scenes": "paper"}
    assert sensors_for("albot0") == sensors_for("none") == {}
    trained, scripted = find_agent("homing"), find_agent("patch-homing")
    assert suits(scripted, "gmapping")
    assert suits(trained, "ratslam")  # It sees no layer of a map.
    assert trained.file is not None
    config = {"observations": {"parts": ["laser", "home", "map_patch"]}}
    settings = {**trained.file.settings, "config": config}
    by_map = replace(trained, file=replace(trained.file, settings=settings))
    assert suits(by_map, "albot1-thesis")
    assert not suits(by_map, "gmapping")  # It has no exits to show.
    config["observations"]["parts"].append("place_graph")
    assert not suits(by_map, "association")


def test_rows_are_of_every_mapper_in_every_task() -> None:
    mappers = ("none", "albot1", "ratslam-scenes")
    rows = mapper_rows(PROTOCOL, mappers, {task: (AGENTS[task],) for task in AGENTS}, ("pioneer",))
    assert [(row.task, row.entrant.name, row.entrant.mapper) for row in rows] == [
        (task, AGENTS[task], mapper) for task in PROTOCOL.tasks if task in AGENTS
        for mapper in mappers
    ]  # fmt: skip
    assert rows[2].entrant.settings == {"scenes": "paper"}


def test_the_table_of_agents_has_each_with_its_own_mapper() -> None:
    facts = {"mine-01234567": {"mapper": "odometry"}}
    assert has_own_mapper(_cell("scan-matching"), facts)
    assert not has_own_mapper(_cell("albot1"), facts)
    assert has_own_mapper(_cell("albot1", EXPLORE), facts)
    assert has_own_mapper(_cell("odometry", HOMING, "mine-01234567"), facts)
    assert not has_own_mapper(_cell("albot1", HOMING, "mine-01234567"), facts)
