"""The output of `albot compare`: rows of medians, their table, and the maps side by side."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from albot_cli.map_report import is_stamped, left_out_line
from albot_cli.mapper_runs import MapperChoice, RunResult, Source
from albot_cli.outputs import FigureFile, filled_folder
from albot_core.counts import many
from albot_core.drawing.figure import save_figure
from albot_core.evaluation.moments import pair_moments
from albot_core.evaluation.trajectory import Trajectory, alignment
from albot_core.export.picture import Panel, layer_points, maps_figure
from albot_core.files import atomic_write, write_text
from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.geometry.types import Segments
from albot_env.rendering.page.comparison_page import comparison_page

FIGURES, TABLE, PICTURE = "comparison.json", "comparison.md", "comparison.png"
FILES = (FIGURES, TABLE, PICTURE)
"""The names of the files that `--out` writes."""

_Cell = Callable[[dict[str, Any]], str | None]


def rows_of(choices: Sequence[MapperChoice], results: Sequence[RunResult]) -> list[dict[str, Any]]:
    """Return a row for each mapper: the medians over its runs, its worst error, and its runs."""
    rows = []
    for choice in choices:
        runs = [result.figures for result in results if result.figures["mapper"] == choice.label]
        runs.sort(key=lambda run: run["seed"])
        whole = [run for run in runs if run["error"] is None]
        figures = {key: _median([run[key] for run in whole]) for key in _keys(whole)}
        errors = [run["ate_rmse_m"] for run in whole if run["ate_rmse_m"] is not None]
        worst = {"worst_ate_rmse_m": max(errors, default=None)}
        rows.append({"mapper": choice.label, **figures, **worst, "runs": runs})
    return rows


def _keys(runs: Sequence[dict[str, Any]]) -> list[str]:
    return [key for run in runs[:1] for key in run if key not in ("mapper", "seed", "error")]


def _median(values: list[Any]) -> Any:
    """Return the median of the known values; for groups of figures, of each figure."""
    known = [value for value in values if value is not None]
    if not known:
        return None
    if isinstance(known[0], dict):
        return {key: _median([value[key] for value in known]) for key in known[0]}
    return known[0] if len(known) == 1 else float(np.median(known))


def _number(key: str, digits: int, scale: float = 1.0) -> _Cell:
    def cell(row: dict[str, Any]) -> str | None:
        value: Any = row
        for part in key.split("."):
            value = None if value is None else value.get(part)
        return None if value is None else f"{scale * value:,.{digits}f}"

    return cell


def _error(row: dict[str, Any]) -> str | None:
    """Return the error; with several runs, also the worst one."""
    error = _number("ate_rmse_m", 3)(row)
    if error is None or len(row["runs"]) < 2:
        return error
    return f"{error} ({row['worst_ate_rmse_m']:.3f})"


_COLUMNS: tuple[tuple[str, _Cell], ...] = (
    ("ATE, m", _error),
    ("corrected, m", _number("corrected_ate_rmse_m", 3)),
    ("unaligned, m", _number("unaligned_rmse_m", 2)),
    ("relations, m", _number("relations.translation_mean_m", 3)),
    ("relations, °", _number("relations.rotation_mean_deg", 2)),
    ("corrected, m", _number("corrected_relations.translation_mean_m", 3)),
    ("corrected, °", _number("corrected_relations.rotation_mean_deg", 2)),
    ("entropy", _number("map_entropy", 2)),
    ("corrected", _number("corrected_map_entropy", 2)),
    ("updates", _number("updates", 0)),
    ("map, KiB", _number("map_bytes", 0, 1 / 1024)),
    ("readings/s", _number("readings_per_second", 0)),
    ("slowest, ms", _number("slowest_reading_ms", 1)),
    ("peak, MiB", _number("peak_mib", 0)),
)
"""Title and content of each column. Columns without any known value are left out."""


def _cells(rows: Sequence[dict[str, Any]]) -> list[list[str]]:
    """Return the table: its head, then its rows."""
    columns = [("mapper", [row["mapper"] for row in rows])]
    for head, cell in _COLUMNS:
        cells = [cell(row) for row in rows]
        if any(text is not None for text in cells):
            columns.append((head, [text or "–" for text in cells]))
    return [[head for head, _ in columns]] + [
        [cells[k] for _, cells in columns] for k in range(len(rows))
    ]


def as_markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as a Markdown table."""
    head, *body = _cells(rows)
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *body]
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{table}\n\n{note}" if (note := brackets(rows)) else table


def as_text(facts: dict[str, Any]) -> str:
    """Return the comparison as text for the terminal."""
    table = _cells(facts["rows"])
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = [
        f"{facts['source']}: {many(facts['readings'], 'reading')} along {facts['path_m']:.1f} m, "
        f"seeds {facts['seeds']}" + (", stopped before the end" if facts["stopped"] else ""),
        "",
    ]
    for first, *cells in table:
        right = (f"{cell:>{width}}" for cell, width in zip(cells, widths[1:], strict=True))
        lines.append("  ".join((f"{first:<{widths[0]}}", *right)).rstrip())
    lines += [note] if (note := brackets(facts["rows"])) else []
    died = [run for row in facts["rows"] for run in row["runs"] if run["error"] is not None]
    lines += [f"{run['mapper']}, seed {run['seed']}: {run['error']}" for run in died]
    lines += [left_out_line(facts["left_out"])] if facts["left_out"] else []
    lines += [f"note: {note}" for note in facts["notes"]]
    lines += [f"{kind}  {path}" for kind, path in facts["files"].items()]
    return "\n".join(lines)


