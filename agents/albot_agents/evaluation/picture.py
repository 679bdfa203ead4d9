"""A picture of the failed episodes: floor plan, driven path, home and end position."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from albot_agents.evaluation.trial import Outcome
from albot_core.drawing.figure import draw_scale_bar, round_length
from albot_core.drawing.palette import BELIEVED, HOME, TRUTH, WALL

MOST = 24
"""Largest number of failures that are drawn: the first ones."""
_COLUMNS = 4


def failures_figure(outcomes: Sequence[Outcome]) -> Figure | None:
    """Return the picture of the episodes without success; None if all succeeded."""
    failures = [outcome for outcome in outcomes if not outcome.info.get("is_success")]
    if not failures:
        return None
    shown = failures[:MOST]
    columns = min(_COLUMNS, len(shown))
    rows = math.ceil(len(shown) / columns)
    figure = Figure(figsize=(4.2 * columns, 3.6 * rows + 0.6), layout="constrained")
    figure.suptitle(
        f"{len(failures)} of {len(outcomes)} episodes failed"
        + (f"; the first {MOST}" if len(failures) > MOST else "")
    )
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    for axes, outcome in zip(panels, shown, strict=False):
        _draw(axes, outcome)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw(axes: Axes, outcome: Outcome) -> None:
    """Draw one failure."""
    trial, path, info = outcome.trial, outcome.path, outcome.info
    walls = trial.loaded_world.walls
    lines = list(walls.reshape(-1, 2, 2))
    axes.add_collection(LineCollection(lines, colors=WALL, linewidths=1.0))
    axes.plot(path[:, 0], path[:, 1], color=TRUTH, lw=1.0, label="path driven")
    axes.plot(*path[0], "o", color=TRUTH, ms=5, label="start")
    axes.plot(*outcome.start[:2], "o", color=HOME, mfc="none", ms=10, label="home")
    axes.plot(*path[-1], "x", color=BELIEVED, ms=9, mew=2.0, label="end")
    declared = info.get("declared")
    ended = "declared" if declared else "time limit reached,"
    apart = info.get("distance_home", math.nan)
    axes.set_title(f"{trial.world}, seed {trial.seed}\n{ended} {apart:.1f} m from home", fontsize=8)
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()
    left, right = axes.get_xlim()
    draw_scale_bar(axes, round_length(right - left))
