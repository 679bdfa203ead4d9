"""The picture of the mappers: how good a map must be to come home."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from albot_agents.benchmark.homing_curve import LEAST, HomingCurve
from albot_agents.benchmark.mappers import MapperRow, home_radius
from albot_agents.benchmark.table import Estimate
from albot_core.drawing.palette import FAINT, RULE, SERIES, TEXT
from albot_core.mappers.registry import NO_MAPPER

_MARKERS = "os^DvP"
"""Markers of the odometers."""
_FILLS: tuple[Any, ...] = ("full", "none", "left")
"""How markers of mappers with the same colour are filled."""


def mappers_figure(
    rows: Sequence[MapperRow], curve: HomingCurve, costs: Mapping[str, float]
) -> Figure:
    """Return the picture of one driver: its success against what the maps were like.

    Each point is a mapper with an odometer, with 95 % intervals, without the episodes in which the
    robot was carried. The first panel shows the error of home (m) when the return begins, the fit
    to all single episodes, and their success in bins; the others show how blurred the map is after
    exploring, and what a reading costs, in costs of `odometry`, as far as these are known.

    Args:
        rows: The rows of the driver.
        curve: Its episodes.
        costs: Costs of mappers.
    """
    blurred = any("blur" in row.figures for row in rows)
    priced = any(row.mapper in costs for row in rows)
    # No mapper is drawn last: its hollow points lie about those of `odometry`.
    rows = sorted(
        (row for row in rows if "uncarried_rate" in row.figures),
        key=lambda row: row.mapper == NO_MAPPER,
    )
    widths = [1.7, *[1.0] * (blurred + priced)]
    figure = Figure(figsize=(3.2 * sum(widths) + 1.6, 4.6), layout="constrained")
    panels = figure.subplots(1, len(widths), sharey=True, width_ratios=widths, squeeze=False)[0]
    left = list(panels[1:])
    _draw_errors(panels[0], rows, curve)
    if blurred:
        _draw_blur(left.pop(0), rows)
    if priced:
        _draw_costs(left.pop(0), rows, costs)
    panels[0].set(ylabel="episodes that came home", ylim=(-0.03, 1.04))
    panels[0].set_yticks(np.linspace(0, 1, 6), [f"{share:.0%}" for share in np.linspace(0, 1, 6)])
    for axes in panels:
        axes.grid(color=RULE, linewidth=0.6)
        axes.set_axisbelow(True)
    figure.legend(handles=_legend(rows), loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _draw_errors(axes: Axes, rows: Sequence[MapperRow], curve: HomingCurve) -> None:
    """Draw success against the error of home: single episodes, bins, fit, and all rows."""
    low, high = curve.errors.min(), curve.errors.max()
    # Single episodes are ticks at the edges: those that came home at the top.
    for success, height in ((True, 1.02), (False, -0.02)):
        errors = curve.errors[curve.success == success]
        axes.plot(errors, np.full(len(errors), height), "|", color=FAINT, ms=5, zorder=1)
    x = np.linspace(np.log10(low), np.log10(high), 200)
    axes.plot(10**x, curve.fit.probability(x), color=TEXT, lw=1.5, zorder=2)
    for some in curve.bins:
        rate = some.success
        axes.errorbar(some.error, rate.value, _spread(rate), fmt="_", ms=14, color=TEXT, lw=2.0)
    axes.axvline(home_radius(), color=FAINT, lw=1.0, ls="--", zorder=1)
    for row in rows:
        error = row.figures.get("home_error_begin")
        if error is not None:
            _draw_point(axes, rows, row, _floored(error))
    _use_log_scale(axes)
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda error, _: f"{'≤ ' if np.isclose(error, LEAST) else ''}{error:g}")
    )
    axes.set_xlabel("error of home when the return begins, median (m)")


def _floored(error: Estimate) -> Estimate:
    """Return an error no smaller than the smallest that the curve tells apart."""
    low, high = error.ci95
    return Estimate(value=max(error.value, LEAST), ci95=(max(low, LEAST), max(high, LEAST)))


def _draw_blur(axes: Axes, rows: Sequence[MapperRow]) -> None:
    """Draw success against how blurred maps are."""
    for row in rows:
        if (blur := row.figures.get("blur")) is not None:
            _draw_point(axes, rows, row, blur)
    axes.set_xlabel("map entropy less the true map's (nats)")


def _draw_costs(axes: Axes, rows: Sequence[MapperRow], costs: Mapping[str, float]) -> None:
    """Draw success against costs."""
    for row in rows:
        if (cost := costs.get(row.mapper)) is not None:
            _draw_point(axes, rows, row, Estimate(value=cost, ci95=(cost, cost)))
    _use_log_scale(axes)
    axes.set_xlabel("cost a reading, in those of odometry")


def _use_log_scale(axes: Axes) -> None:
    """Make the horizontal axis logarithmic, with plain numbers."""
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:g}"))


def _draw_point(axes: Axes, rows: Sequence[MapperRow], row: MapperRow, x: Estimate) -> None:
    success, style = row.figures["uncarried_rate"], _style(rows, row.mapper, row.odometer)
    axes.errorbar(
        x.value,
        success.value,
        _spread(success),
        _spread(x),
        ecolor=to_rgba(style["color"], 0.4),
        elinewidth=0.7,
        zorder=4,
        **style,
    )


def _spread(estimate: Estimate) -> Any:
    """Return the lengths of an interval below and above its figure, for `errorbar`."""
    low, high = estimate.ci95
    return [[max(0.0, estimate.value - low)], [max(0.0, high - estimate.value)]]


def _style(rows: Sequence[MapperRow], mapper: str, odometer: str) -> dict[str, Any]:
    """Return the style of a point: colour and fill tell the mapper, the marker the odometer.

    Points without a mapper are hollow and larger.
    """
    mappers, odometers = _names(rows)
    style: dict[str, Any] = {
        "color": TEXT, "fillstyle": "none", "markerfacecoloralt": "none", "linestyle": "none",
        "marker": _MARKERS[odometers.index(odometer) % len(_MARKERS)], "markersize": 8,
    }  # fmt: skip
    if mapper != NO_MAPPER:
        number = mappers.index(mapper)
        style["color"] = SERIES[number % len(SERIES)]
        style["fillstyle"] = _FILLS[number // len(SERIES) % len(_FILLS)]
        style["markersize"] = 6
    return style


def _names(rows: Sequence[MapperRow]) -> tuple[list[str], list[str]]:
    """Return the mappers and the odometers of some rows, each once."""
    return (
        list(dict.fromkeys(row.mapper for row in rows)),
        list(dict.fromkeys(row.odometer for row in rows)),
    )


def _legend(rows: Sequence[MapperRow]) -> list[Line2D]:
    mappers, odometers = _names(rows)
    handles = [
        Line2D([], [], label=mapper, **_style(rows, mapper, odometers[0])) for mapper in mappers
    ]
    for number, odometer in enumerate(odometers if len(odometers) > 1 else ()):
        marker = _MARKERS[number % len(_MARKERS)]
        handles.append(
            Line2D([], [], color=TEXT, marker=marker, ls="none", label=f"odometer {odometer}")
        )
    handles.append(Line2D([], [], color=TEXT, lw=1.5, label="fit to all episodes"))
    bins: dict[str, Any] = {"marker": "_", "ms": 14, "mew": 2.0, "ls": "none"}
    handles.append(Line2D([], [], color=TEXT, label="episodes by their errors", **bins))
    handles.append(Line2D([], [], color=FAINT, ls="--", lw=1.0, label="radius of home"))
    return handles
