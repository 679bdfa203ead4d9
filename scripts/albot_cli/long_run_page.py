"""The page of the long journey: time per reading, and size of the map, along the path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import SERIES
from albot_core.files import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = Mapping[str, Any]

COMMAND = "albot bench --part journey --out docs/journey.md --force"

_COLUMNS: Mapping[str, tuple[str, str, float]] = {
    "km": ("path_km", "{:.1f}", 1.0),
    "µs a reading": ("us_per_reading", "{:.0f}", 1.0),
    "ratio": ("ratio", "{:.2f}", 1.0),
    "KiB": ("memory_bytes", "{:.0f}", 1 / 1024),
    "surfaces": ("surfaces", "{:.0f}", 1.0),
    "places": ("places", "{:.0f}", 1.0),
    "their exits": ("exits", "{:.0f}", 1.0),
    "their surfaces": ("described", "{:.0f}", 1.0),
    "visits": ("visits", "{:.0f}", 1.0),
    "events": ("events", "{:.0f}", 1.0),
    "points of trail": ("trail_points", "{:.0f}", 1.0),
    "links": ("trail_links", "{:.0f}", 1.0),
}
"""Columns of the table: the figure, its format, and the factor to its unit."""


def write_long_run(path: Path, rows: Sequence[Row], machine: Row) -> list[Path]:
    """Write the page, and beside it its picture; return both paths.

    Raises:
        InputError: A file cannot be written.
    """
    picture = path.with_suffix(".png")
    save_figure(journey_figure(rows), picture)
    write_text(path, page(rows, machine, picture.name))
    return [path, picture]


def page(rows: Sequence[Row], machine: Row, picture: str) -> str:
    """Return the page in Markdown."""
    lines = [
        "# A long journey",
        "",
        f"`{rows[0]['name']}` guided from room to room of `{rows[0]['world']}`, drawn at random, "
        f"for {rows[-1]['path_km']:.0f} km: {sum(row['readings'] for row in rows):,} readings. A "
        "reading's cost is the mean processor time of the mapper's update over a stage. The ratio "
        "divides it by the time of a thousand additions in Python, measured in between, so that a "
        "busier machine does not look like a slower mapper. The memory is that of all arrays in a "
        "saved map.",
        "",
        f"![Cost and memory along the way]({picture})",
        "",
        *_changes(rows),
        "",
        "| " + " | ".join(_COLUMNS) + " |",
        "|" + "---:|" * len(_COLUMNS),
        *map(_line, rows),
        "",
        f"Measured on {machine['processor']}, Python {machine['python']}, by `{COMMAND}`.",
    ]
    return "\n".join(lines) + "\n"


def _line(row: Row) -> str:
    cells = [form.format(unit * row[name]) for name, form, unit in _COLUMNS.values()]
    return f"| {' | '.join(cells)} |"


def _changes(rows: Sequence[Row]) -> list[str]:
    """Return a sentence on the figures' slopes over the second half, by linear regression."""
    half = rows[len(rows) // 2 :]
    if len(half) < 3:
        return []
    kilometres = [row["path_km"] for row in half]
    names = "ratio", "memory_bytes", "places", "surfaces", "trail_links"
    slopes = [np.polyfit(kilometres, [row[name] for row in half], 1)[0] for name in names]
    cost = 100 * slopes[0] / float(np.mean([row["ratio"] for row in half]))
    return [
        f"In the second half, a kilometre more adds {cost:+.1f} % to the ratio, "
        f"{slopes[1] / 1024:+.1f} KiB, {slopes[2]:+.1f} places, {slopes[3]:+.1f} surfaces of the "
        f"map, and {slopes[4]:+.0f} links of the trail."
    ]


def journey_figure(rows: Sequence[Row]) -> Figure:
    """Return the plot of cost, memory and size of the map over the path length."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.4), layout="constrained")
    kilometres = [row["path_km"] for row in rows]
    panels = (
        ("a reading's cost over a thousand additions'", {"": "ratio"}, 1.0),
        ("memory (KiB)", {"": "memory_bytes"}, 1 / 1024),
        (
            "remembered",
            {"surfaces": "surfaces", "places": "places", "points of trail": "trail_points"},
            1.0,
        ),
    )
    for axes, (title, names, unit) in zip(figure.subplots(1, 3), panels, strict=True):
        for colour, (label, name) in zip(SERIES, names.items(), strict=False):
            heights = [unit * row[name] for row in rows]
            axes.plot(kilometres, heights, ".-", color=colour, label=label)
        axes.set(title=title, xlabel="way (km)", ylim=(0, None))
        if len(names) > 1:
            axes.legend(frameon=False)
    return figure
