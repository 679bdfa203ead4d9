"""The table of the benchmark: figures of each cell, with 95 % intervals and paired differences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from albot_agents.benchmark.cell import Cell, EpisodeResult
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.protocol import Protocol
from albot_agents.evaluation.paired import episode_figures
from albot_agents.evaluation.summary import far_episodes
from albot_core.errors import InputError
from albot_core.evaluation.intervals import (
    bootstrap_cluster_ratios,
    wilson,
    wilson_clusters,
)

_SEED = 0
"""Seed of the bootstrap."""

Value = Callable[[EpisodeResult], float | None]
"""A value of an episode; None if it has none."""


def _info(name: str) -> Value:
    return lambda one: one.info.get(name)


def _counts(*names: str) -> Value:
    """Return the sum of counts in the info: judged places, or claims."""

    def count(one: EpisodeResult) -> float | None:
        found = [one.info[name] for name in names if name in one.info]
        return float(sum(found)) if found else None

    return count


def _one(_: EpisodeResult) -> float:
    return 1.0


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of a cell: a mean over its episodes, or a ratio of sums."""

    title: str
    """Its name on the page."""
    form: str
    """Its format there."""
    value: Value
    """The value of an episode, or the numerator."""
    of: Value = _one
    """The denominator."""


_OF_COUNTS = ("precision", "recall")
"""Figures that are shares of counted places or claims."""
_RIGHT, _FALSE = ("right_known", "right_claims"), ("false_known", "false_claims")

FIGURES: Mapping[str, Figure] = {
    "success_rate": Figure(title="success", form="{:.0%}", value=_info("is_success")),
    "spl": Figure(title="SPL", form="{:.2f}", value=_info("spl")),
    "soft_spl": Figure(title="soft SPL", form="{:.2f}", value=_info("soft_spl")),
    "final_distance_m": Figure(
        title="from home in the end (m)", form="{:.1f}", value=_info("distance_home")
    ),
    "precision": Figure(
        title="precision", form="{:.1%}", value=_counts(*_RIGHT), of=_counts(*_RIGHT, *_FALSE)
    ),
    "recall": Figure(
        title="recall", form="{:.0%}", value=_counts(*_RIGHT), of=_counts("revisits", "re_entries")
    ),
    "coverage_auc": Figure(
        title="covered over 200 m", form="{:.2f}", value=lambda one: one.coverage_auc
    ),
    "coverage": Figure(
        title="covered in the end",
        form="{:.2f}",
        value=lambda one: None if one.coverage_auc is None else one.info["coverage"],
    ),
    "rooms_share": Figure(
        title="rooms entered",
        form="{:.0%}",
        value=lambda one: one.info["rooms_entered"] / one.rooms if one.rooms else None,
    ),
    "collisions_per_m": Figure(
        title="collisions a metre",
        form="{:.3f}",
        value=lambda one: one.collisions,
        of=lambda one: one.driven,
    ),
    "position_error_m": Figure(
        title="position error (m)", form="{:.2f}", value=_info("position_error")
    ),
}
"""The figures of a cell by name."""


SHORT: Mapping[str, tuple[str, ...]] = {
    "spl": ("success_rate", "spl"),
    "success": ("success_rate",),
    "coverage_auc": ("coverage_auc",),
    "recall": ("precision", "recall"),
}
"""What a cell of a short table shows, by the figure that the protocol compares."""


def named(figure: str) -> str:
    """Return the name in `FIGURES` of a figure of `paired`."""
    return {"success": "success_rate"}.get(figure, figure)


def has_interval(episodes: int, name: str) -> bool:
    """Return whether a figure's interval says something: one episode is not resampled."""
    return episodes > 1 or name == "success_rate"


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A figure of a cell."""

    value: float
    """The figure."""
    ci95: tuple[float, float]
    """Its 95 % interval."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """By how much an agent exceeds the reference of its task, in the same episodes."""

    value: float
    """The mean difference of the figure that the protocol compares."""
    ci95: tuple[float, float]
    """Its 95 % interval."""
    episodes: int
    """Number of episodes that both have run."""


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """A cell's figures."""

    cell: Cell
    """The cell."""
    episodes: int
    """Number of episodes."""
    figures: Mapping[str, Estimate]
    """The figures that its task measures; see `FIGURES`."""
    difference: Difference | None
    """The difference from the reference; None for the reference, or without its episodes."""


