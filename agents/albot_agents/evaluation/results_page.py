"""The page of results, and the file of figures from which it is generated."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from albot_agents.evaluation.comparison import COMPARISONS, Figures
from albot_agents.evaluation.paired import FIGURES
from albot_core.files import write_text
from albot_core.json_document import read_json
from albot_core.plain_data import Location, read_record
from albot_core.yaml_document import format_value

_KEYS = (
    "success_rate", "ci95", "spl", "spl_ci95", "soft_spl", "mean_final_distance_m",
    "collisions_per_m", "coverage_auc", "coverage_auc_ci95", "rooms_share", "rooms_share_ci95",
    "precision", "recall", "recall_ci95", "mean_coverage", "difference", "difference_ci95",
)  # fmt: skip
"""Figures kept per row, if they are known."""

_REQUIRED_FIELDS = {
    "task": str, "agent": str, "odometer": str, "kind": str, "figure": str, "command": str,
    "episodes": int,
}  # fmt: skip
"""Keys that every row has, and the types of their values."""

_COLUMNS: Mapping[str, tuple[str, str | None, str]] = {
    "success": ("success_rate", "ci95", "{:.0%}"),
    "SPL": ("spl", "spl_ci95", "{:.2f}"),
    "from home in the end (m)": ("mean_final_distance_m", None, "{:.1f}"),
    "precision": ("precision", None, "{:.1%}"),
    "recall": ("recall", "recall_ci95", "{:.0%}"),
    "coverage over 200 m": ("coverage_auc", "coverage_auc_ci95", "{:.2f}"),
    "rooms entered": ("rooms_share", "rooms_share_ci95", "{:.0%}"),
    "collisions a metre": ("collisions_per_m", None, "{:.3f}"),
}
"""Columns of the table: the figure, its 95 % interval, and its format."""


def save_figures(figures: Figures, command: str, path: Path) -> list[dict[str, Any]]:
    """Write rows to a JSON file, replacing those of the same tasks; return all rows of the file.

    Raises:
        InputError: The file cannot be written, or exists and is not a file of figures.
    """
    tasks = {row.task for row in figures}
    rows = [row for row in read_figures(path) if row["task"] not in tasks]
    for row, found in figures.items():
        kept = {key: found[key] for key in ("episodes", *_KEYS) if found.get(key) is not None}
        rows.append({**asdict(row), "command": command, **kept})
    # The page's order does not depend on which tasks were measured last.
    order = {comparison.task: k for k, comparison in enumerate(COMPARISONS)}
    rows.sort(key=lambda row: order.get(row["task"], len(order)))
    write_text(path, json.dumps(rows, indent=1) + "\n")
    return read_figures(path)


def read_figures(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file written by `save_figures`; none if the file does not exist.

    Raises:
        InputError: The file holds something else.
    """
    if not path.exists():
        return []
    rows, where = read_json(path), Location(path)
    if not isinstance(rows, list):
        raise where.error("a list of rows", format_value(rows))
    return [_read_row(row, where.at(k)) for k, row in enumerate(rows)]


def _read_row(row: Any, where: Location) -> dict[str, Any]:
    given = row if isinstance(row, dict) else {}
    known = _REQUIRED_FIELDS | {name: _kind(name) for name in _KEYS if name in given}
    found = read_record(known, row, where)
    if found["figure"] not in FIGURES:
        raise where.at("figure").error(f"one of {', '.join(FIGURES)}", found["figure"])
    return found


def _kind(key: str) -> Any:
    """Return the type of a figure."""
    return tuple[float, float] if key.endswith("ci95") else float


def render_page(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the page of results in Markdown."""
    lines = [
        "# Results",
        "",
        "All agents, measured in buildings and with odometers that were not used for training or",
        "tuning. With one odometer in one kind of worlds all agents of a task meet the same",
        "episodes: world, start, outward journey or tour, boxes and people. Their sensors, with",
        "noise of their own, their maps and what they do differ. In brackets: 95 % intervals,",
        "Wilson's for rates and bootstrapped ones for means. The last column is the mean",
        "difference from the first agent, episode by episode. A dash: no figure, such as the",
        "precision of an agent that claims nothing.",
        "[environments.md](environments.md) explains the columns.",
    ]
    for task in dict.fromkeys(row["task"] for row in rows):
        its = [row for row in rows if row["task"] == task]
        commands = dict.fromkeys(row["command"] for row in its)
        lines += ["", f"## {task}", "", "```", *commands, "```", "", *_table(its)]
    return "\n".join(lines) + "\n"


def _table(rows: Sequence[Mapping[str, Any]]) -> Iterable[str]:
    columns = {name: how for name, how in _COLUMNS.items() if any(how[0] in row for row in rows)}
    names = [*columns, f"{FIGURES[rows[0]['figure']]} less the first's"]
    yield "| worlds | odometer | agent | episodes | " + " | ".join(names) + " |"
    yield "|---" * (4 + len(names)) + "|"
    for row in rows:
        cells = [row["kind"], row["odometer"], f"`{row['agent']}`", str(row["episodes"])]
        cells += [_written(row, *how) for how in columns.values()]
        cells.append(_written(row, "difference", "difference_ci95", "{:+.2f}"))
        yield "| " + " | ".join(cells) + " |"


def _written(row: Mapping[str, Any], key: str, interval: str | None, form: str) -> str:
    if key not in row:
        return "–"
    text = form.format(row[key])
    if interval is not None and interval in row:
        low, high = row[interval]
        dash = " to " if "+" in form else "–"
        text += f" ({form.format(low)}{dash}{form.format(high)})"
    return text
