"""The score of a mapper's run, and the figures that `albot map` reports: JSON and a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from albot_cli.error_report import error_figures
from albot_cli.mapping_run import MappingRun
from albot_core.counts import many
from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError
from albot_core.evaluation.map_quality import mean_map_entropy, scan_cloud
from albot_core.evaluation.moments import (
    NOT_PAIRED,
    clock_fault,
    pair_moments,
    read_clock,
)
from albot_core.evaluation.recognition import measure_recognition, precision_recall_figure
from albot_core.evaluation.trajectory import (
    ErrorStatistics,
    PositionErrors,
    RelationError,
    Relations,
    RelativeErrors,
    Trajectory,
    position_errors,
    relation_error,
    relative_errors,
)
from albot_core.geometry.types import Poses
from albot_core.logs.log import Log
from albot_core.maps.outlines import surfaces_of

RECOGNITION = "recognition.png"
"""File name of the picture that `draw_recognition` writes."""
NO_ODOMETRY = "the log's odometry is constant; the map is made by the scans alone"
"""What is told of a log without odometry."""
_UNKNOWN = "–"


@dataclass(frozen=True, kw_only=True)
class Score:
    """Errors of a trajectory; None where the ground truth is unknown."""

    positions: PositionErrors | None
    relative: RelativeErrors | None
    relations: RelationError | None

    @property
    def trajectory(self) -> ErrorStatistics | None:
        """The absolute trajectory error (m)."""
        return None if self.positions is None else ErrorStatistics.of(self.positions.distances)


def score(
    trajectory: Trajectory, reference: Trajectory | None, relations: Relations | None
) -> Score:
    """Compare a trajectory with the reference and the relations, if known."""
    return Score(
        positions=position_errors(trajectory, reference) if reference else None,
        relative=relative_errors(trajectory, reference) if reference else None,
        relations=relation_error(trajectory, relations) if relations else None,
    )


def check_moments(
    log: Log,
    truth: Trajectory | None,
    odometry: Score,
    reference: Path | None,
    relations: Path | None,
) -> None:
    """Raise InputError if the reference or the relations belong to another log.

    If part of the log was left out, all relations may concern that part; this is not an error, and
    neither are stamps that do not tell the time (see `notes_of`).

    Args:
        log: The log.
        truth: Its reference, if known.
        odometry: The score of its odometry.
        reference: File of the reference, if one was given.
        relations: File of the relations, if one was given.
    """
    unpaired = truth if odometry.trajectory is None else None
    if reference and unpaired is not None:
        how = pair_moments(log.stamps, unpaired.stamps).how
        if how != NOT_PAIRED:
            raise InputError(reference, f"moments of {log.name}", "stamps of another log")
    is_whole = log.unread is None and read_clock(log.stamps).is_good
    if relations and odometry.relations is None and is_whole:
        raise InputError(relations, f"moments of {log.name}", "stamps of another log")


def notes_of(
    log: Log,
    truth: Trajectory | None = None,
    reference: Path | None = None,
    relations: Relations | None = None,
) -> list[str]:
    """Return the notes that explain a log's figures, one line each.

    Args:
        log: The log.
        truth: Its reference, if known.
        reference: The reference's file, if it is not the log's own.
        relations: True relations, if known.
    """
    notes = [NO_ODOMETRY] if log.is_odometry_constant else []
    notes += [*log.notes, *map(str, log.resets)]
    has_clock = read_clock(log.stamps).is_good
    if truth is not None:
        fault = clock_fault(truth.stamps, "pose")
        what = "the reference's poses" if reference is None else f"the poses of {reference.name}"
        if fault is not None or not has_clock:
            remark = f" ({fault})" if fault is not None and has_clock else ""
            notes.append(f"{what} are {pair_moments(log.stamps, truth.stamps).how}{remark}")
    if relations is not None and not has_clock:
        error = relation_error(log.odometry_trajectory, relations)
        lost = len(relations.stamps) - (error.count if error else 0)
        notes.append(
            f"{many(lost, 'relation')} of {len(relations.stamps):,} are left out: their "
            "stamps are not those of one scan"
        )
    return notes


def report(
    log: Log,
    run: MappingRun,
    mapped: Score,
    corrected: Score | None,
    odometry: Score,
    notes: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the figures of the run; None for unknown ones.

    `ate_rmse_m` and `relations` are the errors of the poses estimated online at each scan. Those
    with `corrected_…` are the errors of the poses as estimated at the end, if the mapper corrects
    earlier poses. `ate_moments` is the number of moments that log and reference have in common.
    `errors` has the statistics of the errors as evo names them (see `error_figures`). A constant
    odometer has no figures.
    """
    if log.is_odometry_constant:
        odometry = Score(positions=None, relative=None, relations=None)
    scans, snapshot = len(log.readings), run.mapper.snapshot()
    return {
        "log": log.name,
        "mapper": run.mapper.spec.name,
        "scans": scans,
        "path_m": log.path_length,
        "seconds": run.seconds,
        "scans_per_second": scans / run.seconds,
        "updates": run.mapper.estimate.updates,
        "surfaces": len(surfaces_of(snapshot)),
        "places": len(snapshot.place_graph.nodes) or None,
        "ate_rmse_m": mapped.trajectory.rmse if mapped.trajectory else None,
        "ate_moments": mapped.trajectory.count if mapped.trajectory else None,
        "corrected_ate_rmse_m": (
            corrected.trajectory.rmse if corrected and corrected.trajectory else None
        ),
        "odometry_ate_rmse_m": odometry.trajectory.rmse if odometry.trajectory else None,
        "relations": _relations(mapped.relations),
        "corrected_relations": _relations(corrected.relations) if corrected else None,
        "odometry_relations": _relations(odometry.relations),
        "errors": error_figures(mapped),
        "corrected_errors": error_figures(corrected) if corrected else None,
        "odometry_errors": error_figures(odometry),
        "map_entropy": None if run.localisation else _entropy(log, run.believed.poses),
        "odometry_map_entropy": (None if log.is_odometry_constant else _entropy(log, log.odometry)),
        "localisation": run.localisation.figures if run.localisation else None,
        "left_out": left_out(log),
        "notes": list(notes),
    }


