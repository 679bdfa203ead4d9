"""What `albot map` tells of a run, as JSON and as a table."""

from __future__ import annotations

import math
from typing import Any

from albot_cli.mapping_run import MappingRun, Score
from albot_cli.recognition_report import recognition_row
from albot_core.evaluation.map_quality import laid_points, mean_map_entropy
from albot_core.evaluation.trajectory import RelationError
from albot_core.geometry.types import Poses
from albot_core.logs.log import Log


def report(log: Log, run: MappingRun, mapped: Score, odometry: Score) -> dict[str, Any]:
    """The run in figures; None where a figure is not known."""
    scans, snapshot = len(log.readings), run.mapper.snapshot()
    return {
        "log": log.name,
        "mapper": run.mapper.spec.name,
        "scans": scans,
        "path_m": log.path_length,
        "seconds": run.seconds,
        "scans_per_second": scans / run.seconds,
        "updates": run.updates,
        "surfaces": len(snapshot.segments),
        "places": len(snapshot.place_graph.nodes) or None,
        "ate_rmse_m": mapped.trajectory.rmse if mapped.trajectory else None,
        "odometry_ate_rmse_m": odometry.trajectory.rmse if odometry.trajectory else None,
        "relations": _relations(mapped.relations),
        "odometry_relations": _relations(odometry.relations),
        "map_entropy": _entropy(log, run.believed.poses),
        "odometry_map_entropy": _entropy(log, log.odometry),
        "left_out": None if log.left_out is None else vars(log.left_out),
    }


def _entropy(log: Log, poses: Poses) -> float | None:
    scans = [reading.required_laser("map entropy") for reading in log.readings]
    return mean_map_entropy(laid_points(scans, poses))


def _relations(error: RelationError | None) -> dict[str, int | float] | None:
    if error is None:
        return None
    return {
        "count": error.count,
        "translation_mean_m": error.translation_mean,
        "translation_std_m": error.translation_std,
        "rotation_mean_deg": math.degrees(error.rotation_mean),
        "rotation_std_deg": math.degrees(error.rotation_std),
    }


def as_table(figures: dict[str, Any]) -> str:
    """The figures as a few lines to read, the mapper's beside the odometer's."""
    lines = [
        f"{figures['log']}: {figures['scans']} scans along {figures['path_m']:.1f} m",
        f"{figures['mapper']}: {figures['surfaces']} surfaces after {figures['updates']} updates, "
        + (f"{_many(figures['places'], 'place')}, " if figures["places"] else "")
        + f"{figures['scans_per_second']:,.0f} scans/s",
    ]
    rows = [*_trajectory_rows(figures), *_relation_rows(figures), *_entropy_rows(figures)]
    if rows:
        names = (figures["mapper"], "odometer")
        width = max(len(row[0]) for row in rows)
        lines += ["", f"{'':<{width}}  {names[0]:>16}  {names[1]:>16}"]
        lines += [f"{label:<{width}}  {mine:>16}  {its:>16}" for label, mine, its in rows]
    if figures.get("recognition"):
        lines += ["", recognition_row(figures["recognition"])]
    if figures["left_out"]:
        lost = figures["left_out"]
        counts = f"{_many(lost['lines'], 'line')}, {_many(lost['scans'], 'scan')}"
        lines += ["", f"left out: {counts} ({lost['reason']})"]
    return "\n".join(lines)


def _many(count: int, thing: str) -> str:
    return f"{count} {thing}" + ("" if count == 1 else "s")


def _trajectory_rows(figures: dict[str, Any]) -> list[tuple[str, str, str]]:
    mine, its = figures["ate_rmse_m"], figures["odometry_ate_rmse_m"]
    if mine is None:
        return []
    return [("trajectory error, ATE rmse", f"{mine:.2f} m", f"{its:.2f} m")]


def _entropy_rows(figures: dict[str, Any]) -> list[tuple[str, str, str]]:
    mine, its = figures["map_entropy"], figures["odometry_map_entropy"]
    if mine is None or its is None:
        return []
    return [("map entropy, less is crisper", f"{mine:.2f}", f"{its:.2f}")]


def _relation_rows(figures: dict[str, Any]) -> list[tuple[str, str, str]]:
    mine, its = figures["relations"], figures["odometry_relations"]
    if mine is None:
        return []
    over = f"over {mine['count']} relations"
    return [
        (f"translation error {over}", _metres(mine), _metres(its)),
        (f"rotation error {over}", _degrees(mine), _degrees(its)),
    ]


def _metres(error: dict[str, int | float]) -> str:
    return f"{error['translation_mean_m']:.3f} ± {error['translation_std_m']:.3f} m"


def _degrees(error: dict[str, int | float]) -> str:
    return f"{error['rotation_mean_deg']:.2f} ± {error['rotation_std_deg']:.2f}°"
