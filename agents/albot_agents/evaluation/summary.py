"""Summarise an evaluation: rates and means over episodes, with confidence intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from albot_agents.evaluation.measured import MeasuredEpisode
from albot_agents.evaluation.trial import HORIZON
from albot_core.evaluation.intervals import bootstrap, wilson

_SEED = 0
"""Seed of the bootstrap."""


def summarise(outcomes: Sequence[MeasuredEpisode]) -> dict[str, Any]:
    """Return the figures of all episodes, and those of each world (`worlds`).

    - `success_rate`, with its 95 % Wilson interval `ci95`.
    - `spl` and `soft_spl`, means as in the literature, and `spl_median`; each with a bootstrapped
      95 % interval.
    - Distances along the shortest path (m).
    - `collisions_per_m`, which counts beginnings of contact.
    - `coverage_auc`, the mean share of ground covered over the first 200 m driven (`area_under`),
      and `rooms_share`, the mean share of rooms entered by the end; each with a bootstrapped 95 %
      interval. In an episode that ends before, no more is covered. `coverage_episodes` is the
      number of episodes that drove 200 m; without one, `coverage_auc` is None.
    - `precision` and `recall` over all judged places, or over all claims to know a room, and the
      number of `revisits`.

    Figures that the task does not measure are None; so is precision without a claim, and recall
    without a revisit.
    """
    figures = _figures(outcomes)
    ends = [outcome.info for outcome in outcomes]
    rng = np.random.default_rng(_SEED)
    intervals: dict[str, Any] = {"ci95": None, "spl_ci95": None, "spl_median_ci95": None}
    intervals |= {"soft_spl_ci95": None, "coverage_auc_ci95": None, "rooms_share_ci95": None}
    if ends and "is_success" in ends[0]:
        intervals["ci95"] = list(wilson(sum(end["is_success"] for end in ends), len(ends)))
    if ends and "spl" in ends[0]:
        spl = np.array([end["spl"] for end in ends])
        soft = np.array([end["soft_spl"] for end in ends])
        intervals["spl_ci95"] = list(bootstrap(spl, np.mean, rng))
        intervals["spl_median_ci95"] = list(bootstrap(spl, np.median, rng))
        intervals["soft_spl_ci95"] = list(bootstrap(soft, np.mean, rng))
    for name, values in (("coverage_auc", _areas(outcomes)), ("rooms_share", _rooms(outcomes))):
        if values:
            intervals[f"{name}_ci95"] = list(bootstrap(np.array(values), np.mean, rng))
    worlds = list(dict.fromkeys(outcome.world for outcome in outcomes))
    rows = [
        {"world": world, **_figures([each for each in outcomes if each.world == world])}
        for world in worlds
    ]
    return {**figures, **intervals, "worlds": rows}


def _figures(outcomes: Sequence[MeasuredEpisode]) -> dict[str, Any]:
    ends = [outcome.info for outcome in outcomes]
    driven = sum(outcome.driven for outcome in outcomes)
    collisions = sum(outcome.collisions for outcome in outcomes)
    return {
        "episodes": len(outcomes),
        "success_rate": _mean([end.get("is_success") for end in ends]),
        "spl": _mean([end.get("spl") for end in ends]),
        "spl_median": _median([end.get("spl") for end in ends]),
        "soft_spl": _mean([end.get("soft_spl") for end in ends]),
        "declared_rate": _mean([end.get("declared") for end in ends]),
        "mean_initial_distance_m": _mean([end.get("initial_distance_home") for end in ends]),
        "mean_final_distance_m": _mean([end.get("distance_home") for end in ends]),
        "median_final_distance_m": _median([end.get("distance_home") for end in ends]),
        "mean_way_m": driven / len(outcomes) if outcomes else None,
        "mean_coverage": _mean([end.get("coverage") for end in ends]),
        "coverage_auc": _mean(_areas(outcomes)),
        "coverage_episodes": far_episodes(outcomes),
        "rooms_share": _mean(_rooms(outcomes)),
        "rooms_share_median": _median(_rooms(outcomes)),
        "mean_position_error_m": _mean([end["position_error"] for end in ends]),
        **place_figures(ends),
        "cut_short": sum(bool(end.get("outward_cut_short")) for end in ends),
        "collisions_per_m": collisions / driven if driven else None,
    }


def _areas(outcomes: Sequence[MeasuredEpisode]) -> list[float]:
    """Return the area under each coverage curve; none if no episode drove as far."""
    if not far_episodes(outcomes):
        return []
    return [each.coverage_auc for each in outcomes if each.coverage_auc is not None]


def far_episodes(outcomes: Sequence[MeasuredEpisode]) -> int:
    """Return the number of episodes with a coverage curve that drove all of it."""
    return sum(each.driven >= HORIZON for each in outcomes if each.coverage_auc is not None)


def _rooms(outcomes: Sequence[MeasuredEpisode]) -> list[float]:
    """Return each episode's share of entered rooms, where its world has rooms."""
    return [each.info["rooms_entered"] / each.rooms for each in outcomes if each.rooms]


def place_figures(ends: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return precision and recall over all judged or claimed places.

    Both are None if the task judges no places. Precision is None if nothing is claimed, and recall
    if nothing is revisited: a share of nothing is no figure.
    """
    counted = (
        ("right_known", "false_known", "revisits"),
        ("right_claims", "false_claims", "re_entries"),
    )
    names = next((names for names in counted if ends and names[0] in ends[0]), None)
    if names is None:
        return {"precision": None, "recall": None, "revisits": None}
    right, false, revisits = (sum(int(end[name]) for end in ends) for name in names)
    return {
        "precision": right / (right + false) if right + false else None,
        "recall": right / revisits if revisits else None,
        "revisits": revisits,
    }


def _mean(values: Sequence[Any]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _median(values: Sequence[Any]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None