def _entropy(log: Log, poses: Poses) -> float | None:
    if log.ranges is None:
        return None
    scans = [reading.required_laser("map entropy") for reading in log.readings]
    return mean_map_entropy(scan_cloud(scans, poses))


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
    """Return the figures as text, the mapper's beside the odometer's."""
    lines = [
        f"{figures['log']}: {many(figures['scans'], 'scan')} along {figures['path_m']:.1f} m",
        f"{figures['mapper']}: {many(figures['updates'], 'update')}, "
        # A mapper without surfaces or places is not shown with none of them.
        + (f"{many(figures['surfaces'], 'surface')}, " if figures["surfaces"] else "")
        + (f"{many(figures['places'], 'place')}, " if figures["places"] else "")
        + f"{figures['scans_per_second']:,.0f} scans/s",
    ]
    if figures["localisation"]:
        lines.append(localisation_line(figures["localisation"]))
    rows = _comparison(figures)
    if rows:
        names = (figures["mapper"], "odometer")
        width = max(len(row[0]) for row in rows)
        lines += ["", f"{'':<{width}}  {names[0]:>16}  {names[1]:>16}"]
        lines += [f"{label:<{width}}  {mine:>16}  {its:>16}" for label, mine, its in rows]
    if figures.get("recognition"):
        lines += ["", recognition_row(figures["recognition"])]
    if figures["left_out"]:
        lines += ["", left_out_line(figures["left_out"])]
    if figures["notes"]:
        lines += ["", *(f"note: {note}" for note in figures["notes"])]
    if figures.get("files"):
        width = max(map(len, figures["files"]))
        lines += ["", *(f"{kind:<{width}}  {path}" for kind, path in figures["files"].items())]
    return "\n".join(lines)


def localisation_line(found: dict[str, Any]) -> str:
    """Return a line of text on how the robot localised itself in a saved map."""
    if found["localised_after_m"] is None:
        possible = many(found["hypotheses"], "possible pose")
        return f"{found['map']}: never localised; {found['standing']} at the end, {possible}"
    lost = f", lost {found['losses']} times" if found["losses"] else ""
    return (
        f"{found['map']}: localised after {found['localised_after_m']:.1f} m, at "
        f"{found['localised_share']:.0%} of the scans{lost}; {found['standing']} at the end"
    )


def left_out(log: Log) -> dict[str, Any] | None:
    """Return which part of a log was not read, as JSON; None if all of it was read."""
    return None if log.unread is None else vars(log.unread)


def left_out_line(lost: dict[str, Any]) -> str:
    """Return a line of text on the part of a log that was not read."""
    if not lost["lines"]:  # The size of the missing part is unknown.
        return f"not read: the rest ({lost['reason']})"
    counts = f"{many(lost['lines'], 'line')}, {many(lost['scans'], 'scan')}"
    return f"not read: {counts}, {lost['where']} ({lost['reason']})"


