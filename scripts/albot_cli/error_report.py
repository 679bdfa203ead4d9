"""The errors of trajectories over time, as by evo: figures, a table, CSV and a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from albot_core.drawing.palette import BELIEVED, CORRECTED, RULE, TEXT
from albot_core.evaluation.moments import read_clock
from albot_core.evaluation.trajectory import ErrorStatistics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from albot_cli.map_report import Score
    from albot_core.logs.log import Log

_STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "count")
_ROWS = {
    "ape_m": "APE, m",
    "rpe_m": "RPE, m per metre",
    "rpe_deg": "RPE, ° per metre",
}
"""Kinds of errors and their names in the table."""
_COLOURS = {"corrected": CORRECTED, "odometer": TEXT}
"""Colours of what is not the mapper's own."""


def error_figures(score: Score) -> dict[str, Any] | None:
    """Return the statistics of a trajectory's errors; None without a reference.

    `ape_m` is of the distances after alignment (m), `rpe_m` and `rpe_deg` are of the translation
    (m) and of the rotation (degrees) in each metre of the path; None if the path is too short.
    """
    if score.positions is None:
        return None
    relative = score.relative
    return {
        "ape_m": _statistics(score.positions.distances),
        "rpe_m": None if relative is None else _statistics(relative.translations),
        "rpe_deg": None if relative is None else _statistics(np.degrees(relative.rotations)),
    }


def _statistics(errors: np.ndarray) -> dict[str, float]:
    found = ErrorStatistics.of(errors)
    values = found.rmse, found.mean, found.median, found.std, found.smallest, found.largest
    return dict(zip(_STATISTICS, (*values, found.count), strict=True))


def errors_markdown(scores: Mapping[str, Score]) -> str:
    """Return the table of the errors in Markdown, a row for each trajectory and kind of error."""
    lines = [f"| | error | {' | '.join(_STATISTICS)} |", "|---|---" + "|---:" * 7 + "|"]
    for name, score in scores.items():
        for kind, found in (error_figures(score) or {}).items():
            if found is not None:
                cells = [f"{found[each]:.4f}" for each in _STATISTICS[:-1]]
                cells.append(str(found["count"]))
                lines.append(f"| {name} | {_ROWS[kind]} | {' | '.join(cells)} |")
    note = (
        "APE: distance from the reference after rigid alignment of the trajectory. RPE: error of "
        "the motion over each metre of the reference's path. Both as by evo, `evo_ape -a` and "
        "`evo_rpe --delta 1 --delta_unit m --pairs_from_reference`."
    )
    return "\n".join((*lines, "", note)) + "\n"


def errors_csv(log: Log, scores: Mapping[str, Score]) -> str:
    """Return a line for each scan: its stamp (s), and the distance of each trajectory (m)."""
    columns = []
    for score in scores.values():
        column = [""] * len(log.stamps)
        if score.positions is not None:
            positions = score.positions
            for at, distance in zip(positions.moments, positions.distances, strict=True):
                column[at] = f"{distance:.6f}"
        columns.append(column)
    lines = [",".join(("stamp_s", *(f"{name}_ape_m" for name in scores)))]
    rows = zip(log.stamps.tolist(), *columns, strict=True)
    lines += [",".join((f"{stamp:.6f}", *cells)) for stamp, *cells in rows]
    return "\n".join(lines) + "\n"


def errors_figure(title: str, log: Log, scores: Mapping[str, Score]) -> Figure:
    """Return the figure of the errors: APE over time above, RPE along the path below."""
    from matplotlib.figure import Figure  # slow to load

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    above, below = figure.subplots(2, 1)
    has_clock = read_clock(log.stamps).is_good
    times = log.stamps - log.stamps[0] if has_clock else np.arange(len(log.stamps))
    for name, score in scores.items():
        colour = _COLOURS.get(name, BELIEVED)
        if score.positions is not None:
            at, distances = score.positions.moments, score.positions.distances
            rmse = math.sqrt(float(np.mean(distances**2)))
            label = f"{name}, rmse {rmse:.3f} m"
            above.plot(times[at], distances, color=colour, lw=1.2, label=label)
        if score.relative is not None:
            along, errors = score.relative.paths, score.relative.translations
            label = f"{name}, rmse {math.sqrt(float(np.mean(errors**2))):.3f} m"
            below.plot(along, errors, color=colour, lw=1.0, label=label)
    above.set(xlabel="time (s)" if has_clock else "scan", ylabel="APE (m)", title=title)
    below.set(xlabel="path (m)", ylabel="RPE per metre (m)")
    for axes in (above, below):
        axes.set_ylim(bottom=0.0)
        axes.grid(color=RULE, linewidth=0.6)
        if axes.get_lines():
            axes.legend(frameon=False, fontsize=9)
    return figure