def make_table(results: Sequence[CellResults], protocol: Protocol) -> list[TableRow]:
    """Return the figures of cells: tasks, worlds and odometers in the protocol's order.

    Raises:
        InputError: Two agents began the same episode at different poses.
    """
    cells = {found.cell: found.episodes for found in results if found.episodes}

    def place(cell: Cell) -> tuple[Any, ...]:
        *where, agent, mapper = protocol.order(cell)
        return (*where, agent != protocol.tasks[cell.task].reference, agent, mapper)

    rows = []
    for cell in sorted(cells, key=place):
        measured = protocol.tasks[cell.task]
        others = next(
            (
                episodes
                for other, episodes in cells.items()
                if other.agent == measured.reference
                and _without_agent(other) == _without_agent(cell)
            ),
            None,
        )
        difference = None
        if others is not None and cell.agent != measured.reference:
            where = f"{cell.task}, {cell.worlds}, {cell.odometer}"
            difference = compare(where, cells[cell], others, measured.figure)
        rows.append(
            TableRow(
                cell=cell,
                episodes=len(cells[cell]),
                figures=estimate(cells[cell]),
                difference=difference,
            )
        )
    return rows


def _without_agent(cell: Cell) -> tuple[str, str, str]:
    return cell.task, cell.odometer, cell.worlds


def estimate(episodes: Sequence[EpisodeResult]) -> dict[str, Estimate]:
    """Return the figures of a cell, as far as its task measures them.

    Intervals are Wilson's for rates of success (`wilson_clusters`). Others are bootstrapped: worlds
    are drawn with all of their episodes, or episodes where there is one world. Where precision or
    recall is 0 or 1, all resamples say the same, and Wilson's of the counts stands. A ratio to
    nothing, such as the precision without a claim, is left out, and so is the coverage over 200 m
    if no episode drove as far.
    """
    tops, bottoms, names = [], [], []
    for name, figure in FIGURES.items():
        pairs = [(figure.value(one), figure.of(one)) for one in episodes]
        known = [(0.0, 0.0) if None in pair else pair for pair in pairs]
        top, bottom = np.array(known, np.float64).T
        if bottom.sum() > 0 and (name != "coverage_auc" or far_episodes(episodes)):
            names.append(name)
            tops.append(top)
            bottoms.append(bottom)
    rng = np.random.default_rng(_SEED)
    columns = np.array(tops).T, np.array(bottoms).T
    intervals = bootstrap_cluster_ratios(*columns, _clusters(episodes), rng)
    found = {}
    for name, top, bottom, interval in zip(names, tops, bottoms, intervals, strict=True):
        if name == "success_rate":
            interval = wilson_clusters(top > 0, _clusters(episodes))
        elif name in _OF_COUNTS and top.sum() in (0, bottom.sum()):
            interval = wilson(int(top.sum()), int(bottom.sum()))
        assert interval is not None, name
        found[name] = Estimate(value=float(top.sum() / bottom.sum()), ci95=interval)
    return found


def _clusters(episodes: Sequence[EpisodeResult]) -> list[str | int]:
    """Return what is drawn for an interval: worlds, or episodes if all are in one world."""
    worlds = [one.world for one in episodes]
    return [*worlds] if len(set(worlds)) > 1 else [one.seed for one in episodes]


def compare(
    where: str, episodes: Sequence[EpisodeResult], others: Sequence[EpisodeResult], figure: str
) -> Difference | None:
    """Return by how much a figure exceeds the reference's, in the episodes that both have.

    Args:
        where: The cell, for the error.
        episodes: Its episodes.
        others: The reference's.
        figure: The figure, one of `paired.FIGURES`.

    Raises:
        InputError: They began an episode at different poses.
    """
    known = {(other.world, other.seed): other for other in others}
    pairs = [(one, known[key]) for one in episodes if (key := (one.world, one.seed)) in known]
    for one, other in pairs:
        same = (one.start == other.start).all() and (one.begin == other.begin).all()
        if not same:
            expected = f"the same episodes for {one.agent} and {other.agent}"
            found = f"different beginnings in {one.world}, seed {one.seed}"
            raise InputError(where, expected, f"{found}; remove the older of their files")
    both = [
        (one, mine - its)
        for one, other in pairs
        if (mine := episode_figures(one).get(figure)) is not None
        and (its := episode_figures(other).get(figure)) is not None
    ]
    if not both:
        return None
    apart = np.array([[difference] for _, difference in both])
    rng = np.random.default_rng(_SEED)
    clusters = _clusters([one for one, _ in both])
    (interval,) = bootstrap_cluster_ratios(apart, np.ones_like(apart), clusters, rng)
    assert interval is not None
    return Difference(value=float(apart.mean()), ci95=interval, episodes=len(apart))