def _comparison(figures: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return rows of a label, the mapper's figure and the odometer's, where known."""
    rows = []
    mine, its = figures["ate_rmse_m"], figures["odometry_ate_rmse_m"]
    if mine is not None:
        # Over a few moments alone it is no error of the log.
        is_sparse = figures["ate_moments"] < figures["scans"] / 2
        over = f" over {many(figures['ate_moments'], 'moment')}" if is_sparse else ""
        odometer = _UNKNOWN if its is None else f"{its:.2f} m"
        rows.append((f"trajectory error, ATE rmse{over}", f"{mine:.2f} m", odometer))
    if (corrected := figures["corrected_ate_rmse_m"]) is not None:
        rows.append(("… of the corrected poses", f"{corrected:.2f} m", ""))
    for name, label, unit, digits in (
        ("rpe_m", "error per metre, RPE rmse", " m", 3),
        ("rpe_deg", "turn error per metre, RPE rmse", "°", 2),
    ):
        mine, its = (_rmse(figures[key], name) for key in ("errors", "odometry_errors"))
        if mine is not None:
            odometer = _UNKNOWN if its is None else f"{its:.{digits}f}{unit}"
            rows.append((label, f"{mine:.{digits}f}{unit}", odometer))
    mine, its = figures["relations"], figures["odometry_relations"]
    if mine is not None:
        over = f"over {mine['count']} relations"
        rows.append((f"translation error {over}", _metres(mine), _metres(its)))
        rows.append((f"rotation error {over}", _degrees(mine), _degrees(its)))
    mine, its = figures["map_entropy"], figures["odometry_map_entropy"]
    if mine is not None:
        odometer = _UNKNOWN if its is None else f"{its:.2f}"
        rows.append(("map entropy, lower is sharper", f"{mine:.2f}", odometer))
    return rows


def _rmse(errors: dict[str, Any] | None, name: str) -> float | None:
    found = None if errors is None else errors[name]
    return None if found is None else float(found["rmse"])


def _metres(error: dict[str, int | float] | None) -> str:
    if error is None:
        return _UNKNOWN
    return f"{error['translation_mean_m']:.3f} ± {error['translation_std_m']:.3f} m"


def _degrees(error: dict[str, int | float] | None) -> str:
    if error is None:
        return _UNKNOWN
    return f"{error['rotation_mean_deg']:.2f} ± {error['rotation_std_deg']:.2f}°"


def is_stamped(log: Log, truth: Trajectory) -> bool:
    """Return whether a trajectory holds the moments of all scans of a log."""
    return len(pair_moments(truth.stamps, log.stamps).second) == len(log.stamps)


def recognition_figures(log: Log, truth: Trajectory, believed: Trajectory) -> dict[str, Any]:
    """Return how well a log's places are recognised, given the true pose of each scan.

    `recall` is the recall of the queries at precision 1.00, 0.99 and 0.95; `curve` holds recall and
    precision. `detection` is the detection rate of near pairs at false-alarm rates 0.00 and 0.01
    over all other pairs. A share of nothing is None.
    """
    at = pair_moments(truth.stamps, log.stamps).first
    found = measure_recognition(log.readings, truth.poses[at], believed.poses)
    return {
        "queries": found.queries,
        "claims": len(found.scores),
        "recall": {
            share: found.recall_at(float(share)) if found.queries else None
            for share in ("1.00", "0.99", "0.95")
        },
        "curve": found.curve.tolist(),
        "pairs": {
            "near": int(found.pair_near.sum()),
            "others": int((~found.pair_near).sum()),
            "detection": {
                rate: found.detection_at(float(rate)) if found.pair_near.any() else None
                for rate in ("0.00", "0.01")
            },
        },
    }


def draw_recognition(folder: Path, title: str, figures: dict[str, Any]) -> str:
    """Draw the precision-recall curve into a folder; return the picture's path."""
    path = folder / RECOGNITION
    curve = np.reshape(figures["curve"], (-1, 2)).astype(float)
    save_figure(precision_recall_figure(title, curve), path)
    return str(path)


def recognition_row(figures: dict[str, Any]) -> str:
    """Return the figures as one line of text."""
    recall, pairs = figures["recall"], figures["pairs"]
    if not figures["queries"]:
        return "recognised: nothing to measure, because no place was seen again"
    detection = pairs["detection"]
    return (
        f"recognised of {figures['queries']} places seen before: {recall['1.00']:.0%} without a "
        f"false alarm, {recall['0.99']:.0%} with 1 % of them, {recall['0.95']:.0%} with 5 %; of "
        f"{pairs['near']} pairs of one place {detection['0.00']:.0%} without a false alarm among "
        f"{pairs['others']} others, {detection['0.01']:.0%} with 1 % of them"
    )
