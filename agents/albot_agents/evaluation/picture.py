"""A picture of the failed episodes: floor plan, driven path, home and end position."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from albot_agents.evaluation.trial import Outcome
from albot_core.files import atomic_write

MOST = 24
"""Largest number of failures that are drawn: the first ones."""
_COLUMNS = 4


def save_failures(outcomes: Sequence[Outcome], path: Path) -> None:
    """Draw the episodes without success and save them as a PNG, atomically.

    Raises:
        InputError: The file cannot be written.
    """
    failures = [outcome for outcome in outcomes if not outcome.info.get("is_success")]
    shown = failures[:MOST]
    rows = max(1, math.ceil(len(shown) / _COLUMNS))
    figure = Figure(figsize=(4.2 * _COLUMNS, 3.6 * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(
        f"{len(failures)} of {len(outcomes)} episodes failed"
        + (f"; the first {MOST}" if len(failures) > MOST else "")
    )
    panels = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    for axes, outcome in zip(panels, shown, strict=False):
        _draw(axes, outcome)
    if shown:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    with atomic_write(path) as stream:
        figure.savefig(stream, format="png", dpi=90, metadata={"Software": "albot-env"})


def _draw(axes: Axes, outcome: Outcome) -> None:
    """Draw one failure."""
    trial, path, info = outcome.trial, outcome.path, outcome.info
    walls = trial.loaded_world.walls
    lines = list(walls.reshape(-1, 2, 2))
    axes.add_collection(LineCollection(lines, colors="#2b2f36", linewidths=1.0))
    axes.plot(path[:, 0], path[:, 1], color="#2a6fbb", lw=1.0, label="path driven")
    axes.plot(*path[0], "o", color="#2a6fbb", ms=5, label="start")
    axes.plot(*outcome.start[:2], "o", color="#b5338a", mfc="none", ms=10, label="home")
    axes.plot(*path[-1], "x", color="#c0392b", ms=9, mew=2.0, label="end")
    declared = info.get("declared")
    ended = "declared" if declared else "time limit reached,"
    apart = info.get("distance_home", math.nan)
    axes.set_title(f"{trial.world}, seed {trial.seed}\n{ended} {apart:.1f} m from home", fontsize=8)
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()
