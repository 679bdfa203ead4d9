"""The figures of an evaluation, of outcomes made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from albot_agents.evaluation.picture import failures_figure
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.summary import summarise
from albot_agents.evaluation.trial import Outcome
from albot_core.evaluation.intervals import wilson


def _outcome(world: str, seed: int, spl: float, **facts: Any) -> Outcome:
    info = {
        "is_success": spl > 0, "declared": True, "spl": spl, "soft_spl": spl / 2,
        "distance_home": 0.5 if spl else 8.0, "initial_distance_home": 10.0, "coverage": 0.25,
        "position_error": 1.0, "outward_cut_short": False,
    }  # fmt: skip
    return Outcome(
        trial=Trial(task="Albot/Homing-v0", agent="random", world=world, seed=seed),
        info={**info, **facts},
        start=np.array((5.0, 5.0, 0.0)),
        begin=np.array((1.0, 1.0, 0.0)),
        path=np.array(((1.0, 1.0), (4.0, 5.0), (4.0, 10.0))),
        collisions=1,
    )


OUTCOMES = [
    _outcome("square-loop", 1, 0.9),
    _outcome("square-loop", 2, 0.0),
    _outcome("office-ring", 1, 0.6),
    _outcome("office-ring", 2, 0.5, outward_cut_short=True),
]


def test_figures_are_those_by_hand() -> None:
    figures = summarise(OUTCOMES)
    assert figures["episodes"] == 4
    assert figures["success_rate"] == 0.75
    assert figures["ci95"] == list(wilson(3, 4))
    assert figures["spl"] == pytest.approx(0.5)
    assert figures["spl_median"] == pytest.approx(0.55)
    assert figures["soft_spl"] == pytest.approx(0.25)
    assert figures["mean_final_distance_m"] == pytest.approx((3 * 0.5 + 8) / 4)
    assert figures["collisions_per_m"] == pytest.approx(1 / 10)
    assert figures["mean_way_m"] == pytest.approx(10.0)
    assert figures["cut_short"] == 1
    for name, mean in (("spl", 0.5), ("spl_median", 0.55), ("soft_spl", 0.25)):
        low, high = figures[f"{name}_ci95"]
        assert low < mean < high


def test_each_world_has_a_row() -> None:
    rows = summarise(OUTCOMES)["worlds"]
    assert [(row["world"], row["episodes"], row["success_rate"]) for row in rows] == [
        ("square-loop", 2, 0.5), ("office-ring", 2, 1.0),
    ]  # fmt: skip


def test_what_a_task_does_not_know_is_none() -> None:
    bare = Outcome(
        trial=Trial(task="Albot/Explore-v0", agent="random", world="square-loop", seed=1),
        info={"coverage": 0.5, "position_error": 0.0},
        start=np.zeros(3),
        begin=np.array((1.0, 1.0, 0.0)),
        path=np.zeros((1, 2)),
        collisions=0,
    )
    figures = summarise([bare])
    assert figures["mean_coverage"] == 0.5
    missing = ("success_rate", "ci95", "spl", "mean_final_distance_m", "collisions_per_m")
    assert all(figures[key] is None for key in missing)
    assert summarise([])["episodes"] == 0


@pytest.mark.parametrize(
    "names",
    [
        ("right_known", "false_known", "revisits"),
        ("right_claims", "false_claims", "re_entries"),
    ],
)
@pytest.mark.parametrize(
    ("counts", "precision", "recall"),
    [
        ((3, 1, 6), 0.75, 0.5),
        ((0, 2, 5), 0.0, 0.0),
        ((0, 0, 5), None, 0.0),  # Nothing was claimed.
        ((0, 2, 0), 0.0, None),  # There was nothing to know again.
        ((0, 0, 0), None, None),
    ],
)
def test_a_share_of_nothing_is_no_figure(
    names: tuple[str, ...],
    counts: tuple[int, ...],
    precision: float | None,
    recall: float | None,
) -> None:
    figures = summarise([_outcome("square-loop", 1, 0.9, **dict(zip(names, counts, strict=True)))])
    rates = figures["precision"], figures["recall"], figures["revisits"]
    assert rates == (precision, recall, counts[2])
    assert {name: figures["worlds"][0][name] for name in ("precision", "recall")} == {
        "precision": precision, "recall": recall,
    }  # fmt: skip


def test_failures_are_drawn_if_there_are_any() -> None:
    figure = failures_figure(OUTCOMES)
    assert figure is not None
    failed = [outcome for outcome in OUTCOMES if not outcome.info["is_success"]]
    drawn = [axes for axes in figure.axes if axes.has_data()]
    assert len(drawn) == len(failed)
    legend = {text.get_text() for text in figure.legends[0].get_texts()}
    assert legend == {"path driven", "start", "home", "end"}
    assert failures_figure(OUTCOMES[2:]) is None