def write_files(
    folder: Path | None,
    figure: FigureFile | None,
    facts: dict[str, Any],
    results: Sequence[RunResult],
    sources: Sequence[Source],
) -> None:
    """Write figures, table and picture, and the figure for a paper; enter the paths into `facts`.

    The picture is of the first seed. The folder's files are replaced once all are written.
    """
    panels = panels_of(facts["rows"], results, sources[0])
    drawn = maps_figure(panels) if panels else None
    if figure is not None and drawn is not None:
        facts["files"]["figure"] = str(figure.save(drawn))
    if folder is None:
        return
    names = {"figures": FIGURES, "table": TABLE} | ({"picture": PICTURE} if drawn else {})
    facts["files"] |= {kind: str(folder / name) for kind, name in names.items()}
    with filled_folder(folder) as scratch:
        write_text(scratch / FIGURES, json.dumps(facts, indent=1))
        write_text(scratch / TABLE, as_markdown(facts["rows"]) + "\n")
        if drawn is not None:
            save_figure(drawn, scratch / PICTURE)


def write_page(
    page: Path,
    facts: dict[str, Any],
    results: Sequence[RunResult],
    source: Source,
    walls: Segments | None,
    command: str,
) -> None:
    """Write the page that plays the maps of the first seed; enter its path into `facts`.

    Maps are drawn in their own frame, which begins where the robot started. The truth is laid into
    it at the start if the walls are known, otherwise by the best alignment with the first mapper.

    Args:
        page: The file.
        facts: The figures of the comparison.
        results: The runs.
        source: The log of the first seed.
        walls: The walls of the world that was explored (world frame); None for a log.
        command: The command that makes the comparison again.
    """
    log, truth = source.log, source.reference
    order = [row["mapper"] for row in facts["rows"]]
    first = [each for each in results if each.figures["seed"] == source.seed]
    first.sort(key=lambda result: order.index(result.figures["mapper"]))
    drawn = [result for result in first if result.track is not None]
    died = [
        f"{each.figures['mapper']}: {each.figures['error']}" for each in first if not each.track
    ]
    errors: dict[str, np.ndarray] = {}
    poses = None
    if truth is not None and is_stamped(log, truth):
        frame = None
        known = truth.poses[pair_moments(truth.stamps, log.stamps).first]
        for result in drawn:
            assert result.track is not None
            believed = Trajectory(stamps=log.stamps, poses=result.track.poses)
            aligned = alignment(truth, believed)
            if aligned is not None:
                off = (compose(aligned, known) - believed.poses)[:, :2]
                errors[result.figures["mapper"]] = np.hypot(*off.T)
                frame = aligned if frame is None else frame
        frame = inverse(known[0]) if walls is not None else frame
        if frame is not None:
            poses = compose(frame, known)
            walls = None if walls is None else transform_segments(frame, walls)
    content = comparison_page(
        f"mappers on {facts['source']}",
        {
            "drive": facts["source"],
            "seed": source.seed,
            "readings": len(log.readings),
            "without a map": "; ".join(died),
        },
        readings=log.readings,
        tracks=[result.track for result in drawn if result.track is not None],
        errors=errors,
        poses=poses,
        walls=walls if poses is not None else None,
        command=command,
    )
    with atomic_write(page) as stream:
        stream.write(content)
    facts["files"]["page"] = str(page)


def panels_of(
    rows: Sequence[dict[str, Any]], results: Sequence[RunResult], source: Source
) -> list[Panel]:
    """Return the maps of the first seed, in the order of the rows.

    A title tells the error of the map that is drawn and, as the table, the median of all seeds.
    """
    drawn = {
        result.figures["mapper"]: result
        for result in results
        if result.figures["seed"] == source.seed
    }
    panels = []
    for row in rows:
        result = drawn.get(row["mapper"])
        if result is None:
            continue
        title = _title(row, result.figures)
        if result.snapshot is None or result.path is None:
            note = f"no map: {result.figures['error']}"
            panels.append(Panel(title, None, np.zeros((0, 3)), note=note))
            continue
        laid = None
        if source.reference is not None:
            frame = alignment(source.reference, result.path)
            laid = None if frame is None else compose(frame, source.reference.poses)
        shows = any(len(layer_points(layer)) for layer in result.snapshot.layers)
        note = "" if shows else "a path, but no map"
        panels.append(Panel(title, result.snapshot, result.path.poses, laid, note))
    return panels


def _title(row: dict[str, Any], drawn: dict[str, Any]) -> str:
    """Return a panel's title: mapper, the error of the run drawn, and the median if it differs."""
    error = drawn.get("ate_rmse_m")
    if error is None:
        return str(row["mapper"])
    lines = [row["mapper"], f"ATE {error:.3f} m"]
    if (corrected := drawn.get("corrected_ate_rmse_m")) is not None:
        lines[1] += f", corrected {corrected:.3f} m"
    if len(row["runs"]) > 1:
        lines[1] += f" (seed {drawn['seed']}; median {row['ate_rmse_m']:.3f} m)"
    return "\n".join(lines)


def brackets(rows: Sequence[dict[str, Any]]) -> str:
    """Return what the numbers in brackets are; empty for a single run of each mapper."""
    if all(len(row["runs"]) < 2 for row in rows):
        return ""
    return "Medians over the seeds; in brackets the largest ATE of a seed."
