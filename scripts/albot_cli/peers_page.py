"""The page of the other simulators: their speed, and the accuracy of their ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from albot_core.files import write_text

Row = Mapping[str, Any]

COMMAND = "albot bench --part peers --out docs/peers.md --force"


def write_peers(path: Path, rows: Sequence[Row], machine: Row) -> list[Path]:
    """Write the page; return its path.

    Raises:
        InputError: The file cannot be written.
    """
    write_text(path, page(rows, machine))
    return [path]


def page(rows: Sequence[Row], machine: Row) -> str:
    """Return the page in Markdown."""
    cases = list(dict.fromkeys((row["world"], row["beams"]) for row in rows if "world" in row))
    walls = {row["world"]: row["walls"] for row in rows if "world" in row}
    head = [f"`{world}` ({walls[world]} walls), {beams} beams" for world, beams in cases]
    lines = [
        "# Other simulators",
        "",
        "Robots with a laser of 180° and 30 m drive about at random in the same worlds; a step is "
        "0.1 s. Each simulator is used in the way that is fastest on one core. The cells are its "
        "steps a second of processor time, and how many times as many `albot-env` makes in the "
        "same minutes, both medians of several turns. None of them maps, and none but the second "
        "has noise or other sensors. Some know a world as an image only: its cells are 5 cm.",
        "",
        "| simulator | robots at once | " + " | ".join(head) + " | ranges |",
        "|---|---:|" + "---:|" * len(cases) + "---|",
        *(_line(name, rows) for name in dict.fromkeys(row["name"] for row in rows)),
        "",
        "The ranges are compared with exact ones at the same poses: the largest median error of "
        "the columns. They are **wrong** where more than 10 % are off by more than 15 cm.",
        "",
        f"Measured on {machine['processor']}, Python {machine['python']}, by `{COMMAND}`.",
    ]
    return "\n".join(lines) + "\n"


def _line(name: str, rows: Sequence[Row]) -> str:
    """Return a simulator's line of the table."""
    own = [row for row in rows if row["name"] == name]
    if "missing" in own[0]:
        return f"| {name} | {own[0]['missing']} |"
    cells = [f"{row['steps_per_cpu_second']:,.0f} ({row['ratio']:,.1f} ×)" for row in own]
    name = " ".join(filter(None, (name, own[0]["version"])))
    return f"| {name} | {own[0]['robots']} | {' | '.join(cells)} | {range_accuracy(own)} |"


def range_accuracy(rows: Sequence[Row]) -> str:
    """Return the accuracy of a simulator's ranges in words."""
    off, error = max(row["off"] for row in rows), max(row["range_error"] for row in rows)
    if any(row["wrong"] for row in rows):
        return f"**wrong**: up to {off:.0%} off"
    return "exact" if error < 1e-3 else f"{100 * error:.1f} cm"
